"""Shapes as the solids between which clearances are measured.

All are exact except ellipsoids: against anything but half-spaces they count as the capsule around
them, so that a clearance is never overestimated. A mesh is its bounding box in the axes of its body
and its number in :class:`fantoccini.planning.meshes.Meshes`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fantoccini.planning.meshes import Meshes
from fantoccini.planning.obstacles import HalfSpace
from fantoccini.puppet import Obstacle, Shape
from fantoccini.puppet.shapes import Box, Capsule, Ellipsoid, Mesh, Sphere
from fantoccini.runtime import BOX, HALF_SPACE, SEGMENT, SOLID
from fantoccini.tree import WORLD, Tree


def moving(tree: Tree, meshes: Meshes) -> tuple[np.ndarray, list[int]]:
    """The solids of a puppet's bodies, and the link of each.

    Args:
        tree: of the puppet.
        meshes: to which its meshes are added.

    Returns:
        (n,) ``SOLID``, and n links.
    """
    found = [(solid(s, i, meshes), i) for i, link in enumerate(tree.links) for s in link.shapes]
    return _stacked([made for made, _ in found]), [i for _, i in found]


def standing(obstacles: tuple[Obstacle | HalfSpace, ...], meshes: Meshes) -> np.ndarray:
    """(n,) ``SOLID`` of obstacles; their meshes are added to ``meshes``."""
    return _stacked([solid(o, WORLD, meshes) for o in obstacles])


def apart(tree: Tree, links: list[int]) -> np.ndarray:
    """(n, 2) pairs of solids on bodies that no joint connects.

    Args:
        tree: of the puppet.
        links: that carry the solids.
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
        shape: of a body, or an obstacle.
        link: that carries it, ``WORLD`` for an obstacle.
        meshes: to which it is added if it is a mesh.
    """
    made = np.zeros((), dtype=SOLID)
    made["link"], made["mesh"], made["R"] = link, -1, np.eye(3).ravel()
    match shape:
        case HalfSpace():
            made["kind"], made["a"], made["b"] = HALF_SPACE, shape.at, shape.normal
        case Capsule():
            _set_capsule(made, shape.from_, shape.to, shape.radius)
        case Sphere():
            _set_capsule(made, shape.at, shape.at, shape.radius)
        case Ellipsoid():
            _enclose(made, shape)
        case Box():
            _set_box(made, shape.at, _rotation(shape), np.asarray(shape.size) / 2)
        case Mesh():
            made["mesh"], centre, half = meshes.add(shape)
            _set_box(made, centre, np.eye(3), half)
    return made


def _rotation(shape: Box | Ellipsoid) -> np.ndarray:
    return np.eye(3) if shape.orientation is None else np.asarray(shape.orientation.matrix)


def _set_capsule(made: np.ndarray, a: ArrayLike, b: ArrayLike, radius: float) -> None:
    made["kind"], made["a"], made["b"], made["radius"] = SEGMENT, a, b, radius


def _set_box(made: np.ndarray, centre: ArrayLike, R: np.ndarray, half: ArrayLike) -> None:
    made["kind"], made["a"], made["b"] = BOX, centre, centre
    made["R"], made["half"] = R.T.ravel(), half


def _enclose(made: np.ndarray, shape: Ellipsoid) -> None:
    """Sets the capsule along the longest axis with the middle radius."""
    radii, centre = np.asarray(shape.radii, dtype=float), np.asarray(shape.at, dtype=float)
    longest, radius = int(np.argmax(radii)), float(np.sort(radii)[1])
    along = (radii[longest] - radius) * _rotation(shape)[:, longest]
    _set_capsule(made, centre - along, centre + along, radius)
    made["R"], made["half"] = _rotation(shape).T.ravel(), radii


def _stacked(made: list[np.ndarray]) -> np.ndarray:
    return np.array(made, dtype=SOLID) if made else np.zeros(0, dtype=SOLID)
