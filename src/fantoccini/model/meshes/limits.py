"""Limits of mesh files, so that any file is read or refused within seconds."""

from __future__ import annotations

from typing import NamedTuple


class MeshLimits(NamedTuple):
    """Largest sizes and counts."""

    max_bytes: int = 50_000_000
    """Size of a mesh file, and of all files that it names together [bytes]."""
    max_triangles: int = 2_000_000
    """Triangles of a file, those of a mesh once for each place at which it stands."""
    max_coordinate: float = 1e9
    """Largest coordinate of a corner, in the file's unit, so that products stay finite."""
    max_pieces: int = 10_000
    """Closed pieces of a file."""
    max_tested: int = 50_000_000
    """Triangles of pieces in which others may lie, once for each of these."""
    max_nodes: int = 100_000
    """Nodes of a file, counted likewise."""
    max_pixels: int = 70_000_000
    """Pixels of an image: a little more than 8192 x 8192."""
    max_colours: int = 64
    """Colours of a file; those of finer textures are merged."""


LIMITS = MeshLimits()
