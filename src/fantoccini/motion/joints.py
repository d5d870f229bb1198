"""Joints: where inputs meet, begin at a state or end at rest, and what counts as a jump there.

One rule for all of them. A velocity may differ by 1e-3 of the largest speed in the inputs, or by
1e-7 m/s or rad/s if that is more; a position by 1e-6 of the farthest move, or by 1e-9 relative to 1
or to its value. Lengths are compared with lengths, angles with angles. The difference is taken up
by the piece beside the joint, so that the motion is C^1; what differs by more is refused. Rotations
may differ in angular velocity only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fantoccini.arrays import Array, Mask
from fantoccini.motion import polynomial, rotation

if TYPE_CHECKING:
    from fantoccini.tree import CoordinateTable

SAME_SPEED = 1e-7
"""Difference of velocities that counts as none in any motion [m/s or rad/s]."""
SAME_PLACE = 1e-9
"""The same of positions, relative to 1 or to the value if that is larger."""
_OF_SPEED = 1e-3
_OF_REACH = 1e-6
ROUNDED_PLACE, ROUNDED_SPEED = 1e-12, 1e-9
"""Differences that are left as they are: rounding."""
_SHORTEST = 1e-4
"""Pieces that last no longer take nothing up [s]."""
_LOOKS = np.linspace(0.0, 1.0, 5)
"""Where speeds are looked at, shares of a piece."""


def tolerances(table: CoordinateTable, breaks: Array, coef: Array) -> tuple[Array, Array]:
    """How far positions and velocities may differ at a joint of inputs.

    Args:
        table: names and places of the coordinates.
        breaks: (n or 1, n_seg + 1) [s].
        coef: (n, n_seg, n_vK, 6).

    Returns:
        place and speed (n, n_vK). A place's is that of its value at the start.
    """
    s = np.diff(breaks)[..., None, None] * _LOOKS
    # Lengths that nobody has named yet have no value.
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
    same = np.maximum(_OF_REACH * reach, SAME_PLACE * size)
    return same, np.maximum(_OF_SPEED * speed, SAME_SPEED)


def begun(
    table: CoordinateTable, coef: Array, s: Array, h: Array, move: Array, v: Array
) -> Array:
    """Pieces that begin elsewhere and with another velocity, and end as they did.

    Args:
        table: names and places of the coordinates.
        coef: (n, n_vK, 6) of the pieces.
        s: (n,) time in the piece at which it begins [s].
        h: (n,) how long the piece lasts [s].
        move: (n, n_vK) by which it begins elsewhere, 0 for rotations [m or rad].
        v: (n, n_vK) velocity with which it begins [m/s or rad/s].

    Returns:
        (n, n_vK, 6).
    """
    left, none = h - s, np.zeros_like(v)
    dv = _rates(table, coef, s, v)
    takes = _worth(move, dv) & (left > _SHORTEST)[:, None]
    move, dv = np.where(takes, move, 0.0), np.where(takes, dv, 0.0)
    left = np.where(left > _SHORTEST, left, 1.0)[:, None]
    bend = polynomial.hermite(left, (move, dv, none), (none, none, none))
    return coef + polynomial.shifted(bend, -s)


def ended(table: CoordinateTable, coef: Array, h: Array, move: Array, v: Array) -> Array:
    """Pieces that end elsewhere and with another velocity; arguments as of :func:`begun`."""
    none = np.zeros_like(v)
    dv = _rates(table, coef, h, v)
    takes = _worth(move, dv) & (h > _SHORTEST)[:, None]
    move, dv = np.where(takes, move, 0.0), np.where(takes, dv, 0.0)
    h = np.where(h > _SHORTEST, h, 1.0)[:, None]
    return coef + polynomial.hermite(h, (none, none, none), (move, dv, none))


def _worth(move: Array, dv: Array) -> Mask:
    return (np.abs(move) > ROUNDED_PLACE) | (np.abs(dv) > ROUNDED_SPEED)


def _rates(table: CoordinateTable, coef: Array, s: Array, v: Array) -> Array:
    """Velocities v (n, n_vK) less the polynomials' rates at times s (n,)."""
    p, rate, _ = polynomial.evaluate(coef, s[:, None])
    wanted = np.array(v)
    for _, at in table.quaternions_K:
        turn = slice(at, at + 3)
        inverse = rotation.right_jacobian_inverse(p[:, turn])
        wanted[:, turn] = rotation.apply(inverse, v[:, turn])
    return wanted - rate
