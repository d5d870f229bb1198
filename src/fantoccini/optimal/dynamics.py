"""Where intervals lead, and the derivatives of their ends: the dynamics of optimal control.

    z_{i+1} = A_i z_i + B_i u_i + e_i,   e_i = F(x_i, acc_i) - x_{i+1}

An interval is made of time steps; all intervals are made at once, in lanes and on threads. A and B
are products of the steps' derivatives:

    X <- F_D X + F_K K + F_a,   K <- A_K K + B_K
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array, Mask, MaskRows
from fantoccini.marionette import Marionette
from fantoccini.optimal.nodes import Nodes


@dataclass(frozen=True, eq=False)
class Ends:
    """Where N intervals lead.

    Attributes:
        e: (N, n_z) the changes that move the nodes there.
        tension: (N, n_rows) in the first step of every interval [N or N m].
        taut: (N, n_rows) which rows are held in the first steps.
        settled: (N,) whether all steps were made.
    """

    e: Array
    tension: Array
    taut: MaskRows
    settled: Mask


@dataclass(frozen=True, eq=False)
class LinearEnds(Ends):
    """The same with derivatives.

    Attributes:
        A: (N, n_z, n_z) by the state at the start of an interval.
        B: (N, n_z, n_vK) by its accelerations.
        pull: (N, n_rows, n_z + n_vK) derivatives of the tensions.
        later: (N, n_z) derivatives of the ends by the length of the intervals.
    """

    A: Array
    B: Array
    pull: Array
    later: Array


@dataclass(frozen=True)
class TimeSteps:
    """Intervals of time steps.

    Attributes:
        marionette: the puppet.
        dt: the longest step [s].
        threads: that share the work; as many as there are processors when None.
    """

    marionette: Marionette
    dt: float
    threads: int | None = None

    def steps(self, interval: float) -> tuple[int, float]:
        """How many steps an interval has, and their length [s]."""
        n = max(1, round(interval / self.dt + 0.499999))
        return n, interval / n

    def linearise(self, nodes: Nodes) -> LinearEnds:
        """Where the intervals lead, with derivatives."""
        table, N = self.marionette.coordinates, len(nodes)
        n, k = table.n_vD, table.n_vK
        m, dt = self.steps(nodes.interval)
        x = (nodes.q_D[:-1], nodes.v_D[:-1], nodes.q_K[:-1], nodes.v_K[:-1])
        settled = np.ones(N, dtype=bool)
        for j in range(m):
            v_before = x[1]
            one = self.marionette.linearise_steps(
                *x, nodes.acc_K, dt=dt, pull=j == 0, threads=self.threads
            )
            x = (one.q_D, one.v_D, one.q_K, one.v_K)
            settled &= one.settled
            by_D, by_K, by_a = np.split(one.motion[..., : 2 * n + 3 * k], [2 * n, 2 * n + 2 * k], 2)
            K = one.driven
            if j == 0:
                assert one.pull is not None
                tension, taut, pull = one.tension, one.held, one.pull[..., : 2 * n + 3 * k]
                X = one.motion[..., : 2 * n + 3 * k].copy()
                whole = np.broadcast_to(K, (N, *K.shape[1:])).copy()
                continue
            X = by_D @ X
            X[..., 2 * n :] += by_K @ whole
            X[..., 2 * n + 2 * k :] += by_a
            whole = K[..., : 2 * k] @ whole
            whole[..., 2 * k :] += K[..., 2 * k :]
        A, B = np.zeros((N, nodes.n_z, nodes.n_z)), np.zeros((N, nodes.n_z, k))
        A[:, : 2 * n], B[:, : 2 * n] = X[..., : 2 * n + 2 * k], X[..., 2 * n + 2 * k :]
        A[:, 2 * n :, 2 * n :], B[:, 2 * n :] = whole[..., : 2 * k], whole[..., 2 * k :]
        later = np.concatenate([x[1], (x[1] - v_before) / dt, x[3], nodes.acc_K], axis=1)
        return LinearEnds(nodes.between(*x), tension, taut, settled, A, B, pull, later)
