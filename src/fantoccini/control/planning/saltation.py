"""Exact derivatives of segments in which strings or limits are caught or released.

From :func:`fantoccini.sensitivity`, with the saltation matrix of every catch. Differences of the
time-stepper are wrong by a factor of a hundred where a catch grazes or falls next to a node.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, FantocciniError, MaskRows
from fantoccini.control.problems import StateArrays
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import sensitivity
from fantoccini.motion import Input, State

_INTEGRATION_TOLERANCE = 1e-6
"""rtol and atol of the event-driven runs."""


def event_derivatives(
    marionette: Marionette,
    start: StateArrays,
    acceleration: Array,
    duration: float,
    active: MaskRows,
) -> tuple[Array, Array] | None:
    """A and B of one segment, as of
    :func:`fantoccini.control.problems.derivatives.segment_derivatives`.

    Args:
        marionette: the puppet; none of its driven coordinates is a rotation.
        start: one state.
        acceleration: (n_vK,) of the driven coordinates.
        duration: [s].
        active: (n_strings,) bool, the active set at the start.

    Returns:
        (n_z, n_z) and (n_z, n_vK), over changes that leave taut strings taut; None where the run
        has no derivative: it stops, winches slip, or two rows are caught at once.
    """
    table, T = marionette.coordinates, duration
    n, k = table.n_vD, table.n_vK
    taut = np.zeros(marionette.tree.n_rows, dtype=bool)
    taut[: len(active)] = active

    def inputs(q_K: Array, v_K: Array, acc_K: Array) -> Input:
        times = np.array([0.0, T])
        return Input.segments(
            table, times, start.q_K + q_K, start.v_K + v_K, (acceleration + acc_K)[None]
        )

    changes = np.split(np.eye(3 * k), 3, axis=1)
    try:
        given = State(0.0, start.q_D, start.v_D, start.q_K, start.v_K, taut, start.slip)
        found = sensitivity(
            marionette,
            marionette.project(given),
            inputs(*np.zeros((3, k))),
            T,
            toward=[inputs(*change) for change in zip(*changes, strict=True)],
            rtol=_INTEGRATION_TOLERANCE,
            atol=_INTEGRATION_TOLERANCE,
        )
    except FantocciniError:
        return None
    if not found.sharp:
        return None
    A, B = np.eye(2 * (n + k)), np.zeros((2 * (n + k), k))
    A[: 2 * n, : 2 * n], by_K = found.x0[-1], found.toward[-1]
    A[: 2 * n, 2 * n :], B[: 2 * n] = by_K[:, : 2 * k], by_K[:, 2 * k :]
    A[2 * n : 2 * n + k, 2 * n + k :] = T * np.eye(k)
    B[2 * n :] = np.concatenate([0.5 * T**2 * np.eye(k), T * np.eye(k)])
    return A, B
