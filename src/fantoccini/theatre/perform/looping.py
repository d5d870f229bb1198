"""Motion from the end of a recording back to its start, tick by tick.

A quintic leads from the last position and velocity to the first within bounds. Its accelerations
at the middles of the ticks, with a small correction a + b i at tick i, arrive exactly.

A tick is the interval at which a performance advances. q_K are the driven coordinates that the
hands move, v_K their velocities, and n_vK is the number of these.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, ConfigK, VecK, polynomial, rotation
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import Input
from fantoccini.theatre.gestures import MAX_ACCELERATION, MAX_SPEED, motion_bounds, transition

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
    transition_motion, _ = transition(
        np.zeros(n), end[1], target, rate, motion_bounds(table, MAX_SPEED, MAX_ACCELERATION)
    )
    if transition_motion is None:
        return np.zeros((0, n))
    n_ticks = max(_MIN_TICKS, int(np.ceil(transition_motion[0] / tick)))
    zeros = np.zeros(n)
    coef = polynomial.hermite(
        np.full(n, n_ticks * tick), (zeros, end[1], zeros), (target, rate, zeros)
    )
    ticks = np.arange(n_ticks)
    acc = np.array(
        [polynomial.evaluate(coef, np.array((tick_index + 0.5) * tick))[2] for tick_index in ticks]
    )
    # Changes of the velocity and the position at the end, for each of a and b.
    remaining_times = (n_ticks - ticks - 0.5) * tick
    effects = tick * np.array(
        [[n_ticks, ticks.sum()], [remaining_times.sum(), remaining_times @ ticks]]
    )
    for _ in range(_MAX_CORRECTIONS):
        inputs = Input.segments(table, tick * np.arange(n_ticks + 1, dtype=float), *end, acc)
        q, v = (
            inputs.evaluate(n_ticks * tick)[0],
            inputs.evaluate(np.nextafter(n_ticks * tick, 0.0))[1],
        )
        error = np.array([start[1] - v, difference(table, q, start[0])])
        if np.max(np.abs(error)) <= _TOLERANCE:
            break
        a, b = np.linalg.solve(effects, error)
        acc = acc + a + b * ticks[:, None]
    return acc


def difference(table: CoordinateTable, q_K: ConfigK, other_q_K: ConfigK) -> VecK:
    """(n_vK,) tangent vector from one driven configuration to another."""
    vector = np.zeros(table.n_vK)
    q, v = table.scalar_indices_K
    vector[v] = other_q_K[q] - q_K[q]
    for q_index, v_index in table.quaternions_K:
        vector[v_index : v_index + 3] = rotation.between(
            q_K[q_index : q_index + 4], other_q_K[q_index : q_index + 4]
        )
    return vector


def _relative_to(
    table: CoordinateTable, q_K: ConfigK, end_motion: tuple[ConfigK, VecK]
) -> tuple[VecK, VecK]:
    """Target and its velocity as offsets and rates from a driven configuration."""
    target, rate = difference(table, q_K, end_motion[0]), np.array(end_motion[1])
    for _, v_index in table.quaternions_K:
        indices = slice(v_index, v_index + 3)
        rate[indices], _ = rotation.tangent_motion(target[indices], rate[indices], np.zeros(3))
    return target, rate
