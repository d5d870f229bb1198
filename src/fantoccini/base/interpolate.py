"""Motion between samples: quintics from position, velocity and acceleration at both ends.

A quaternion goes through the tangent space of the left sample's rotation: R = R_left exp([phi]x),
with phi the quintic whose ends have the two samples' angular velocities and accelerations.

A quintic is a polynomial of degree 5, and phi a rotation vector: axis times angle.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from fantoccini.base import polynomial, rotation
from fantoccini.base.arrays import Array, Indices, Times

IndexPairs = tuple[tuple[int, int], ...]


def bracket(
    t: Times, times: Times, side: Literal["right", "left"]
) -> tuple[Indices, Indices, Array]:
    """The samples around given times.

    Args:
        t: (T,) times of the samples [s], not decreasing; equal neighbours are an impact.
        times: (m,) times [s], inside the range of ``t``.
        side: sample of an impact that is used at its time.

    Returns:
        left (m,) and right (m,) samples, and the position s in [0, 1] (m,) between them.
    """
    left = np.searchsorted(t, times, side=side) - 1
    left = np.clip(left, 0, len(t) - 1)
    right = np.minimum(left + 1, len(t) - 1)
    h = t[right] - t[left]
    return left, right, np.where(h > 0, (times - t[left]) / np.where(h > 0, h, 1.0), 0.0)


def linear(values: Array, left: Indices, right: Indices, s: Array) -> Array:
    """(m, n) values at positions ``s`` between samples; exact at s = 0 and 1."""
    s = s[:, None]
    return np.where(s < 1, values[left] + s * (values[right] - values[left]), values[right])


def motion(
    t: Times,
    samples: tuple[Array, Array, Array],
    scalars: IndexPairs,
    quaternions: IndexPairs,
    left: Indices,
    right: Indices,
    s: Array,
) -> tuple[Array, Array, Array]:
    """Configuration, velocity and acceleration between samples.

    Args:
        t: (T,) times of the samples [s].
        samples: q (T, n_q), v (T, n_v), acc (T, n_v).
        scalars, quaternions: (q, v) indices, as in the coordinate table.
        left, right, s: results of :func:`bracket`.

    Returns:
        q (m, n_q), v (m, n_v), acc (m, n_v); sixth order in the distance of the samples for q.
    """
    q, v, acc = (np.array(x[np.where(s < 1, left, right)]) for x in samples)
    h = t[right] - t[left]
    is_between = (s > 0) & (s < 1)
    if not np.any(is_between):
        return q, v, acc
    left_inner, right_inner, h = left[is_between], right[is_between], h[is_between][:, None]
    time = (s[is_between] * h[:, 0])[:, None]
    q_all, v_all, acc_all = samples
    if scalars:
        q_columns, v_columns = np.array(scalars).T
        start, end = (
            (
                q_all[np.ix_(k, q_columns)],
                v_all[np.ix_(k, v_columns)],
                acc_all[np.ix_(k, v_columns)],
            )
            for k in (left_inner, right_inner)
        )
        q_block, v_block = (
            np.ix_(np.nonzero(is_between)[0], columns) for columns in (q_columns, v_columns)
        )
        q[q_block], v[v_block], acc[v_block] = polynomial.evaluate(
            polynomial.hermite(h, start, end), time
        )
    for q_start, v_start in quaternions:
        q_slice, v_slice = slice(q_start, q_start + 4), slice(v_start, v_start + 3)
        rotation_vector = rotation.between(q_all[left_inner, q_slice], q_all[right_inner, q_slice])
        rate, rate_derivative = rotation.tangent_motion(
            rotation_vector, v_all[right_inner, v_slice], acc_all[right_inner, v_slice]
        )
        coef = polynomial.hermite(
            h,
            (
                np.zeros_like(rotation_vector),
                v_all[left_inner, v_slice],
                acc_all[left_inner, v_slice],
            ),
            (rotation_vector, rate, rate_derivative),
        )
        phi, first, second = polynomial.evaluate(coef, time)
        q[is_between, q_slice] = rotation.multiply(q_all[left_inner, q_slice], rotation.exp(phi))
        v[is_between, v_slice], acc[is_between, v_slice] = rotation.body_motion(phi, first, second)
    return q, v, acc
