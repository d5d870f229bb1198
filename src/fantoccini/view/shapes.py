"""Shapes of a puppet file as solids."""

from __future__ import annotations

import numpy as np

from fantoccini.puppet import Shape
from fantoccini.puppet.shapes import load_mesh
from fantoccini.view.silhouettes import Solid, box, capsule, ellipsoid, mesh
from fantoccini.view.theme import rgb

_MOST_FACES = 1500
"""A mesh with more triangles is drawn coarser."""


def solid_of(shape: Shape, link: int, colour: np.ndarray) -> Solid:
    """The solid of a shape.

    Args:
        shape: from the puppet's file.
        link: index of the link that carries it, -1 for the world.
        colour: (3,) to use when the shape has none.
    """
    if shape.colour is not None:
        colour = rgb(shape.colour)
    if shape.type == "capsule":
        return capsule(link, colour, np.array([shape.from_, shape.to], dtype=float), shape.radius)
    if shape.type == "mesh":
        triangles = load_mesh(shape)
        return mesh(link, colour, *coarser(triangles.vertices, triangles.faces, _MOST_FACES))
    centre = np.array(shape.at, dtype=float)
    if shape.type == "sphere":
        return capsule(link, colour, np.tile(centre, (2, 1)), shape.radius)
    turn = np.eye(3) if shape.orientation is None else shape.orientation.matrix
    if shape.type == "ellipsoid":
        return ellipsoid(link, colour, centre, turn * np.array(shape.radii, dtype=float))
    return box(link, colour, centre, turn * (0.5 * np.array(shape.size, dtype=float)))


def coarser(vertices: np.ndarray, faces: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """A mesh with at most about ``most`` triangles, by merging vertices on a grid.

    Args:
        vertices: (n, 3) [m].
        faces: (m, 3) indices of vertices.
        most: triangles to aim for.
    """
    low, span = vertices.min(axis=0), float(np.ptp(vertices, axis=0).max())
    # A closed surface crosses about 6 k^2 cells of a k x k x k grid, two triangles a cell.
    cells = max(4, int(np.sqrt(most / 12.0)) * 2)
    while len(faces) > most and cells >= 4:
        key = np.floor((vertices - low) / span * cells).astype(int)
        _, place, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
        place = place.reshape(-1)
        merged = np.zeros((len(count), 3))
        np.add.at(merged, place, vertices)
        merged /= count[:, None]
        kept = np.unique(place[faces], axis=0)
        a, b, c = kept.T
        vertices, faces = merged, kept[(a != b) & (b != c) & (c != a)]
        low, cells = vertices.min(axis=0), cells - 2
    return vertices, faces
