"""Configurations and the tangent vectors between them: scalars add, unit quaternions turn.

A coordinate has a pair of indices (q, v) in a configuration and in a velocity; for a
rotation, the first of its four and the first of its three.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fantoccini.base import rotation
from fantoccini.base.arrays import Array

IndexPairs = Iterable[tuple[int, int]]


def moved(scalars: IndexPairs, quaternions: IndexPairs, q: Array, move: Array) -> Array:
    """q moved by tangent vectors.

    Args:
        scalars, quaternions: index pairs of the coordinates.
        q: (..., n_q).
        move: (..., n_v); leading axes broadcast.

    Returns:
        (..., n_q).
    """
    lead = np.broadcast_shapes(q.shape[:-1], move.shape[:-1])
    out = np.broadcast_to(q, (*lead, q.shape[-1])).copy()
    for at, v in scalars:
        out[..., at] += move[..., v]
    for at, v in quaternions:
        turned = rotation.multiply(out[..., at : at + 4], rotation.exp(move[..., v : v + 3]))
        out[..., at : at + 4] = turned / np.linalg.norm(turned, axis=-1, keepdims=True)
    return out


def between(scalars: IndexPairs, quaternions: IndexPairs, p: Array, q: Array, n_v: int) -> Array:
    """The tangent vectors (..., n_v) that move p to q; rotations turn the shorter way."""
    lead = np.broadcast_shapes(p.shape[:-1], q.shape[:-1])
    out = np.zeros((*lead, n_v))
    for at, v in scalars:
        out[..., v] = q[..., at] - p[..., at]
    for at, v in quaternions:
        out[..., v : v + 3] = rotation.between(p[..., at : at + 4], q[..., at : at + 4])
    return out
