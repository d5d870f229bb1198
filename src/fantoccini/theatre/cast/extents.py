"""Extents of shapes along the axes.

The extent of a shape is the range of its coordinates along an axis, as for a bounding box.
"""

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


def bounding_box(shape: Shape) -> tuple[Array, Array]:
    """Least and largest x, y and z (3,) of a shape [m]."""
    if isinstance(shape, Capsule):
        ends = np.array([shape.from_, shape.to], dtype=float)
        radius = value_of(shape.radius)
        return ends.min(axis=0) - radius, ends.max(axis=0) + radius
    if isinstance(shape, Mesh):
        points = load_mesh(shape).vertices
        return points.min(axis=0), points.max(axis=0)
    assert isinstance(shape, (BoxShape, Sphere, Ellipsoid))
    centre = np.array(shape.at, dtype=float)
    if isinstance(shape, Sphere):
        half_sizes = np.full(3, value_of(shape.radius))
        return centre - half_sizes, centre + half_sizes
    rotation = np.eye(3) if shape.orientation is None else shape.orientation.matrix
    if isinstance(shape, BoxShape):
        half_sizes = np.abs(rotation) @ (0.5 * np.array([value_of(x) for x in shape.size]))
    else:
        half_sizes = np.sqrt(np.square(rotation) @ np.square([value_of(x) for x in shape.radii]))
    return centre - half_sizes, centre + half_sizes
