"""Mesh files: triangles, material colours, and closed components.

A part is the triangles of one material. A component is a connected piece of a closed surface, with
its hollows.
"""

from fantoccini.model.meshes.files import FORMATS, MeshFile, contents, read
from fantoccini.model.meshes.limits import LIMITS
from fantoccini.model.meshes.solid import inside, is_closed, pieces

__all__ = ["FORMATS", "LIMITS", "MeshFile", "contents", "inside", "is_closed", "pieces", "read"]
