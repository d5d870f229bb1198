"""Configurations and the tangent vectors between them: scalars add, unit quaternions turn.

A coordinate has a pair of indices (q, v) in a configuration and in a velocity; for a
rotation, the first of its four and the first of its three.

A tangent vector is a small or large move of a configuration, of the size of a velocity: an
orientation, which has four numbers, moves by a rotation vector, which has three.
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
    shape = np.broadcast_shapes(q.shape[:-1], move.shape[:-1])
    out = np.broadcast_to(q, (*shape, q.shape[-1])).copy()
    for q_start, v in scalars:
        out[..., q_start] += move[..., v]
    for q_start, v in quaternions:
        turned = rotation.multiply(
            out[..., q_start : q_start + 4], rotation.exp(move[..., v : v + 3])
        )
        out[..., q_start : q_start + 4] = turned / np.linalg.norm(turned, axis=-1, keepdims=True)
    return out


def between(scalars: IndexPairs, quaternions: IndexPairs, p: Array, q: Array, n_v: int) -> Array:
    """The tangent vectors (..., n_v) that move p to q; rotations turn the shorter way."""
    shape = np.broadcast_shapes(p.shape[:-1], q.shape[:-1])
    out = np.zeros((*shape, n_v))
    for q_start, v in scalars:
        out[..., v] = q[..., q_start] - p[..., q_start]
    for q_start, v in quaternions:
        out[..., v : v + 3] = rotation.between(
            p[..., q_start : q_start + 4], q[..., q_start : q_start + 4]
        )
    return out
