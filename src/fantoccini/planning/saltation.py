"""Exact slopes of segments in which strings or limits are caught or let go.

By :func:`fantoccini.sensitivity`, with the saltation matrix of every catch. Differences of the
time-stepper cannot give them where a catch grazes or falls next to a node: they were off a
hundredfold there.
"""

from __future__ import annotations

import numpy as np

from fantoccini.arrays import Array, MaskRows
from fantoccini.errors import FantocciniError
from fantoccini.marionette import Marionette
from fantoccini.motion import Input, State
from fantoccini.planning.goals import Rows
from fantoccini.simulation import sensitivity

_TOLERANCE = 1e-6
"""Of the integration."""


def caught_slopes(
    marionette: Marionette,
    start: Rows,
    acceleration: Array,
    duration: float,
    pulling: MaskRows | None = None,
) -> tuple[Array, Array] | None:
    """A and B of a segment, as of :func:`fantoccini.planning.slopes.segment_slopes`.

    Args:
        marionette: the puppet; none of its driven coordinates is a rotation.
        start: one state.
        acceleration: (n_vK,) of the driven coordinates.
        duration: [s].
        pulling: (n_strings,) bool, the strings that pull there, where that is known.

    Returns:
        (n_z, n_z) and (n_z, n_vK), over changes that leave taut strings taut; None where the run
        has no derivative: it cannot go on, winches slip, or two rows are caught at once.
    """
    table, T = marionette.coordinates, duration
    n, k = table.n_vD, table.n_vK
    taut = np.zeros(marionette.tree.n_rows, dtype=bool)
    if pulling is not None:
        taut[: len(pulling)] = pulling

    def inputs(q_K: Array, v_K: Array, acc_K: Array) -> Input:
        times = np.array([0.0, T])
        return Input.segments(
            table, times, start.q_K + q_K, start.v_K + v_K, (acceleration + acc_K)[None]
        )

    changes = np.split(np.eye(3 * k), 3, axis=1)
    try:
        given = State(0.0, start.q_D, start.v_D, start.q_K, start.v_K, taut, start.slip)
        x = marionette.project(given)
        found = sensitivity(
            marionette,
            x,
            inputs(*np.zeros((3, k))),
            T,
            toward=[inputs(*change) for change in zip(*changes, strict=True)],
            rtol=_TOLERANCE,
            atol=_TOLERANCE,
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
