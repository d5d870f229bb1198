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

_FIT_ITERATIONS = 2
"""Newton iterations of a correction; two reduce centimetres to micrometres."""
_MAX_STEP_VIOLATION, _MAX_STEP_GAP = 2e-4, 2e-3
"""Largest h > 0, and largest gap of a string marked taut, that are not corrected [m].

Time steps leave such errors.
"""
_END_WEIGHT, _FIT_DAMPING = 1e-3, 1e-5
"""Weight of driven coordinates that are no lengths, and damping eps of nearly parallel strings."""


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


def with_inputs_fitting_strings(marionette: Marionette, x: State) -> State:
    """A measured state whose driven coordinates are corrected so that its taut strings fit.

        dq_K = -W A^T (A W A^T + eps 1)^-1 h    over strings too short, and taut strings

    Where a string of the real puppet is longer than that of the model, the measured distance of its
    ends exceeds its length; where it is shorter, the string is taut (``x.taut``) at a smaller
    distance. The weights W count the difference as length of the string, or if that is not driven,
    as a displacement of its upper end. Strings that no driven coordinate reaches keep it.
    """
    n_strings, q_K = len(marionette.tree.strings), x.q_K
    is_taut = x.taut[:n_strings] if len(x.taut) else np.zeros(n_strings, dtype=bool)
    names = marionette.coordinates.v_K
    weight = np.array([1.0 if name.endswith(".length") else _END_WEIGHT for name in names])
    for _ in range(_FIT_ITERATIONS if n_strings else 0):
        fitted = x.replace(q_K=q_K)
        h = marionette.constraint(fitted)[:n_strings]
        misfits = (h > _MAX_STEP_VIOLATION) | (is_taut & (h < -_MAX_STEP_GAP))
        if not np.any(misfits):
            break
        A_K = marionette.A_K(fitted)[:n_strings][misfits]
        matrix = (A_K * weight) @ A_K.T + _FIT_DAMPING * np.eye(len(A_K))
        dq_K = -weight * (A_K.T @ np.linalg.solve(matrix, h[misfits]))
        q_K = marionette.integrate(q_K, dq_K, driven=True)
    return x.replace(q_K=q_K, taut=x.taut)


def _is_done(record: LaneRecord) -> Mask:
    return np.asarray(record.status == Status.DONE)
