"""Shapes as the solids that compiled code measures and lets touch.

A solid is a shape of a body or an obstacle, in the layout of the compiled library; a link is a body
on its joint. A hull is the smallest convex solid around a mesh or a piece of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fantoccini.kernel.contract import SolidKind
from fantoccini.kernel.runtime.hulls import Hull
from fantoccini.kernel.runtime.structures import dtype_of
from fantoccini.model.puppet import Box, Capsule, Ellipsoid, Shape, Sphere
from fantoccini.model.tree import WORLD

SOLID = dtype_of("Solid")
"""A solid in the frame of a link, or in the world."""


def solid(shape: Shape, link: int) -> np.ndarray:
    """A shape as a ``SOLID``; an ellipsoid lies in the capsule along its longest axis.

    Args:
        shape: shape of a body or obstacle.
        link: link that carries it, ``WORLD`` for an obstacle.

    Raises:
        TypeError: the shape is a mesh.
    """
    record = empty(link)
    match shape:
        case Capsule():
            _set_capsule(record, shape.from_, shape.to, shape.radius)
        case Sphere():
            _set_capsule(record, shape.at, shape.at, shape.radius)
        case Ellipsoid():
            _set_ellipsoid(record, shape)
        case Box():
            set_box(record, shape.at, _rotation(shape), np.asarray(shape.size) / 2)
        case _:
            raise TypeError(f"{type(shape).__name__} is not a shape of compiled code")
    return record


def hull_solid(hull: Hull, number: int, link: int) -> np.ndarray:
    """A convex polytope in the frame of a link, or of the world.

    Args:
        hull: hull of a mesh.
        number: its place in :attr:`fantoccini.kernel.runtime.Contacts.hulls`.
        link: link that carries it, ``WORLD`` for an obstacle.
    """
    record = empty(link)
    record["kind"], record["mesh"] = SolidKind.HULL, number
    record["a"] = record["b"] = hull.centroid
    return record


def half_space(point: ArrayLike, normal: ArrayLike) -> np.ndarray:
    """The half-space below the plane through a point (3,) with an outward normal (3,)."""
    record = empty(WORLD)
    record["kind"], record["a"], record["b"] = SolidKind.HALF_SPACE, point, normal
    return record


def empty(link: int) -> np.ndarray:
    """A ``SOLID`` of a link that is no mesh, without a shape."""
    record = np.zeros((), dtype=SOLID)
    record["link"], record["mesh"], record["R"] = link, -1, np.eye(3).ravel()
    return record


def set_box(record: np.ndarray, centre: ArrayLike, R: np.ndarray, half: ArrayLike) -> None:
    """Makes a ``SOLID`` the box with a centre (3,), axes in the columns of R and half edges."""
    record["kind"], record["a"], record["b"] = SolidKind.BOX, centre, centre
    record["R"], record["half"] = R.T.ravel(), half


def stacked(record: list[np.ndarray]) -> np.ndarray:
    """(n,) solids."""
    return np.array(record, dtype=SOLID) if record else np.zeros(0, dtype=SOLID)


def _rotation(shape: Box | Ellipsoid) -> np.ndarray:
    return np.eye(3) if shape.orientation is None else np.asarray(shape.orientation.matrix)


def _set_capsule(record: np.ndarray, a: ArrayLike, b: ArrayLike, radius: float) -> None:
    record["kind"], record["a"], record["b"], record["radius"] = SolidKind.SEGMENT, a, b, radius


def _set_ellipsoid(record: np.ndarray, shape: Ellipsoid) -> None:
    """The capsule along the longest axis has the middle radius."""
    radii, centre = np.asarray(shape.radii, dtype=float), np.asarray(shape.at, dtype=float)
    longest, radius = int(np.argmax(radii)), float(np.sort(radii)[1])
    half_axis = (radii[longest] - radius) * _rotation(shape)[:, longest]
    _set_capsule(record, centre - half_axis, centre + half_axis, radius)
    record["R"], record["half"] = _rotation(shape).T.ravel(), radii
