"""Shapes as the solids that clearances are measured between.

All are exact, but that against all else than half-spaces an ellipsoid counts as the capsule about
it, which is larger, so that a clearance is never too great. A mesh is the box about it in the axes
of its body, and a number by which :class:`fantoccini.planning.meshes.Meshes` knows it.
"""

from __future__ import annotations

import numpy as np

from fantoccini.planning.meshes import Meshes
from fantoccini.planning.obstacles import HalfSpace
from fantoccini.puppet import Obstacle, Shape
from fantoccini.runtime import BOX, HALF_SPACE, SEGMENT, SOLID
from fantoccini.tree import WORLD, Tree


def moving(tree: Tree, meshes: Meshes) -> tuple[np.ndarray, list[int]]:
    """The solids of a puppet's bodies, and the link of each.

    Args:
        tree: the puppet's.
        meshes: takes its meshes.

    Returns:
        (n,) ``SOLID``, and n links.
    """
    found = [(solid(s, i, meshes), i) for i, link in enumerate(tree.links) for s in link.shapes]
    return _stacked([made for made, _ in found]), [i for _, i in found]


def standing(obstacles: tuple[Obstacle | HalfSpace, ...], meshes: Meshes) -> np.ndarray:
    """(n,) ``SOLID`` of obstacles; ``meshes`` takes the meshes among them."""
    return _stacked([solid(o, WORLD, meshes) for o in obstacles])


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


def solid(shape: Shape | HalfSpace, link: int, meshes: Meshes) -> np.ndarray:
    """A shape as a ``SOLID``.

    Args:
        shape: of a body, or an obstacle.
        link: that carries it, ``WORLD`` for an obstacle.
        meshes: takes it where it is a mesh.
    """
    made = np.zeros((), dtype=SOLID)
    made["link"], made["mesh"], made["R"] = link, -1, np.eye(3).ravel()
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
            made["mesh"], centre, half = meshes.add(shape)
            _fill(made, centre, np.eye(3), half)
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
