"""Mesh files: triangles, material colours, and closed components."""

from fantoccini.model.meshes.files import FORMATS, MeshFile, contents, read
from fantoccini.model.meshes.limits import LIMITS
from fantoccini.model.meshes.solid import inside, is_closed, pieces

__all__ = ["FORMATS", "LIMITS", "MeshFile", "contents", "inside", "is_closed", "pieces", "read"]
