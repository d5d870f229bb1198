"""Solids of a puppet: its shapes, handles, and stand-ins for bodies without a shape.

A handle is a string end that a hand holds; a link is a body on its joint.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fantoccini.model.puppet import Box, Capsule, Ellipsoid, Mesh, Puppet, Shape, Sphere, load_mesh
from fantoccini.model.tree import WORLD, ChainRow, Point, Role, StringRow, Tree
from fantoccini.output.view.silhouettes import (
    Solid,
    box_solid,
    capsule_solid,
    ellipsoid_solid,
    mesh_solid,
)
from fantoccini.output.view.still import file_value
from fantoccini.output.view.theme import STONE_COLOUR, WOOD_COLOURS, Theme, rgb

MAX_FACES = 1500
"""Largest number of triangles of a painted mesh; larger meshes are simplified."""
MAX_FINE_FACES = 60_000
"""Largest number of triangles of a mesh for renderers with a depth buffer."""


def shape_solid(shape: Shape, link: int, colour: np.ndarray) -> Solid:
    """Solid of a shape on a link (-1 for the world); ``colour`` (3,) if the shape has none."""
    if shape.colour is not None:
        colour = rgb(shape.colour)
    if isinstance(shape, Capsule):
        ends = np.array([shape.from_, shape.to], dtype=float)
        return capsule_solid(link, colour, ends, shape.radius)
    if isinstance(shape, Mesh):
        return _mesh_solid(shape, link, colour)
    assert isinstance(shape, Sphere | Ellipsoid | Box)
    centre = np.array(shape.at, dtype=float)
    if isinstance(shape, Sphere):
        return capsule_solid(link, colour, np.tile(centre, (2, 1)), shape.radius)
    rotation = np.eye(3) if shape.orientation is None else shape.orientation.matrix
    if isinstance(shape, Ellipsoid):
        return ellipsoid_solid(link, colour, centre, rotation * np.array(shape.radii, dtype=float))
    return box_solid(link, colour, centre, rotation * (0.5 * np.array(shape.size, dtype=float)))


def link_solids(tree: Tree) -> list[Solid]:
    """Solids of the shapes of all links."""
    solids: list[Solid] = []
    depth = {WORLD: -1}
    for k, link in enumerate(tree.links):
        depth[k] = depth[link.parent] + 1
        colour = rgb(WOOD_COLOURS[depth[k] % len(WOOD_COLOURS)])
        solids += [shape_solid(shape, k, colour) for shape in link.shapes]
    return solids


def obstacle_solids(puppet: Puppet) -> list[Solid]:
    """Solids of the obstacles."""
    return [shape_solid(shape, WORLD, rgb(STONE_COLOUR)) for shape in puppet.obstacles]


def stand_in_solids(tree: Tree, size: float) -> list[Solid]:
    """Balls and sticks for links without shapes that have mass or carry strings.

    Massless frames that are fixed in the world, such as those on which puppets of a scene stand,
    have none.
    """
    solids: list[Solid] = []
    children: dict[int, list[np.ndarray]] = {}
    for link in tree.links:
        children.setdefault(link.parent, []).append(np.array(link.offset))
    for point in _string_points(tree):
        children.setdefault(point.link, []).append(np.array(point.at))
    for k, link in enumerate(tree.links):
        if link.shapes:
            continue
        colour = rgb(WOOD_COLOURS[1 if link.role is Role.DRIVEN else 3])
        mass = 0.0 if link.mass is None else file_value(link.mass)
        if not mass and all(tree.links[i].role is Role.FIXED for i in tree.ancestors(k)):
            continue
        com = np.zeros(3) if link.com is None else np.array(link.com)
        if mass > 0.0:
            solids.append(capsule_solid(k, colour, np.tile(com, (2, 1)), 0.026 * size))
        tips = [com, *children.get(k, [])]
        solids += [
            capsule_solid(k, colour, np.array([np.zeros(3), tip]), 0.011 * size)
            for tip in np.unique(np.round(tips, 9), axis=0)
            if np.linalg.norm(tip) > 1e-6
        ]
    return solids


def handle_solids(tree: Tree, theme: Theme, size: float) -> list[Solid]:
    """Beads on string ends held by a hand or a winch, and hooks on the world; ``size`` [m]."""
    solids: list[Solid] = []
    visited = set()
    for point in _string_points(tree):
        key = (point.link, point.at)
        if key in visited or not _is_held(tree, point.link):
            continue
        visited.add(key)
        if point.link == WORLD or not tree.links[point.link].shapes:
            bead_ends = np.tile(np.array(point.at, dtype=float), (2, 1))
            solids.append(capsule_solid(point.link, theme.handle, bead_ends, 0.009 * size))
    return solids


def _string_points(tree: Tree) -> list[Point]:
    rows: list[StringRow | ChainRow] = [*tree.strings, *tree.chains]
    return [point for row in rows for point in row.points]


def _is_held(tree: Tree, link: int) -> bool:
    """Whether only driven coordinates move a link."""
    return link == WORLD or all(
        tree.links[k].role is not Role.DYNAMIC for k in tree.ancestors(link)
    )


def _mesh_solid(shape: Mesh, link: int, colour: np.ndarray) -> Solid:
    """Solid of a mesh in the shape's colour, else in the file's colours, else in ``colour``."""
    loaded_mesh = load_mesh(shape)
    colours = None if shape.colour is not None else shape.read().colours
    if colours is not None:
        colours = np.where(np.isfinite(colours), colours, colour)

    def simplified(max_faces: int) -> Solid:
        points, corners = np.array(loaded_mesh.vertices), np.array(loaded_mesh.faces)
        vertices, faces, original = simplify_mesh(points, corners, max_faces)
        return mesh_solid(
            link, colour, vertices, faces, None if colours is None else colours[original]
        )

    coarse = simplified(MAX_FACES)
    return (
        replace(coarse, detailed=simplified(MAX_FINE_FACES))
        if len(loaded_mesh.faces) > MAX_FACES
        else coarse
    )


def simplify_mesh(
    vertices: np.ndarray, faces: np.ndarray, max_faces: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The mesh simplified to about ``max_faces`` triangles, by merging vertices on a grid.

    Takes and returns vertices (n, 3) [m] and faces (m, 3), indices of vertices; also returns the
    original index of each face.
    """
    lower_corner, span = vertices.min(axis=0), float(np.ptp(vertices, axis=0).max())
    original = np.arange(len(faces))
    # A closed surface crosses about 6 k^2 cells of a k x k x k grid, two triangles a cell.
    cells = max(4, int(np.sqrt(max_faces / 12.0)) * 2)
    while len(faces) > max_faces and cells >= 4:
        cell = np.floor((vertices - lower_corner) / span * cells).astype(int)
        key = cell @ [(cells + 1) ** 2, cells + 1, 1]
        _, cluster, count = np.unique(key, return_inverse=True, return_counts=True)
        merged = np.zeros((len(count), 3))
        np.add.at(merged, cluster, vertices)
        merged /= count[:, None]
        a, b, c = cluster[faces].T
        proper_faces = np.flatnonzero((a != b) & (b != c) & (c != a))
        distinct, first = np.unique(cluster[faces[proper_faces]], axis=0, return_index=True)
        vertices, faces, original = merged, distinct, original[proper_faces[first]]
        lower_corner, cells = vertices.min(axis=0), cells - 2
    return vertices, faces, original
