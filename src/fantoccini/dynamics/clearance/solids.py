"""Conversion of shapes to the solids between which clearances are measured.

All are exact except ellipsoids: against anything but half-spaces they count as the capsule around
them, so that a clearance is never overestimated. A mesh is its bounding box in the axes of its body
and its index in :class:`fantoccini.dynamics.clearance.meshes.Meshes`.

A solid is a shape in the layout of the compiled library, with its link (a body on its joint).
"""

from __future__ import annotations

import numpy as np

from fantoccini.dynamics.clearance.meshes import Meshes
from fantoccini.dynamics.clearance.obstacles import HalfSpace
from fantoccini.kernel.runtime import solids
from fantoccini.model.puppet import Mesh, Obstacle, Shape
from fantoccini.model.tree import WORLD, Tree


def moving(tree: Tree, meshes: Meshes) -> tuple[np.ndarray, list[int]]:
    """Solids of a puppet's bodies, and the link of each.

    Args:
        tree: tree of the puppet.
        meshes: collection to which its meshes are added.

    Returns:
        Records (n,) ``SOLID``, and n links.
    """
    solids_and_links = [
        (solid(s, i, meshes), i) for i, link in enumerate(tree.links) for s in link.shapes
    ]
    return solids.stacked([record for record, _ in solids_and_links]), [
        i for _, i in solids_and_links
    ]


def standing(obstacles: tuple[Obstacle | HalfSpace, ...], meshes: Meshes) -> np.ndarray:
    """Records (n,) ``SOLID`` of obstacles; their meshes are added to ``meshes``."""
    return solids.stacked([solid(o, WORLD, meshes) for o in obstacles])


def separable_pairs(tree: Tree, links: list[int]) -> np.ndarray:
    """Pairs (n, 2) of solids on bodies that no joint connects.

    Args:
        tree: tree of the puppet.
        links: links that carry the solids.
    """
    neighbours = {(i, tree.links[i].parent) for i in range(len(tree.links))}
    pairs = [
        (a, b)
        for a in range(len(links))
        for b in range(a)
        if links[a] != links[b]
        and (links[a], links[b]) not in neighbours
        and (links[b], links[a]) not in neighbours
    ]
    return np.array(pairs, dtype=np.int32).reshape(-1, 2)


def solid(shape: Shape | HalfSpace, link: int, meshes: Meshes) -> np.ndarray:
    """A shape as a ``SOLID``.

    Args:
        shape: shape of a body, or an obstacle.
        link: link that carries it, ``WORLD`` for an obstacle.
        meshes: collection to which it is added if it is a mesh.
    """
    if isinstance(shape, HalfSpace):
        return solids.half_space(shape.at, shape.normal)
    if not isinstance(shape, Mesh):
        return solids.solid(shape, link)
    record = solids.empty(link)
    record["mesh"], centre, half = meshes.add(shape)
    solids.set_box(record, centre, np.eye(3), half)
    return record
