"""Limits of mesh files, so that every file is read or rejected within seconds."""

from __future__ import annotations

from typing import NamedTuple


class MeshLimits(NamedTuple):
    """Largest sizes and counts."""

    max_bytes: int = 50_000_000
    """Size of a mesh file, and total size of the files to which it refers [bytes]."""
    max_triangles: int = 2_000_000
    """Triangles of a file; every instance of a mesh counts."""
    max_coordinate: float = 1e9
    """Largest coordinate of a corner, in the file's unit, so that products stay finite."""
    max_pieces: int = 10_000
    """Closed pieces of a file."""
    max_tested: int = 50_000_000
    """Triangles in all tests of a piece lying inside another."""
    max_nodes: int = 100_000
    """Nodes of a file; every instance counts."""
    max_pixels: int = 70_000_000
    """Pixels of an image: a little more than 8192 x 8192."""
    max_colours: int = 64
    """Distinct colours of a file; more are merged."""


LIMITS = MeshLimits()
