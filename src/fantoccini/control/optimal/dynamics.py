"""The dynamics of optimal control: ends of intervals and their derivatives.

    z_{i+1} = A_i z_i + B_i u_i + e_i,   e_i = F(x_i, acc_i) - x_{i+1}

An interval consists of time steps; all intervals are computed at once, in lanes and on threads. A
and B are products of the steps' derivatives:

    X <- F_D X + F_K K + F_a,   K <- A_K K + B_K

F is the map of the simulator, and F_D, F_K and F_a are its derivatives; D stands for the dynamic
part of the state and K for the driven one, and acc_i are the driven accelerations in interval i.
Lanes are runs that the vector unit of the processor advances together. A taut string pulls, a slack
one does not. A node is a time at which the inputs may change, with its state; an interval leads to
the next node.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, Indices, Mask, MaskRows
from fantoccini.control.tasks import ChosenParameters, Nodes
from fantoccini.dynamics.marionette import Marionette


@dataclass(frozen=True, eq=False)
class Ends:
    """The ends of N intervals.

    Attributes:
        e: (N, n_z) changes from the nodes to these ends.
        tension: (N, n_rows) tensions in the first step of every interval [N or N m].
        taut: (N, n_rows) bool, the rows held in the first steps.
        settled: (N,) bool, whether all steps were made.
    """

    e: Array
    tension: Array
    taut: MaskRows
    settled: Mask


@dataclass(frozen=True, eq=False)
class LinearEnds(Ends):
    """The ends of N intervals with their derivatives.

    Attributes:
        A: (N, n_z, n_z) derivatives with respect to the state at the start of an interval.
        B: (N, n_z, n_vK) derivatives with respect to its accelerations.
        dtension: (N, n_rows, n_z + n_vK) derivatives of the tensions.
        dacc: (N, n_vD, n_z + n_vK) derivatives of the accelerations just after the nodes.
        dend_c: (N, n_z, 1 + n_p) derivatives of the ends with respect to the length of the
            intervals and the chosen parameters.
        dtension_c, dacc_c: (N, n_rows or n_vD, 1 + n_p) the same for the tensions and
            accelerations.
        dstart_c: (n_z, 1 + n_p) the same for the start.
    """

    A: Array
    B: Array
    dtension: Array
    dacc: Array
    dend_c: Array
    dtension_c: Array
    dacc_c: Array
    dstart_c: Array

    def with_constants(self, c: Indices) -> LinearEnds:
        """The same, with constants of the motion as further states, which do not change."""
        N, n_z, _ = self.B.shape
        A = np.zeros((N, n_z + len(c), n_z + len(c)))
        A[:, :n_z, :n_z], A[:, :n_z, n_z:] = self.A, self.dend_c[..., c]
        A[:, n_z:, n_z:] = np.eye(len(c))
        pull, acc = (
            np.concatenate(
                [derivatives[..., :n_z], by_constants[..., c], derivatives[..., n_z:]], axis=2
            )
            for derivatives, by_constants in (
                (self.dtension, self.dtension_c),
                (self.dacc, self.dacc_c),
            )
        )
        B, e = np.pad(self.B, ((0, 0), (0, len(c)), (0, 0))), np.pad(self.e, ((0, 0), (0, len(c))))
        return replace(self, A=A, B=B, dtension=pull, dacc=acc, e=e)


@dataclass(frozen=True)
class TimeSteps:
    """Intervals of time steps.

    Attributes:
        marionette: the puppet.
        dt: the longest step [s].
        threads: number of threads; all processors for None.
        free_parameters: the parameters that motions choose.
        with_tension: whether to compute the tensions' derivatives; otherwise they are 0.
        max_interval: longest interval of a search [s]. All intervals have as many steps as it, so
            that the dynamics are a smooth function of a free duration.
    """

    marionette: Marionette
    dt: float
    threads: int | None = None
    free_parameters: ChosenParameters | None = None
    with_tension: bool = True
    max_interval: float | None = None

    def split(self, interval: float) -> tuple[int, float]:
        """Number of steps in an interval, and their length [s]."""
        max_interval = interval if self.max_interval is None else self.max_interval
        n = max(1, round(max_interval / self.dt + 0.499999))
        return n, interval / n

    def extrapolated(self, nodes: Nodes) -> LinearEnds:
        """The result of :meth:`linearise`, with derivatives to second order in the steps.

        With m and M steps their errors are c / m and c / M, which cancel in
        (M D_M - m D_m) / (M - m) (Richardson extrapolation). Derivatives of tensions stay as they
        are.
        """
        max_interval = nodes.interval if self.max_interval is None else self.max_interval
        finer = replace(self, dt=0.5 * min(self.dt, max_interval), with_tension=False)
        m, M = self.split(nodes.interval)[0], finer.split(nodes.interval)[0]
        coarse, fine = self.linearise(nodes), finer.linearise(nodes)
        extrapolated = {
            name: (M * getattr(fine, name) - m * getattr(coarse, name)) / (M - m)
            for name in ("A", "B", "dend_c")
        }
        return replace(coarse, **extrapolated)

    def linearise(self, nodes: Nodes) -> LinearEnds:
        """The ends of the intervals with their derivatives."""
        table, N = self.marionette.coordinates, len(nodes)
        n, k = table.n_vD, table.n_vK
        n_x, n_s = 2 * n + 2 * k, 2 * n + 3 * k
        m, dt = self.split(nodes.interval)
        marionette, parameter_columns = self.marionette, np.zeros(0, dtype=int)
        if self.free_parameters:
            marionette = self.free_parameters.marionette(nodes.parameters)
            parameter_columns = n_s + np.array(self.free_parameters.columns)
        columns = np.concatenate([np.arange(n_s), parameter_columns])
        x = (nodes.q_D[:-1], nodes.v_D[:-1], nodes.q_K[:-1], nodes.v_K[:-1])
        settled = np.ones(N, dtype=bool)
        for j in range(m):
            v_before = x[1]
            step = marionette.linearise_steps(
                *x,
                nodes.acc_K,
                dt=dt,
                tension_partials=self.with_tension and j == 0,
                threads=self.threads,
            )
            x = (step.q_D, step.v_D, step.q_K, step.v_K)
            settled &= step.settled
            step_by_D, step_by_K = step.motion[..., : 2 * n], step.motion[..., 2 * n : n_x]
            K = step.driven
            if j == 0:
                tension, taut = step.tension, step.active
                pull = (
                    np.zeros((*tension.shape, step.motion.shape[2]))
                    if step.tension_partials is None
                    else step.tension_partials
                )
                X = step.motion[..., columns]
                acc = step.motion[:, n : 2 * n].copy()
                acc[:, np.arange(n), n + np.arange(n)] -= 1.0
                acc /= dt
                driven = np.broadcast_to(K, (N, *K.shape[1:])).copy()
                continue
            X = step_by_D @ X
            X[..., 2 * n : n_s] += step_by_K @ driven
            X[..., n_x:] += step.motion[..., n_x:][..., columns[n_x:] - n_x]
            driven = K[..., : 2 * k] @ driven
            driven[..., 2 * k :] += K[..., 2 * k :]
        A, B = np.zeros((N, nodes.n_z, nodes.n_z)), np.zeros((N, nodes.n_z, k))
        A[:, : 2 * n], B[:, : 2 * n] = X[..., :n_x], X[..., n_x:n_s]
        A[:, 2 * n :, 2 * n :], B[:, 2 * n :] = driven[..., : 2 * k], driven[..., 2 * k :]
        rates = np.concatenate([x[1], (x[1] - v_before) / dt, x[3], nodes.acc_K], axis=1)
        dend_c = np.zeros((N, nodes.n_z, 1 + len(parameter_columns)))
        dend_c[..., 0], dend_c[:, : 2 * n, 1:] = rates, X[..., n_s:]
        dtension_c, dacc_c = (
            np.pad(a[..., parameter_columns], ((0, 0), (0, 0), (1, 0))) for a in (pull, acc)
        )
        dstart_c = np.zeros((nodes.n_z, 1 + len(parameter_columns)))
        if self.free_parameters:
            dstart_c[:, 1:] = self.free_parameters.start_derivatives(nodes.parameters)
        return LinearEnds(
            nodes.changes_to(*x),
            tension,
            taut,
            settled,
            A,
            B,
            pull[..., :n_s],
            acc[..., :n_s],
            dend_c,
            dtension_c,
            dacc_c,
            dstart_c,
        )
