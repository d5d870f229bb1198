"""Vectors in space, vectorised over leading axes."""

from __future__ import annotations

import numpy as np

from fantoccini.base.arrays import Array, Vec3

_NEXT_AXIS, _PREVIOUS_AXIS = [1, 2, 0], [2, 0, 1]
"""Axes after and before x, y and z."""


def cross(a: Vec3, b: Vec3) -> Vec3:
    """a x b (..., 3); ten times as fast as NumPy's for a few vectors."""
    product: Vec3 = (
        a[..., _NEXT_AXIS] * b[..., _PREVIOUS_AXIS] - a[..., _PREVIOUS_AXIS] * b[..., _NEXT_AXIS]
    )
    return product


def unit(x: Array) -> Array:
    """x / |x| along the last axis; 0 stays 0."""
    size = np.linalg.norm(x, axis=-1, keepdims=True)
    return np.asarray(x / np.where(size > 0.0, size, 1.0))


def perpendicular(x: Vec3) -> Vec3:
    """(..., 3) unit vectors x cross e / |x cross e|, with e the axis of the smallest |x_i|."""
    return unit(cross(x, np.eye(3)[np.argmin(np.abs(x), axis=-1)]))
