"""Solids as triangle meshes, for renderers with a depth buffer: the browser's, or pyvista's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fantoccini.base import perpendicular
from fantoccini.output.view.silhouettes import Solid

AROUND = 20
"""Vertices on a capsule's or an ellipsoid's equator."""

_CREASE = np.radians(40.0)
"""Angle between faces of a mesh from which on their edge is sharp [rad]."""

_POLE_TO_RIM = 6
"""Rings of triangles on a half-sphere."""


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A closed surface in its link's frame.

    Attributes:
        vertices: (n, 3) [m].
        faces: (m, 3) indices of vertices, anticlockwise from outside.
        normals: (n, 3) outward unit normals of a smooth surface; None where all edges are sharp.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None


def triangles(solid: Solid) -> TriangleMesh:
    """The surface of a solid as triangles, in its link's frame.

    Vertices lie on the surface: a capsule or an ellipsoid loses less than 4 % of its volume.
    """
    solid = solid.full
    if solid.kind == "capsule":
        return _capsule(solid.points, solid.radius)
    if solid.kind == "ellipsoid":
        return _ellipsoid(solid.points[0], solid.half)
    return _faces(solid)


def coloured(solid: Solid) -> list[tuple[np.ndarray, TriangleMesh]]:
    """The surface of a solid as one mesh for each of its colours (3,)."""
    solid, whole = solid.full, triangles(solid)
    if solid.colours is None:
        return [(solid.colour, whole)]
    colours, which = np.unique(solid.colours, axis=0, return_inverse=True)
    out = []
    for k, colour in enumerate(colours):
        used, faces = np.unique(whole.faces[which.reshape(-1) == k], return_inverse=True)
        normals = None if whole.normals is None else whole.normals[used]
        out.append((colour, TriangleMesh(whole.vertices[used], faces.reshape(-1, 3), normals)))
    return out


def _capsule(ends: np.ndarray, radius: float) -> TriangleMesh:
    """Two half-spheres and the tube between them; one ball where the ends coincide."""
    apart = ends[1] - ends[0]
    length = float(np.linalg.norm(apart))
    frame = frame_along(apart / length) if length > 1e-9 * radius else np.eye(3)
    directions, faces = _ball(rims=2 if length > 1e-9 * radius else 1)
    normals = directions @ frame.T
    # The first half of the vertices belongs to the far end.
    upper = np.arange(len(directions)) < len(directions) // 2
    centres = np.where(upper[:, None], ends[1], ends[0])
    return TriangleMesh(centres + radius * normals, faces, normals)


def _ellipsoid(centre: np.ndarray, half: np.ndarray) -> TriangleMesh:
    """The unit ball under x = centre + H u; normals go with H^-T."""
    directions, faces = _ball(rims=1)
    if np.linalg.det(half) < 0.0:
        faces = faces[:, ::-1]
    normals = directions @ np.linalg.inv(half)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return TriangleMesh(centre + directions @ half.T, faces, normals)


def _faces(solid: Solid) -> TriangleMesh:
    """Fans of triangles; each face of a box gets its own vertices, for sharp edges, as do parts of
    a mesh between which it has a crease."""
    if solid.smooth:
        return _creased(np.array(solid.points, dtype=float), np.array(solid.faces, dtype=int))
    faces: list[tuple[int, int, int]] = []
    first = 0
    for face in solid.faces:
        faces += [(first, first + k, first + k + 1) for k in range(1, len(face) - 1)]
        first += len(face)
    vertices = solid.points[np.concatenate(solid.faces)]
    return TriangleMesh(vertices, np.array(faces, dtype=int), None)


def _creased(points: np.ndarray, faces: np.ndarray) -> TriangleMesh:
    """A mesh whose vertices are split where faces meet at more than ``_CREASE``."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    flat = _unit(across)
    sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    order = np.lexsort(sides.T)
    same = np.all(sides[order[1:]] == sides[order[:-1]], axis=1)
    one, other = order[:-1][same] // 3, order[1:][same] // 3
    even = np.sum(flat[one] * flat[other], axis=1) > np.cos(_CREASE)
    n = len(faces)
    links = coo_array((np.ones(int(even.sum())), (one[even], other[even])), shape=(n, n))
    _, part = connected_components(links, directed=False)
    corners = np.stack([faces.ravel(), np.repeat(part, 3)], axis=1)
    split, renamed = np.unique(corners, axis=0, return_inverse=True)
    renamed = renamed.reshape(-1, 3)
    normals = np.zeros((len(split), 3))
    for k in range(3):
        np.add.at(normals, renamed[:, k], across)
    return TriangleMesh(points[split[:, 0]], renamed, _unit(normals))


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors (n, 3) of length 1; z where they have none."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(lengths > 0.0, vectors / np.where(lengths > 0.0, lengths, 1.0), [0.0, 0.0, 1.0])


def _ball(rims: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and triangles (m, 3) of the unit ball, from +z to -z.

    With two ``rims`` of vertices at the equator the halves can be pulled apart.
    """
    polar = np.linspace(0.0, 0.5 * np.pi, _POLE_TO_RIM + 1)[1:]
    polar = np.concatenate([polar, (np.pi - polar)[::-1][0 if rims == 2 else 1 :]])
    angles = np.arange(AROUND) * (2.0 * np.pi / AROUND)
    rings = np.stack(
        [
            np.sin(polar)[:, None] * np.cos(angles),
            np.sin(polar)[:, None] * np.sin(angles),
            np.tile(np.cos(polar)[:, None], AROUND),
        ],
        axis=-1,
    )
    corners = np.concatenate([[[0.0, 0.0, 1.0]], rings.reshape(-1, 3), [[0.0, 0.0, -1.0]]])

    here = np.arange(AROUND)
    following = (here + 1) % AROUND
    ring = 1 + AROUND * np.arange(len(polar))[:, None]
    above, below = ring[:-1], ring[1:]
    bands = [
        np.stack(np.broadcast_arrays(above + here, below + here, below + following), axis=-1),
        np.stack(np.broadcast_arrays(above + here, below + following, above + following), axis=-1),
    ]
    last = len(corners) - 1
    top = np.stack(np.broadcast_arrays(0, 1 + here, 1 + following), axis=-1)
    bottom = np.stack(np.broadcast_arrays(last, ring[-1] + following, ring[-1] + here), axis=-1)
    return corners, np.concatenate([top, *(b.reshape(-1, 3) for b in bands), bottom])


def frame_along(axis: np.ndarray) -> np.ndarray:
    """A rotation (3, 3) whose third column is a unit vector."""
    first = perpendicular(axis)
    return np.column_stack([first, np.cross(axis, first), axis])
