"""Part of a mesh file: triangles of one material."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array, Indices
from fantoccini.meshes.limits import LIMITS

Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Turns a y that is up into a z that is up, about x."""


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles.

    Attributes:
        vertices: (n, 3).
        faces: (m, 3) indices of vertices, anticlockwise from outside.
        colours: (m, 3) sRGB of the faces; None where they have no material.
    """

    vertices: Array
    faces: Indices
    colours: Array | None

    @classmethod
    def placed(cls, matrix: Array, vertices: Array, faces: Indices, colours: Array | None) -> Part:
        """A part moved by a matrix (4, 4), which may mirror it."""
        moved = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
        return cls(moved, faces[:, ::-1] if mirrored else faces, colours)


class Count:
    """Counts triangles while parts are read."""

    def __init__(self) -> None:
        self.triangles = 0

    def add(self, n: int) -> None:
        """Counts ``n`` more.

        Raises:
            ValueError: there are too many.
        """
        self.triangles += n
        if self.triangles > LIMITS.max_triangles:
            raise ValueError(f"it has more than {LIMITS.max_triangles} triangles")
