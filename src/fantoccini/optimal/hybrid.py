"""Exact derivatives of the intervals of an event-driven run, through releases and catches.

Between events the variational equations

    Zdot = A(t) Z + B(t) du,   Z = (dq_D, dv_D, dq_K, dv_K)

are solved by Gauss collocation at states of the run itself; at a release Z stays, at a catch it
jumps by the saltation matrix (:mod:`fantoccini.simulation.catch`), in which the time of the event,
an unknown of the hybrid problem, is eliminated by its guard h = 0.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fantoccini.arrays import Array, Indices
from fantoccini.marionette import Marionette
from fantoccini.motion import Trajectory
from fantoccini.optimal.dynamics import Ends, LinearEnds
from fantoccini.optimal.frozen_modes import FrozenModes
from fantoccini.optimal.nodes import Nodes
from fantoccini.optimal.shooting import EventRuns
from fantoccini.simulation import simulate
from fantoccini.simulation.catch import Catch
from fantoccini.simulation.input_piece import InputVariation

_STAGES = 4
"""Of Gauss collocation over a step of the run: of order 8, as the run itself."""
_JUMP = 1e-9
"""Change of velocity from which an event is a catch, relative to 1 or the largest velocity."""


class HybridRuns(EventRuns):
    """Event-driven runs, with the exact derivatives of their intervals."""

    def linearise(self, nodes: Nodes, ends: Ends) -> LinearEnds:
        """See :class:`fantoccini.optimal.sqp.Shooting`."""
        marionette = self.chosen.marionette(nodes.parameters)
        # Without times to save it has every step of the integrator.
        run = simulate(marionette, self.chosen.start(nodes.parameters), nodes.inputs(), nodes.t[-1],
                       effort=False)  # fmt: skip
        return _Intervals(marionette, nodes, run).linear(ends)


class _Intervals:
    """The intervals of a run, cut into its steps, which end at its events.

    Args:
        marionette: the puppet.
        nodes, run: a run with all its steps, and its states at the nodes.
    """

    def __init__(self, marionette: Marionette, nodes: Nodes, run: Trajectory):
        self._marionette, self._nodes, self._run = marionette, nodes, run
        t = marionette.coordinates
        self._n, self._k = t.n_vD, t.n_vK
        holds = np.concatenate([run.taut.values, run.limit_force.values > 0.0], axis=1)
        self._holds = holds | marionette.model.two_sided
        self._firsts = np.searchsorted(run.t, nodes.t + 1e-12, side="right") - 1

    def linear(self, ends: Ends) -> LinearEnds:
        """The ends with their derivatives."""
        nodes, run, n_z, k = self._nodes, self._run, self._nodes.n_z, self._k
        N = len(nodes)
        A, B = np.zeros((N, n_z, n_z)), np.zeros((N, n_z, k))
        carried, last = self._carried(), np.zeros(N, dtype=int)
        for i in range(N):
            Z = np.eye(n_z, n_z + k)
            for j in range(self._firsts[i], self._firsts[i + 1]):
                if self._is_event(j):
                    Z = self._across(j, Z)
                else:
                    by_z, by_u = carried[j]
                    Z, last[i] = by_z @ Z, j
                    Z[:, n_z:] += by_u
            A[i], B[i] = Z[:, :n_z], Z[:, n_z:]
        starts = self._moving(self._firsts[:-1], run, nodes.acc_K, self._firsts[:-1])
        stops = self._moving(last + 1, run, nodes.acc_K, last)
        rates = (run.v_D[last + 1], stops.acc_D, run.v_K[last + 1], nodes.acc_K)
        by_c, n_rows = np.concatenate(rates, axis=1)[..., None], ends.tension.shape[1]
        return LinearEnds(
            ends.e, ends.tension, ends.taut, ends.settled, A, B, starts.pull, by_c,
            np.zeros((N, n_rows, 1)), np.zeros((n_z, 1)),
        )  # fmt: skip

    def _is_event(self, j: int) -> bool:
        return bool(self._run.t[j] == self._run.t[j + 1])

    def _moving(self, at: Indices, run: Trajectory, acc_K: Array, modes: Indices) -> FrozenModes:
        """At samples of a run, with the rows held that are held from other samples on."""
        q_D, v_D, q_K, v_K = (a[at] for a in (run.q_D, run.v_D, run.q_K, run.v_K))
        return FrozenModes.at(self._marionette, q_D, v_D, q_K, v_K, acc_K, self._holds[modes])

    def _carried(self) -> dict[int, tuple[Array, Array]]:
        """What the smooth pieces make of (Z, du), by their first samples."""
        run, nodes, n_z, k, s = self._run, self._nodes, self._nodes.n_z, self._k, _STAGES
        pieces = np.flatnonzero(np.diff(run.t) > 0.0)
        c, a, b = _gauss(s)
        h, m = np.diff(run.t)[pieces], len(pieces)
        times = (run.t[pieces, None] + h[:, None] * c).ravel()
        inner = simulate(
            self._marionette, run.state(0), nodes.inputs(), run.t[-1], save_at=times, effort=False
        )
        interval = np.searchsorted(self._firsts, pieces, side="right") - 1
        found = self._moving(
            np.searchsorted(inner.t, times), inner, np.repeat(nodes.acc_K[interval], s, axis=0),
            np.repeat(pieces, s),
        )  # fmt: skip
        A, B = found.A.reshape(m, s, n_z, n_z), found.B.reshape(m, s, n_z, k)
        coupled = h[:, None, None, None, None] * A[:, :, :, None] * a[:, None, :, None]
        whole = np.eye(s * n_z) - coupled.reshape(m, s * n_z, s * n_z)
        both = np.concatenate([A, B], axis=3).reshape(m, s * n_z, n_z + k)
        rates = np.linalg.solve(whole, both).reshape(m, s, n_z, n_z + k)
        Z = h[:, None, None] * np.einsum("s,psij->pij", b, rates)
        Z[:, :, :n_z] += np.eye(n_z)
        return {int(j): (Z[p, :, :n_z], Z[p, :, n_z:]) for p, j in enumerate(pieces)}

    def _across(self, j: int, Z: Array) -> Array:
        """The changes after the event between sample j and the next."""
        run, n, k = self._run, self._n, self._k
        before, after = run.state(j), run.state(j + 1)
        size = max(1.0, float(np.max(np.abs(before.v_D), initial=0.0)))
        if np.max(np.abs(after.v_D - before.v_D), initial=0.0) <= _JUMP * size:
            return Z
        none = InputVariation.none(self._marionette, Z.shape[1])
        by_input = replace(none, q_K=Z[2 * n : 2 * n + k], v_K=Z[2 * n + k :])
        held = np.flatnonzero(self._holds[j]), np.flatnonzero(self._holds[j + 1])
        catch = Catch(self._marionette, before, after, held)
        acc = run.acc_D[j], run.acc_D[j + 1]
        carried = catch.carried(Z[: 2 * n], by_input, acc, run.acc_K[j])
        return np.concatenate([carried, Z[2 * n :]])


def _gauss(stages: int) -> tuple[Array, Array, Array]:
    """Nodes, matrix and weights of Gauss collocation on [0, 1]."""
    x, w = np.polynomial.legendre.leggauss(stages)
    c = 0.5 * (x + 1.0)
    powers = np.arange(stages)
    V = c[:, None] ** powers
    a = (c[:, None] ** (powers + 1) / (powers + 1)) @ np.linalg.inv(V)
    return c, a, 0.5 * w
