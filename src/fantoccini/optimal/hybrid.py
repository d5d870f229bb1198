"""Exact derivatives of the intervals of an event-driven run, through releases and catches.

Between events the variational equations

    Zdot = A(t) Z + B(t) du,   Z = (dq_D, dv_D, dq_K, dv_K)

are solved by Gauss collocation at states of the run itself; at a release Z stays, at a catch it
jumps by the saltation matrix (:mod:`fantoccini.simulation.catch`), in which the time of the event,
an unknown of the hybrid problem, is eliminated by its guard h = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fantoccini.arrays import Array, Indices
from fantoccini.errors import SimulationError
from fantoccini.marionette import Marionette
from fantoccini.motion import Trajectory
from fantoccini.optimal.dynamics import Ends, LinearEnds
from fantoccini.optimal.nodes import Nodes
from fantoccini.optimal.shooting import EventRuns
from fantoccini.simulation import simulate
from fantoccini.simulation.catch import Catch
from fantoccini.simulation.input_piece import InputVariation

_STAGES = 5
"""Of Gauss collocation, which is of twice this order."""
_JUMP = 1e-9
"""Change of velocity from which an event is a catch, relative to 1 or the largest velocity."""


class HybridRuns(EventRuns):
    """Event-driven runs, with the exact derivatives of their intervals."""

    def linearise(self, nodes: Nodes, ends: Ends) -> LinearEnds:
        """See :class:`fantoccini.optimal.sqp.Shooting`."""
        made = self.run(nodes)
        if made is None:
            raise SimulationError
        return _Intervals(self.marionette, *made).linear(self.ends(*made))


class _Intervals:
    """The intervals of a run, cut into smooth pieces at its events.

    Args:
        marionette: the puppet.
        nodes, run: a run, and its states at the nodes.
    """

    def __init__(self, marionette: Marionette, nodes: Nodes, run: Trajectory):
        self._marionette, self._nodes, self._run = marionette, nodes, run
        t = marionette.coordinates
        self._n, self._k = t.n_vD, t.n_vK
        self._firsts = np.searchsorted(run.t, nodes.t + 1e-12, side="right") - 1

    def linear(self, ends: Ends) -> LinearEnds:
        """The ends with their derivatives."""
        nodes, n_z, k = self._nodes, self._nodes.n_z, self._k
        N = len(nodes)
        A, B, later = np.zeros((N, n_z, n_z)), np.zeros((N, n_z, k)), np.zeros((N, n_z))
        pull = np.zeros((N, ends.tension.shape[1], n_z + k))
        carried = self._carried()
        for i in range(N):
            Z = np.eye(n_z, n_z + k)
            first, last = self._firsts[i], self._firsts[i + 1]
            for j in range(first, last):
                Z = self._across(i, j, Z) if self._is_event(j) else carried[j][0] @ Z + carried[j][1]
            A[i], B[i] = Z[:, :n_z], Z[:, n_z:]
            at = self._linearised(first, nodes.acc_K[i], first)
            by = at.pull
            pull[i] = np.concatenate([by.q_D, by.v_D, by.q_K, by.v_K, by.acc_K], axis=1)
            before = max(j for j in range(first, last) if not self._is_event(j))
            x = self._run.state(before + 1)
            acc_D = self._linearised(before + 1, nodes.acc_K[i], before).acc_D
            later[i] = np.concatenate([x.v_D, acc_D, x.v_K, nodes.acc_K[i]])
        return LinearEnds(
            ends.e, ends.tension, ends.taut, ends.settled, A, B, pull, later
        )

    def _is_event(self, j: int) -> bool:
        return bool(self._run.t[j] == self._run.t[j + 1])

    def _held(self, j: int) -> Indices:
        run = self._run
        holds = np.concatenate([run.taut.values[j], run.limit_force.values[j] > 0.0])
        return np.flatnonzero(holds | self._marionette.model.two_sided)

    def _names(self, j: int) -> list[str]:
        return [self._marionette.tree.row_names[r] for r in self._held(j)]

    def _linearised(self, j, acc_K, mode):
        return self._marionette.linearise(self._run.state(j), acc_K, rows=self._names(mode))

    def _carried(self) -> dict[int, tuple[Array, Array]]:
        """The matrices of all smooth pieces, by their first sample."""
        run, nodes = self._run, self._nodes
        pieces = [j for j in range(len(run.t) - 1) if not self._is_event(j)]
        c, a, b = _gauss(_STAGES)
        starts, lasts = run.t[pieces], np.diff(run.t)[pieces]
        times = starts[:, None] + lasts[:, None] * c
        inner = simulate(self._marionette, run.state(0), nodes.inputs(), run.t[-1], save_at=times.ravel(), effort=False)
        at = np.searchsorted(inner.t, times)
        of = np.searchsorted(self._firsts, pieces, side="right") - 1
        s, n_z, k = _STAGES, nodes.n_z, self._k
        A, B = np.zeros((len(pieces), s, n_z, n_z)), np.zeros((len(pieces), s, n_z, k))
        for p, j in enumerate(pieces):
            names = self._names(j)
            for l in range(s):
                lin = self._marionette.linearise(inner.state(at[p, l]), nodes.acc_K[of[p]], rows=names)
                A[p, l], B[p, l] = lin.A, lin.B
        h = lasts[:, None, None]
        whole = np.eye(s * n_z) - (lasts[:, None, None, None, None] * A[:, :, :, None, :] * a[None, :, None, :, None]).reshape(len(pieces), s * n_z, s * n_z)
        K = np.linalg.solve(whole, np.concatenate([A, B], axis=3).reshape(len(pieces), s * n_z, n_z + k))
        Z = h * np.einsum("s,psij->pij", b, K.reshape(len(pieces), s, n_z, n_z + k))
        Z[:, :, :n_z] += np.eye(n_z)
        none = np.zeros((n_z, n_z))
        return {j: (Z[p, :, :n_z], np.concatenate([none, Z[p, :, n_z:]], axis=1)) for p, j in enumerate(pieces)}

    def _across(self, i: int, j: int, Z: Array) -> Array:
        """The changes after the event between sample j and the next."""
        run, n, k = self._run, self._n, self._k
        before, after = run.state(j), run.state(j + 1)
        size = max(1.0, float(np.max(np.abs(before.v_D), initial=0.0)))
        if np.max(np.abs(after.v_D - before.v_D), initial=0.0) <= _JUMP * size:
            return Z
        none = InputVariation.none(self._marionette, Z.shape[1])
        by_input = replace(none, q_K=Z[2 * n : 2 * n + k], v_K=Z[2 * n + k :])
        catch = Catch(self._marionette, before, after, (self._held(j), self._held(j + 1)))
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
