"""STL and PLY: formats without unit and upward axis.

A facet is a triangle of an STL file.
"""

from __future__ import annotations

import io
import re
import struct
from typing import Any

import numpy as np

from fantoccini.base import Array, decoded
from fantoccini.model.meshes.part import Part, TriangleCount, ignored_properties

_HEADER_BYTES = 84
"""Size of a binary STL's header; its last four bytes are the number of triangles."""
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_CORNER = r"\s+vertex\s+(\S+)\s+(\S+)\s+(\S+)"
_FACET = re.compile(rf"\bloop{3 * _CORNER}\s+endloop\b", re.IGNORECASE)
_LOOP = re.compile(r"\bouter\s+loop\b", re.IGNORECASE)


def read_stl(content: bytes) -> list[Part]:
    """The single part of an STL file, binary or text.

    The file is binary if it is long enough for the triangle count in its header; in a text file
    these four bytes give 100 million or more. Bytes after the triangles are ignored.

    Raises:
        ValueError: the file is not a mesh.
    """
    header = content[:_HEADER_BYTES]
    (count,) = struct.unpack("<I", header[80:]) if len(header) == _HEADER_BYTES else (0,)
    if _HEADER_BYTES + count * _TRIANGLE.itemsize <= len(content) and count:
        TriangleCount().add(count)
        corners = np.frombuffer(content, _TRIANGLE, count, _HEADER_BYTES)["corners"]
        return [_from_corners(corners.reshape(-1, 3))]
    text = decoded(content)
    n_loops = len(_LOOP.findall(text))
    if not n_loops and b"\0" in content:
        capacity = max(len(content) - _HEADER_BYTES, 0) // _TRIANGLE.itemsize
        raise ValueError(f"its header counts {count} triangles; the file has room for {capacity}")
    TriangleCount().add(n_loops)
    facets = _FACET.findall(text)
    if len(facets) < n_loops:
        raise ValueError(_first_broken_facet(text))
    try:
        return [_from_corners(np.array(facets, dtype=float).reshape(-1, 3))]
    except ValueError as reason:
        text = f"it has a vertex that is not three numbers: {str(reason)[:90]}"
        raise ValueError(text) from None


def _first_broken_facet(text: str) -> str:
    """Error message for the first facet that does not have three vertices."""
    for begin in _LOOP.finditer(text):
        if not _FACET.match(text, begin.end() - len("loop")):
            line = len(re.findall(r"\r\n?|\n", text[: begin.start()])) + 1
            return f"line {line}: found a facet that is not three vertices of three numbers"
    return "it has facets inside facets"


def _from_corners(corners: Array) -> Part:
    """A part with m triangles, from their corners (3 m, 3)."""
    return Part(np.array(corners, dtype=float), np.arange(len(corners)).reshape(-1, 3), None)


def read_ply(content: bytes) -> list[Part]:
    """The parts of a PLY file, read by trimesh.

    Raises:
        ValueError: the file is not a mesh.
    """
    import trimesh

    try:
        loaded = trimesh.load(io.BytesIO(content), file_type="ply")
    except Exception as reason:  # trimesh raises errors of many classes for broken files
        raise ValueError(f"trimesh reports {type(reason).__name__}") from reason
    meshes = loaded.dump() if isinstance(loaded, trimesh.Scene) else [loaded]
    count, parts = TriangleCount(), []
    for mesh in meshes:
        if isinstance(mesh, trimesh.Trimesh):
            count.add(len(mesh.faces))
            vertices, faces = np.array(mesh.vertices, dtype=float), np.array(mesh.faces)
            parts.append(Part(vertices, faces, *_colours(mesh)))
    return parts


def _colours(mesh: Any) -> tuple[Array | None, frozenset[str]]:
    """sRGB of faces from face or vertex colours, and the names of lost properties."""
    visual = mesh.visual
    if visual.kind not in ("face", "vertex"):
        return None, frozenset()
    colours = np.array(visual.face_colors, dtype=float)
    return colours[:, :3] / 255.0, ignored_properties(False, bool(np.any(colours[:, 3] < 255)))
