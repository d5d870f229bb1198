"""Solids as triangle meshes, for renderers with a depth buffer: the browser and pyvista.

A crease is an edge at which faces meet at a large angle, and a link a body on its joint.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fantoccini.base import perpendicular
from fantoccini.output.view.silhouettes import Solid

EQUATOR_VERTICES = 20
"""Number of vertices on the equator of a capsule or an ellipsoid."""

_CREASE = np.radians(40.0)
"""Angle between faces of a mesh above which their edge is sharp [rad]."""

_RINGS_PER_HALF = 6
"""Number of rings of triangles on a hemisphere."""


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Closed surface in its link's frame.

    Attributes:
        vertices: (n, 3) positions [m].
        faces: (m, 3) indices of vertices, anticlockwise seen from outside.
        normals: (n, 3) outward unit normals of a smooth surface; None if all edges are sharp.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None


def triangulate(solid: Solid) -> TriangleMesh:
    """Surface of a solid as triangles, in its link's frame.

    Vertices lie on the surface: a capsule or an ellipsoid loses less than 4 % of its volume.
    """
    solid = solid.most_detailed
    if solid.kind == "capsule":
        return _capsule(solid.points, solid.radius)
    if solid.kind == "ellipsoid":
        return _ellipsoid(solid.points[0], solid.half_axes)
    return _faces(solid)


def coloured_surfaces(solid: Solid) -> list[tuple[np.ndarray, TriangleMesh]]:
    """Surface of a solid as a mesh for each of its colours (3,)."""
    solid, surface = solid.most_detailed, triangulate(solid)
    if solid.colours is None:
        return [(solid.colour, surface)]
    colours, colour_index = np.unique(solid.colours, axis=0, return_inverse=True)
    meshes = []
    for k, colour in enumerate(colours):
        vertex_indices, faces = np.unique(
            surface.faces[colour_index.reshape(-1) == k], return_inverse=True
        )
        normals = None if surface.normals is None else surface.normals[vertex_indices]
        meshes.append(
            (colour, TriangleMesh(surface.vertices[vertex_indices], faces.reshape(-1, 3), normals))
        )
    return meshes


def _capsule(ends: np.ndarray, radius: float) -> TriangleMesh:
    """Two half-spheres and the tube between them; a ball if the ends coincide."""
    axis = ends[1] - ends[0]
    length = float(np.linalg.norm(axis))
    frame = frame_along(axis / length) if length > 1e-9 * radius else np.eye(3)
    directions, faces = _unit_ball(rims=2 if length > 1e-9 * radius else 1)
    normals = directions @ frame.T
    # The first half of the vertices belongs to the far end.
    upper = np.arange(len(directions)) < len(directions) // 2
    centres = np.where(upper[:, None], ends[1], ends[0])
    return TriangleMesh(centres + radius * normals, faces, normals)


def _ellipsoid(centre: np.ndarray, half: np.ndarray) -> TriangleMesh:
    """The unit ball mapped by x = centre + H u; normals are mapped by H^-T."""
    directions, faces = _unit_ball(rims=1)
    if np.linalg.det(half) < 0.0:
        faces = faces[:, ::-1]
    normals = directions @ np.linalg.inv(half)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return TriangleMesh(centre + directions @ half.T, faces, normals)


def _faces(solid: Solid) -> TriangleMesh:
    """Triangles of faces. Each face of a box has its own vertices, for sharp edges, and so have the
    parts of a mesh on both sides of a crease."""
    if solid.smooth:
        return _split_at_creases(
            np.array(solid.points, dtype=float), np.array(solid.faces, dtype=int)
        )
    faces: list[tuple[int, int, int]] = []
    first = 0
    for face in solid.faces:
        faces += [(first, first + k, first + k + 1) for k in range(1, len(face) - 1)]
        first += len(face)
    vertices = solid.points[np.concatenate(solid.faces)]
    return TriangleMesh(vertices, np.array(faces, dtype=int), None)


def _split_at_creases(points: np.ndarray, faces: np.ndarray) -> TriangleMesh:
    """Mesh whose vertices are split where faces meet at more than ``_CREASE``."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    face_normals = np.cross(b - a, c - a)
    unit_normals = _normalised(face_normals)
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    order = np.lexsort(edges.T)
    is_shared = np.all(edges[order[1:]] == edges[order[:-1]], axis=1)
    first_face, second_face = order[:-1][is_shared] // 3, order[1:][is_shared] // 3
    smooth = np.sum(unit_normals[first_face] * unit_normals[second_face], axis=1) > np.cos(_CREASE)
    n = len(faces)
    links = coo_array(
        (np.ones(int(smooth.sum())), (first_face[smooth], second_face[smooth])), shape=(n, n)
    )
    _, component = connected_components(links, directed=False)
    corners = np.stack([faces.ravel(), np.repeat(component, 3)], axis=1)
    split, new_index = np.unique(corners, axis=0, return_inverse=True)
    new_index = new_index.reshape(-1, 3)
    normals = np.zeros((len(split), 3))
    for k in range(3):
        np.add.at(normals, new_index[:, k], face_normals)
    return TriangleMesh(points[split[:, 0]], new_index, _normalised(normals))


def _normalised(vectors: np.ndarray) -> np.ndarray:
    """Vectors (n, 3), normalised; z in place of zero vectors."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(lengths > 0.0, vectors / np.where(lengths > 0.0, lengths, 1.0), [0.0, 0.0, 1.0])


def _unit_ball(rims: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and triangles (m, 3) of the unit ball, from +z to -z.

    With two ``rims`` of vertices at the equator, the halves can be pulled apart.
    """
    polar = np.linspace(0.0, 0.5 * np.pi, _RINGS_PER_HALF + 1)[1:]
    polar = np.concatenate([polar, (np.pi - polar)[::-1][0 if rims == 2 else 1 :]])
    angles = np.arange(EQUATOR_VERTICES) * (2.0 * np.pi / EQUATOR_VERTICES)
    rings = np.stack(
        [
            np.sin(polar)[:, None] * np.cos(angles),
            np.sin(polar)[:, None] * np.sin(angles),
            np.tile(np.cos(polar)[:, None], EQUATOR_VERTICES),
        ],
        axis=-1,
    )
    corners = np.concatenate([[[0.0, 0.0, 1.0]], rings.reshape(-1, 3), [[0.0, 0.0, -1.0]]])

    column = np.arange(EQUATOR_VERTICES)
    next_column = (column + 1) % EQUATOR_VERTICES
    ring = 1 + EQUATOR_VERTICES * np.arange(len(polar))[:, None]
    above, below = ring[:-1], ring[1:]
    bands = [
        np.stack(np.broadcast_arrays(above + column, below + column, below + next_column), axis=-1),
        np.stack(
            np.broadcast_arrays(above + column, below + next_column, above + next_column), axis=-1
        ),
    ]
    last = len(corners) - 1
    top = np.stack(np.broadcast_arrays(0, 1 + column, 1 + next_column), axis=-1)
    bottom = np.stack(np.broadcast_arrays(last, ring[-1] + next_column, ring[-1] + column), axis=-1)
    return corners, np.concatenate([top, *(b.reshape(-1, 3) for b in bands), bottom])


def frame_along(axis: np.ndarray) -> np.ndarray:
    """Rotation matrix (3, 3) whose third column is the given unit vector."""
    first = perpendicular(axis)
    return np.column_stack([first, np.cross(axis, first), axis])
