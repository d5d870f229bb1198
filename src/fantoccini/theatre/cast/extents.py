"""Extents of shapes along the axes."""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array
from fantoccini.base.documents import value_of
from fantoccini.model.puppet import (
    Box as BoxShape,
    Capsule,
    Ellipsoid,
    Mesh,
    Shape,
    Sphere,
    load_mesh,
)


def extent(shape: Shape) -> tuple[Array, Array]:
    """Least and largest x, y and z (3,) of a shape [m]."""
    if isinstance(shape, Capsule):
        ends = np.array([shape.from_, shape.to], dtype=float)
        radius = value_of(shape.radius)
        return ends.min(axis=0) - radius, ends.max(axis=0) + radius
    if isinstance(shape, Mesh):
        points = load_mesh(shape).vertices
        return points.min(axis=0), points.max(axis=0)
    assert isinstance(shape, (BoxShape, Sphere, Ellipsoid))
    at = np.array(shape.at, dtype=float)
    if isinstance(shape, Sphere):
        half = np.full(3, value_of(shape.radius))
        return at - half, at + half
    turn = np.eye(3) if shape.orientation is None else shape.orientation.matrix
    if isinstance(shape, BoxShape):
        half = np.abs(turn) @ (0.5 * np.array([value_of(x) for x in shape.size]))
    else:
        half = np.sqrt(np.square(turn) @ np.square([value_of(x) for x in shape.radii]))
    return at - half, at + half
