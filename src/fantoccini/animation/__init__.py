"""Motions as animations that other programs open: glTF and USD.

``export`` writes what the ending of the file's name asks for; a table says which endings there are.
"""

from fantoccini.animation.exporting import export
from fantoccini.animation.formats import ENDINGS
from fantoccini.animation.scene import check_bodies

__all__ = ["ENDINGS", "check_bodies", "export"]
