"""Motion from the end of a recording back to its start, tick by tick.

A quintic leads from the last position and velocity to the first within bounds. Its accelerations
at the middles of the ticks, with a small correction a + b i at tick i, arrive exactly.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, ConfigK, VecK, polynomial, rotation
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import Input
from fantoccini.theatre.gestures import ACCELERATION, SPEED, limits, transition

_MIN_TICKS = 6
"""Shortest way [ticks]."""
_MAX_CORRECTIONS = 20
"""Number of corrections; without rotations the first is exact."""
_TOLERANCE = 1e-13
"""Error at the end of the way that counts as exact [m or rad, per s]."""


def return_motion(
    table: CoordinateTable, end: tuple[ConfigK, VecK], start: tuple[ConfigK, VecK], tick: float
) -> Array:
    """(k, n_vK) accelerations from one position and velocity to another; k is 0 if they agree.

    Args:
        table: table of the coordinates.
        end: q_K and v_K at the beginning of the way.
        start: q_K and v_K at its end.
        tick: duration of a tick [s].

    Raises:
        StateError: no duration keeps the bounds.
    """
    n = table.n_vK
    target, rate = _relative_to(table, end[0], start)
    lead, _ = transition(np.zeros(n), end[1], target, rate, limits(table, SPEED, ACCELERATION))
    if lead is None:
        return np.zeros((0, n))
    k = max(_MIN_TICKS, int(np.ceil(lead[0] / tick)))
    nothing = np.zeros(n)
    coef = polynomial.hermite(
        np.full(n, k * tick), (nothing, end[1], nothing), (target, rate, nothing)
    )
    i = np.arange(k)
    acc = np.array([polynomial.evaluate(coef, np.array((j + 0.5) * tick))[2] for j in i])
    # Changes of the velocity and the position at the end, for each of a and b.
    left = (k - i - 0.5) * tick
    effect = tick * np.array([[k, i.sum()], [left.sum(), left @ i]])
    for _ in range(_MAX_CORRECTIONS):
        inputs = Input.segments(table, tick * np.arange(k + 1, dtype=float), *end, acc)
        q, v = inputs.evaluate(k * tick)[0], inputs.evaluate(np.nextafter(k * tick, 0.0))[1]
        error = np.array([start[1] - v, difference(table, q, start[0])])
        if np.max(np.abs(error)) <= _TOLERANCE:
            break
        a, b = np.linalg.solve(effect, error)
        acc = acc + a + b * i[:, None]
    return acc


def difference(table: CoordinateTable, q_K: ConfigK, other: ConfigK) -> VecK:
    """(n_vK,) tangent vector from one driven configuration to another."""
    vector = np.zeros(table.n_vK)
    q, v = table.scalar_indices_K
    vector[v] = other[q] - q_K[q]
    for at, w in table.quaternions_K:
        vector[w : w + 3] = rotation.between(q_K[at : at + 4], other[at : at + 4])
    return vector


def _relative_to(
    table: CoordinateTable, q_K: ConfigK, there: tuple[ConfigK, VecK]
) -> tuple[VecK, VecK]:
    """Target and its velocity as offsets and rates from a driven configuration."""
    target, rate = difference(table, q_K, there[0]), np.array(there[1])
    for _, w in table.quaternions_K:
        turn = slice(w, w + 3)
        rate[turn], _ = rotation.tangent_motion(target[turn], rate[turn], np.zeros(3))
    return target, rate
