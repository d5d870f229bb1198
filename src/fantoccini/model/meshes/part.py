"""Part of a mesh file: triangles of one material.

A material gives triangles their colour.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.model.meshes.limits import LIMITS

Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation from y up to z up."""

TEXTURES, TRANSPARENCY = "textures", "transparency"
"""Properties of materials that are ignored: every triangle has one opaque colour."""


def ignored_properties(textures: bool, transparent: bool) -> frozenset[str]:
    """Names of the properties of a material that are ignored."""
    properties = ((TEXTURES, textures), (TRANSPARENCY, transparent))
    return frozenset(name for name, present in properties if present)


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one material.

    Attributes:
        vertices: (n, 3) positions.
        faces: (m, 3) indices of vertices, anticlockwise from outside.
        colours: (m, 3) sRGB of the faces; None without a material.
        lost: ignored properties of the material.
    """

    vertices: Array
    faces: Indices
    colours: Array | None
    lost: frozenset[str] = frozenset()

    @classmethod
    def transformed_by(
        cls,
        matrix: Array,
        vertices: Array,
        faces: Indices,
        colours: Array | None,
        lost: frozenset[str],
    ) -> Part:
        """A part transformed by a matrix (4, 4), which may mirror it."""
        transformed = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        is_mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
        return cls(transformed, faces[:, ::-1] if is_mirrored else faces, colours, lost)


class TriangleCount:
    """Counts triangles while parts are read."""

    def __init__(self) -> None:
        self.triangles = 0

    def add(self, n: int) -> None:
        """Adds ``n`` triangles to the count.

        Raises:
            ValueError: there are more triangles than allowed.
        """
        self.triangles += n
        if self.triangles > LIMITS.max_triangles:
            raise ValueError(f"it has more than {LIMITS.max_triangles} triangles")
