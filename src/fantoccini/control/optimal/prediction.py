"""Rollouts of several driven motions from one state, computed in lanes (SIMD).

x_{i+1} = F(x_i, acc_i),   x_0 given

acc_i are the accelerations acc_K of the driven coordinates in interval i, and F the map of the
simulator. Lanes are runs that the vector unit of the processor advances together. In names, D
stands for dynamic coordinates, which move by the equations of motion. A node is a time at which the
inputs may change, with its state; an interval leads to the next node.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fantoccini.base import Array, Mask, Status
from fantoccini.control.optimal.dynamics import Ends
from fantoccini.control.tasks import Nodes
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import LaneHistory, LaneRecord, LaneSteppers
from fantoccini.motion import State

_STATE_FIELDS = ("q_D", "v_D", "q_K", "v_K")


class Predictions:
    """Rollouts of several driven motions at once, from one state.

    Measured states may violate strings and limits; the time steps reduce such violations.

    Args:
        marionette: the puppet.
        dt: longest time step [s].
        lanes: largest number of rollouts.
    """

    def __init__(self, marionette: Marionette, dt: float, lanes: int):
        self._marionette, self._n_lanes = marionette, lanes
        options = marionette.run_options(dt=dt, extrapolate=False)
        library = marionette.libraries.lanes
        self._record = LaneRecord(lanes, library.sizes)
        self._steppers = LaneSteppers(library, self._record, 1, options, marionette.winches)

    def predict(
        self, x0: State, start: float, interval: float, acc_K: Array
    ) -> list[tuple[Nodes, Ends] | None]:
        """Nodes and interval ends of every rollout; None for a failed one.

        Args:
            x0: start state of all rollouts; its time is ignored.
            start: time of the first node [s].
            interval: time between nodes [s].
            acc_K: (n, N, n_vK) accelerations of the driven coordinates.
        """
        n, N, table = len(acc_K), acc_K.shape[1], self._marionette.coordinates
        record = self._restart(x0)
        history = LaneHistory(record, N + 1, (*_STATE_FIELDS, "tension"))
        history.keep(0)
        acc = np.zeros((self._n_lanes, table.n_vK))
        advance = self._steppers.bound(interval, acc, None)
        for i in range(N):
            acc[:n] = acc_K[:, i]
            advance()
            history.keep(i + 1)
        is_done = _is_done(record)[:n]
        predictions: list[tuple[Nodes, Ends] | None] = []
        for j in range(n):
            states: dict[str, Any] = {
                name: np.ascontiguousarray(history.parts[name][:, j]) for name in _STATE_FIELDS
            }
            if not is_done[j] or not all(np.all(np.isfinite(a)) for a in states.values()):
                predictions.append(None)
                continue
            nodes = Nodes(table, start, interval, **states, acc_K=acc_K[j].copy())
            tension = np.ascontiguousarray(history.parts["tension"][1:, j])
            e = np.zeros((N, nodes.n_z))
            predictions.append((nodes, Ends(e, tension, tension > 0.0, np.ones(N, dtype=bool))))
        return predictions

    def state_after(self, x0: State, acc_K: Array, duration: float) -> State | None:
        """The state after a duration with constant accelerations; None if the steps failed."""
        record = self._restart(x0)
        acc = np.repeat(np.asarray(acc_K)[None], self._n_lanes, axis=0)
        self._steppers.advance(duration, acc, None)
        if not _is_done(record)[0]:
            return None
        parts = {name: getattr(record, name)[0].copy() for name in _STATE_FIELDS}
        return replace(x0, t=x0.t + duration, **parts, taut=record.taut[0].copy())

    def _restart(self, x0: State) -> LaneRecord:
        motion = {name: getattr(x0, name) for name in _STATE_FIELDS}
        self._record.begin(**motion, p=self._marionette.p, slip=np.zeros(1))
        return self._record


def _is_done(record: LaneRecord) -> Mask:
    return np.asarray(record.status == Status.DONE)
