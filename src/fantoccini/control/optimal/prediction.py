"""Predictions: time steps from one state under several motions of the inputs, in lanes.

x_{i+1} = F(x_i, acc_i),   x_0 given
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fantoccini.base import Array, Mask, Status
from fantoccini.control.optimal.dynamics import Ends
from fantoccini.control.tasks import Nodes
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import AnyArray, LaneSteppers
from fantoccini.motion import State

_MOTION = ("q_D", "v_D", "q_K", "v_K")


class Predictions:
    """Makes several predictions from one state at once.

    Strings and limits may be violated at the start, as measured states violate them: steps take
    that back.

    Args:
        marionette: the puppet.
        dt: longest time step [s].
        lanes: predictions at most.
    """

    def __init__(self, marionette: Marionette, dt: float, lanes: int):
        self._marionette, self._n = marionette, lanes
        options = marionette.run_options(dt=dt, extrapolate=False)
        self._steppers = LaneSteppers(
            marionette.libraries.lanes, lanes, 1, options, marionette.winches
        )

    def make(
        self, x0: State, start: float, interval: float, acc_K: Array
    ) -> list[tuple[Nodes, Ends] | None]:
        """The nodes of every prediction, and where its intervals lead; None where one failed.

        Args:
            x0: where all start; its time does not count.
            start: time of the first node [s].
            interval: between nodes [s].
            acc_K: (n, N, n_vK) accelerations of the driven coordinates.
        """
        n, N, table = len(acc_K), acc_K.shape[1], self._marionette.coordinates
        arrays = self._begun(x0)
        every = {name: np.empty((N + 1, n, arrays[name].shape[1])) for name in _MOTION}
        for name in _MOTION:
            every[name][0] = arrays[name][:n]
        n_rows = arrays["tension"].shape[1]
        tension, ok = np.empty((N, n, n_rows)), np.ones(n, dtype=bool)
        acc = np.zeros((self._n, table.n_vK))
        advance = self._steppers.bound(arrays, interval, acc, None)
        for i in range(N):
            acc[:n] = acc_K[:, i]
            advance()
            for name in _MOTION:
                every[name][i + 1] = arrays[name][:n]
            tension[i] = arrays["tension"][:n]
        ok = _arrived(arrays)[:n]
        made: list[tuple[Nodes, Ends] | None] = []
        for j in range(n):
            states: dict[str, Any] = {
                name: np.ascontiguousarray(a[:, j]) for name, a in every.items()
            }
            if not ok[j] or not all(np.all(np.isfinite(a)) for a in states.values()):
                made.append(None)
                continue
            nodes = Nodes(table, start, interval, **states, acc_K=acc_K[j].copy())
            pull = np.ascontiguousarray(tension[:, j])
            e = np.zeros((N, nodes.n_z))
            made.append((nodes, Ends(e, pull, pull > 0.0, np.ones(N, dtype=bool))))
        return made

    def after(self, x0: State, acc_K: Array, duration: float) -> State | None:
        """The state a while later under constant accelerations; None where there is none."""
        arrays = self._begun(x0)
        acc = np.repeat(np.asarray(acc_K)[None], self._n, axis=0)
        self._steppers.advance(arrays, duration, acc, None)
        if not _arrived(arrays)[0]:
            return None
        parts = {name: arrays[name][0] for name in _MOTION}
        return replace(x0, t=x0.t + duration, **parts, taut=arrays["taut"][0])

    def _begun(self, x0: State) -> dict[str, AnyArray]:
        n, tree, marionette = self._n, self._marionette.tree, self._marionette
        arrays: dict[str, AnyArray] = {
            name: np.repeat(np.asarray(getattr(x0, name), dtype=float)[None], n, axis=0)
            for name in _MOTION
        }
        return arrays | {
            "p": np.repeat(marionette.p[None], n, axis=0),
            "fresh": np.ones(n, dtype=np.uint8),
            "slip": np.zeros((n, len(tree.strings))),
            "tension": np.zeros((n, tree.n_rows)),
            "taut": np.zeros((n, tree.n_rows), dtype=np.bool_),
            "books": np.zeros((n, 5)),
            "violation": np.zeros(n),
            "advanced": np.zeros(n),
            "status": np.zeros(n, dtype=np.int32),
            "blame": np.zeros((n, len(tree.blamable))),
        }


def _arrived(arrays: dict[str, AnyArray]) -> Mask:
    return np.asarray(arrays["status"] == Status.DONE)
