"""Joints: where inputs meet, begin at a state or end at rest, and what counts as a jump there.

:class:`Tolerances` is the one rule for all of them. Lengths are compared with lengths, angles with
angles. The piece next to the joint takes up a small difference, so that the motion is C^1; a larger
one is refused. Rotations may differ in angular velocity only.
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
    """Differences at a joint: allowed up to the larger of the two bounds for each quantity."""

    speed: float = 1e-7
    """Of velocities, in any motion [m/s or rad/s]."""
    relative_speed: float = 1e-3
    """Of velocities, relative to the largest speed in the inputs: few digits in a file."""
    place: float = 1e-9
    """Of positions, relative to 1 m or rad, or to the value if that is larger."""
    relative_place: float = 1e-6
    """Of positions, relative to the longest move in the inputs."""
    rounded_speed: float = 1e-9
    """Velocity difference that is rounding and is left alone [m/s or rad/s]."""
    rounded_place: float = 1e-12
    """Position difference that is rounding and is left alone [m or rad]."""
    min_duration: float = 1e-4
    """Shortest piece that takes up a difference [s]; a shorter one would accelerate too much."""
    speed_samples: int = 5
    """Points of each piece at which its speed and reach are measured."""


TOLERANCES = Tolerances()


def tolerances(table: CoordinateTable, breaks: Array, coef: Array) -> tuple[Array, Array]:
    """Largest differences of positions and velocities at a joint of inputs.

    Args:
        table: names and places of the coordinates.
        breaks: (n or 1, n_seg + 1) [s].
        coef: (n, n_seg, n_vK, 6).

    Returns:
        Position and speed tolerances (n, n_vK); for a position relative to its value at the start.
    """
    s = np.diff(breaks)[..., None, None] * np.linspace(0.0, 1.0, TOLERANCES.speed_samples)
    # Lengths that are not named yet are NaN.
    q, v, _ = polynomial.evaluate(np.nan_to_num(coef)[..., None, :], s)
    speed = np.max(np.abs(v), axis=(1, 3), initial=0.0)
    reach = np.max(q, axis=(1, 3)) - np.min(q, axis=(1, 3))
    size = np.maximum(1.0, np.abs(q[:, 0, :, 0]))
    for _, at in table.quaternions_K:
        turn = slice(at, at + 3)
        speed[:, turn] = np.max(np.linalg.norm(v[:, :, turn], axis=2), axis=(1, 2))[:, None]
        reach[:, turn], size[:, turn] = 0.0, 1.0
    units = {row.name: row.unit for row in table.rows}
    metres = np.zeros(table.n_vK, dtype=bool)
    for place, at in table.scalars_K:
        metres[at] = units[table.q_K[place]] == "m"
    for alike in (metres, ~metres):
        for scale in (speed, reach):
            scale[:, alike] = np.max(scale[:, alike], axis=1, initial=0.0)[:, None]
    tol = TOLERANCES
    same = np.maximum(tol.relative_place * reach, tol.place * size)
    return same, np.maximum(tol.relative_speed * speed, tol.speed)


def begun(table: CoordinateTable, coef: Array, s: Array, h: Array, move: Array, v: Array) -> Array:
    """Pieces with another start position and velocity, and the same end.

    Args:
        table: names and places of the coordinates.
        coef: (n, n_vK, 6) of the pieces.
        s: (n,) time in the piece at which it begins [s].
        h: (n,) duration of the piece [s].
        move: (n, n_vK) change of the start position, 0 for rotations [m or rad].
        v: (n, n_vK) start velocity [m/s or rad/s].

    Returns:
        (n, n_vK, 6).
    """
    left, none = h - s, np.zeros_like(v)
    dv = _rates(table, coef, s, v)
    takes = _not_rounding(move, dv) & (left > TOLERANCES.min_duration)[:, None]
    move, dv = np.where(takes, move, 0.0), np.where(takes, dv, 0.0)
    left = np.where(left > TOLERANCES.min_duration, left, 1.0)[:, None]
    bend = polynomial.hermite(left, (move, dv, none), (none, none, none))
    return coef + polynomial.shifted(bend, -s)


def ended(table: CoordinateTable, coef: Array, h: Array, move: Array, v: Array) -> Array:
    """Pieces with another end position and velocity; arguments as of :func:`begun`."""
    none = np.zeros_like(v)
    dv = _rates(table, coef, h, v)
    takes = _not_rounding(move, dv) & (h > TOLERANCES.min_duration)[:, None]
    move, dv = np.where(takes, move, 0.0), np.where(takes, dv, 0.0)
    h = np.where(h > TOLERANCES.min_duration, h, 1.0)[:, None]
    return coef + polynomial.hermite(h, (none, none, none), (move, dv, none))


def _not_rounding(move: Array, dv: Array) -> Mask:
    return (np.abs(move) > TOLERANCES.rounded_place) | (np.abs(dv) > TOLERANCES.rounded_speed)


def _rates(table: CoordinateTable, coef: Array, s: Array, v: Array) -> Array:
    """Velocities v (n, n_vK) less the polynomials' rates at times s (n,)."""
    p, rate, _ = polynomial.evaluate(coef, s[:, None])
    wanted = np.array(v)
    for _, at in table.quaternions_K:
        turn = slice(at, at + 3)
        inverse = rotation.right_jacobian_inverse(p[:, turn])
        wanted[:, turn] = rotation.apply(inverse, v[:, turn])
    return wanted - rate
