"""Motions as animations that other programs open: glTF, OpenUSD, BVH, CSV, MCAP.

``export`` writes what the ending of the file's name asks for; a table says which endings there are.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
