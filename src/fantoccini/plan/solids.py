"""Shapes as the solids that clearances are measured between.

Capsules, spheres, boxes and half-spaces are exact, and ellipsoids against half-spaces. Against all
else an ellipsoid counts as the capsule about it, a mesh always as the box about it in its own axes:
both are larger, so that a clearance is never too great.
"""

from __future__ import annotations

import numpy as np

from fantoccini.plan.obstacles import HalfSpace
from fantoccini.puppet import Obstacle, Shape
from fantoccini.puppet.shapes import load_mesh
from fantoccini.runtime import BOX, HALF_SPACE, SEGMENT, SOLID
from fantoccini.tree import WORLD, Tree


def moving(tree: Tree) -> tuple[np.ndarray, list[int]]:
    """The solids of a puppet's bodies, and the link of each.

    Args:
        tree: the puppet's.

    Returns:
        (n,) ``SOLID``, and n links.
    """
    found = [(solid(s, i), i) for i, link in enumerate(tree.links) for s in link.shapes]
    return _stacked([made for made, _ in found]), [i for _, i in found]


def standing(obstacles: tuple[Obstacle | HalfSpace, ...]) -> np.ndarray:
    """(n,) ``SOLID`` of obstacles."""
    return _stacked([solid(o, WORLD) for o in obstacles])


def apart(tree: Tree, links: list[int]) -> np.ndarray:
    """(n, 2) pairs of solids on bodies that no joint connects.

    Args:
        tree: the puppet's.
        links: of the solids.
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


def solid(shape: Shape | HalfSpace, link: int) -> np.ndarray:
    """A shape as a ``SOLID``.

    Args:
        shape: of a body, or an obstacle.
        link: that carries it, ``WORLD`` for an obstacle.
    """
    made = np.zeros((), dtype=SOLID)
    made["link"], made["R"] = link, np.eye(3).ravel()
    match shape.type:
        case "half_space":
            made["kind"], made["a"], made["b"] = HALF_SPACE, shape.at, shape.normal
        case "capsule":
            _swell(made, shape.from_, shape.to, shape.radius)
        case "sphere":
            _swell(made, shape.at, shape.at, shape.radius)
        case "ellipsoid":
            _enclose(made, shape)
        case "box":
            _fill(made, shape.at, _turn(shape), np.asarray(shape.size) / 2)
        case "mesh":
            corners = load_mesh(shape).vertices
            low, high = corners.min(axis=0), corners.max(axis=0)
            _fill(made, (low + high) / 2, np.eye(3), (high - low) / 2)
    return made


def _turn(shape: Shape) -> np.ndarray:
    return np.eye(3) if shape.orientation is None else np.asarray(shape.orientation.matrix)


def _swell(made: np.ndarray, a, b, radius: float) -> None:
    made["kind"], made["a"], made["b"], made["radius"] = SEGMENT, a, b, radius


def _fill(made: np.ndarray, centre, R: np.ndarray, half) -> None:
    made["kind"], made["a"], made["b"] = BOX, centre, centre
    made["R"], made["half"] = R.T.ravel(), half


def _enclose(made: np.ndarray, shape) -> None:
    """The capsule along the longest axis whose radius is the middle one."""
    radii, centre = np.asarray(shape.radii, dtype=float), np.asarray(shape.at, dtype=float)
    longest, radius = int(np.argmax(radii)), float(np.sort(radii)[1])
    along = (radii[longest] - radius) * _turn(shape)[:, longest]
    _swell(made, centre - along, centre + along, radius)
    made["R"], made["half"] = _turn(shape).T.ravel(), radii


def _stacked(made: list[np.ndarray]) -> np.ndarray:
    return np.array(made, dtype=SOLID) if made else np.zeros(0, dtype=SOLID)
