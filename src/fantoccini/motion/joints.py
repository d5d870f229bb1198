"""Joints of inputs in time: where an input begins at a state, follows another or ends at rest.

The piece of the input next to the joint is changed to remove a small difference of position or
velocity, so that the motion is C^1; a larger difference is an error. :class:`Tolerances` applies to
all joints; a length is compared with lengths, and an angle with angles. At a joint, rotations may
differ in angular velocity, but not in orientation. q_K are the driven coordinates, n_vK is the
number of their velocities, and `coef` are the coefficients of n inputs between their `breaks`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.base import Array, Mask, polynomial, rotation

if TYPE_CHECKING:
    from fantoccini.model.tree import CoordinateTable


@dataclass(frozen=True)
class Tolerances:
    """Largest differences at a joint: the larger of the absolute and the relative bound."""

    speed: float = 1e-7
    """Velocity difference in any motion [m/s or rad/s]."""
    relative_speed: float = 1e-3
    """Velocity difference, relative to the largest speed in the inputs, as files round numbers."""
    position: float = 1e-9
    """Position difference, relative to 1 m or rad, or to the value if that is larger."""
    relative_position: float = 1e-6
    """Position difference, relative to the longest move in the inputs."""
    rounded_speed: float = 1e-9
    """Largest velocity difference that is ignored as rounding [m/s or rad/s]."""
    rounded_position: float = 1e-12
    """Largest position difference that is ignored as rounding [m or rad]."""
    min_duration: float = 1e-4
    """Shortest piece that is changed [s]; a shorter one would accelerate too much."""
    speed_samples: int = 5
    """Number of points of each piece at which its speed and reach are measured."""


TOLERANCES = Tolerances()


def tolerances(table: CoordinateTable, breaks: Array, coef: Array) -> tuple[Array, Array]:
    """Largest differences of positions and velocities at a joint of inputs.

    Args:
        table: names and indices of the coordinates.
        breaks: (n or 1, n_seg + 1) breaks [s].
        coef: (n, n_seg, n_vK, 6) coefficients.

    Returns:
        Largest changes of positions, from their start values, and of velocities, (n, n_vK).
    """
    s = np.diff(breaks)[..., None, None] * np.linspace(0.0, 1.0, TOLERANCES.speed_samples)
    # Coefficients of lengths without a value are NaN.
    q, v, _ = polynomial.evaluate(np.nan_to_num(coef)[..., None, :], s)
    speed = np.max(np.abs(v), axis=(1, 3), initial=0.0)
    reach = np.max(q, axis=(1, 3)) - np.min(q, axis=(1, 3))
    size = np.maximum(1.0, np.abs(q[:, 0, :, 0]))
    for _, v_start in table.quaternions_K:
        v_slice = slice(v_start, v_start + 3)
        speed[:, v_slice] = np.max(np.linalg.norm(v[:, :, v_slice], axis=2), axis=(1, 2))[:, None]
        reach[:, v_slice], size[:, v_slice] = 0.0, 1.0
    units = {row.name: row.unit for row in table.rows}
    is_length = np.zeros(table.n_vK, dtype=bool)
    for q_start, v_start in table.scalars_K:
        is_length[v_start] = units[table.q_K[q_start]] == "m"
    for same_unit in (is_length, ~is_length):
        for scale in (speed, reach):
            scale[:, same_unit] = np.max(scale[:, same_unit], axis=1, initial=0.0)[:, None]
    tol = TOLERANCES
    position = np.maximum(tol.relative_position * reach, tol.position * size)
    return position, np.maximum(tol.relative_speed * speed, tol.speed)


def with_start(
    table: CoordinateTable, coef: Array, s: Array, h: Array, move: Array, v: Array
) -> Array:
    """Pieces with a new start position and velocity, and the same end.

    Args:
        table: names and indices of the coordinates.
        coef: (n, n_vK, 6) coefficients of the pieces.
        s: (n,) time of the new start, since the piece began [s].
        h: (n,) duration of the piece [s].
        move: (n, n_vK) change of the start position, 0 for rotations [m or rad].
        v: (n, n_vK) start velocity [m/s or rad/s].

    Returns:
        (n, n_vK, 6) coefficients.
    """
    remaining, zero = h - s, np.zeros_like(v)
    dv = _rate_differences(table, coef, s, v)
    is_changed = _exceeds_rounding(move, dv) & (remaining > TOLERANCES.min_duration)[:, None]
    move, dv = np.where(is_changed, move, 0.0), np.where(is_changed, dv, 0.0)
    remaining = np.where(remaining > TOLERANCES.min_duration, remaining, 1.0)[:, None]
    correction = polynomial.hermite(remaining, (move, dv, zero), (zero, zero, zero))
    return coef + polynomial.shifted(correction, -s)


def with_end(table: CoordinateTable, coef: Array, h: Array, move: Array, v: Array) -> Array:
    """Pieces with a new end position and velocity; arguments as in :func:`with_start`."""
    zero = np.zeros_like(v)
    dv = _rate_differences(table, coef, h, v)
    is_changed = _exceeds_rounding(move, dv) & (h > TOLERANCES.min_duration)[:, None]
    move, dv = np.where(is_changed, move, 0.0), np.where(is_changed, dv, 0.0)
    h = np.where(h > TOLERANCES.min_duration, h, 1.0)[:, None]
    return coef + polynomial.hermite(h, (zero, zero, zero), (move, dv, zero))


def _exceeds_rounding(move: Array, dv: Array) -> Mask:
    return (np.abs(move) > TOLERANCES.rounded_position) | (np.abs(dv) > TOLERANCES.rounded_speed)


def _rate_differences(table: CoordinateTable, coef: Array, s: Array, v: Array) -> Array:
    """Velocities v (n, n_vK) minus the polynomials' rates at times s (n,)."""
    p, rate, _ = polynomial.evaluate(coef, s[:, None])
    target = np.array(v)
    for _, v_start in table.quaternions_K:
        v_slice = slice(v_start, v_start + 3)
        inverse = rotation.right_jacobian_inverse(p[:, v_slice])
        target[:, v_slice] = rotation.apply(inverse, v[:, v_slice])
    return target - rate
