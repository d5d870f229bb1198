"""Part of a mesh file: triangles of one material."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.model.meshes.limits import LIMITS

Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Turns a y that is up into a z that is up, about x."""

TEXTURES, TRANSPARENCY = "textures", "transparency"
"""Of a material; triangles have one opaque colour each."""


def lost(textures: bool, transparent: bool) -> frozenset[str]:
    """What colours of triangles do not have of a material."""
    found = ((TEXTURES, textures), (TRANSPARENCY, transparent))
    return frozenset(what for what, there in found if there)


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles.

    Attributes:
        vertices: (n, 3).
        faces: (m, 3) indices of vertices, anticlockwise from outside.
        colours: (m, 3) sRGB of the faces; None where they have no material.
        lost: what their looks have besides, of :data:`TEXTURES` and :data:`TRANSPARENCY`.
    """

    vertices: Array
    faces: Indices
    colours: Array | None
    lost: frozenset[str] = frozenset()

    @classmethod
    def placed(
        cls,
        matrix: Array,
        vertices: Array,
        faces: Indices,
        colours: Array | None,
        lost: frozenset[str],
    ) -> Part:
        """A part moved by a matrix (4, 4), which may mirror it."""
        moved = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
        return cls(moved, faces[:, ::-1] if mirrored else faces, colours, lost)


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
