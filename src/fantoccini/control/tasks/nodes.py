"""Motions on a grid of times: states at nodes, constant accelerations of the inputs between them.

A change of a state is a tangent vector z = (dq_D, dv_D, dq_K, dv_K), with rotation vectors.

D stands for the dynamic coordinates, K for the driven ones (ends and lengths of strings); acc_K are
the accelerations of the latter, constant in each interval. A node is an end of an interval.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fantoccini.base import Array, Times, tangent
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import Input, State, Trajectory

_ROUNDING = 1e-9
"""Time by which a node may follow the end of an input and still have its velocity [s]."""


@dataclass(frozen=True, eq=False)
class Nodes:
    """N intervals of equal length, and the N + 1 states at their ends.

    Attributes:
        table: the puppet's coordinates.
        start: time of the first node [s].
        interval: length of an interval [s].
        q_D, v_D, q_K, v_K: (N + 1, ...) states at the nodes.
        acc_K: (N, n_vK) accelerations of the driven coordinates.
        parameters: (n_p,) values of the chosen parameters.
        run: the run through the nodes, if they belong to one.
        moments: times near which touches are searched for [s].
    """

    table: CoordinateTable
    start: float
    interval: float
    q_D: Array
    v_D: Array
    q_K: Array
    v_K: Array
    acc_K: Array
    parameters: Array = field(default_factory=lambda: np.zeros(0))
    run: Trajectory | None = None
    moments: Times | None = None

    @classmethod
    def constant(cls, marionette: Marionette, x0: State, duration: float, n: int) -> Nodes:
        """The state x0 at every node, with inputs of constant velocity."""
        table, h = marionette.coordinates, duration / n
        states: dict[str, Any] = {
            name: np.repeat(getattr(x0, name)[None], n + 1, axis=0)
            for name in ("q_D", "v_D", "q_K", "v_K")
        }
        displacement = (h * np.arange(n + 1))[:, None] * x0.v_K
        states["q_K"] = tangent.moved(
            table.scalars_K, table.quaternions_K, states["q_K"], displacement
        )
        return cls(table, x0.t, h, **states, acc_K=np.zeros((n, table.n_vK)))

    @classmethod
    def from_input(
        cls, marionette: Marionette, x0: State, inputs: Input, duration: float, n: int
    ) -> Nodes:
        """The state x0 at every node, with accelerations from the velocities of an input.

        Beyond the input's end the driven coordinates stand still.
        """
        nodes = cls.constant(marionette, x0, duration, n)
        bound = inputs.bound(x0.q_K, x0.t)
        times = np.clip(nodes.t, bound.start, bound.end)
        v_K = bound.evaluate(times)[1]
        v_K[nodes.t > bound.end + _ROUNDING] = 0.0
        v_K[0] = x0.v_K
        return replace(nodes, acc_K=np.diff(v_K, axis=0) / nodes.interval)

    def __len__(self) -> int:
        """Number of intervals."""
        return len(self.acc_K)

    @property
    def t(self) -> Times:
        """(N + 1,) times of the nodes [s]."""
        return np.asarray(self.start + self.interval * np.arange(len(self) + 1))

    @property
    def n_z(self) -> int:
        """Length of a tangent vector z."""
        return 2 * (self.table.n_vD + self.table.n_vK)

    def after_step(self, z: Array, u: Array, c: Array | None = None) -> Nodes:
        """The nodes moved by tangent vectors z (N + 1, n_z), the accelerations by u (N, n_vK).

        c[0] is added to the length of every interval, the rest of c to the parameters.
        """
        table, c = self.table, np.zeros(1 + len(self.parameters)) if c is None else c
        dq_D, dv_D, dq_K, dv_K = np.split(z, self.splits, axis=1)
        return replace(
            self,
            q_D=tangent.moved(table.scalars_D, table.quaternions_D, self.q_D, dq_D),
            v_D=self.v_D + dv_D,
            q_K=tangent.moved(table.scalars_K, table.quaternions_K, self.q_K, dq_K),
            v_K=self.v_K + dv_K,
            acc_K=self.acc_K + u,
            interval=self.interval + float(c[0]),
            parameters=self.parameters + c[1:],
            run=None,
        )

    def perturbed_states(self, z: Array, node_offset: int = 0) -> tuple[Array, Array, Array, Array]:
        """(n, N, ...) q_D, v_D, q_K, v_K of N nodes, changed by n tangent vectors.

        Args:
            z: (n, n_z) changes, each of all nodes.
            node_offset: 0 for the nodes at which intervals begin, 1 for those at which they end.
        """
        table, rows = self.table, slice(node_offset, node_offset + len(self))
        dq_D, dv_D, dq_K, dv_K = np.split(z[:, None], self.splits, axis=2)
        return (
            tangent.moved(table.scalars_D, table.quaternions_D, self.q_D[rows], dq_D),
            self.v_D[rows] + dv_D,
            tangent.moved(table.scalars_K, table.quaternions_K, self.q_K[rows], dq_K),
            self.v_K[rows] + dv_K,
        )

    def changes_to(
        self, q_D: Array, v_D: Array, q_K: Array, v_K: Array, first_node: int = 1
    ) -> Array:
        """(N + 1 - first_node, n_z) changes from the nodes from `first_node` on to these states."""
        table, n, k = self.table, self.table.n_vD, self.table.n_vK
        dq_D = tangent.between(table.scalars_D, table.quaternions_D, self.q_D[first_node:], q_D, n)
        dq_K = tangent.between(table.scalars_K, table.quaternions_K, self.q_K[first_node:], q_K, k)
        parts = [dq_D, v_D - self.v_D[first_node:], dq_K, v_K - self.v_K[first_node:]]
        return np.concatenate(parts, axis=1)

    def end_change_to(self, x: State) -> Array:
        """(n_z,) change from the last node to a state."""
        parts = (np.asarray(a)[None] for a in (x.q_D, x.v_D, x.q_K, x.v_K))
        q_D, v_D, q_K, v_K = parts
        return np.asarray(self.changes_to(q_D, v_D, q_K, v_K, first_node=len(self))[0])

    @property
    def scalars(self) -> Array:
        """(N + 1, n_z) scalar coordinates and velocities in the order of z; 0 for rotations."""
        table = self.table
        n, k = table.n_vD, table.n_vK
        scalars = np.zeros((len(self) + 1, self.n_z))
        for q, v in table.scalars_D:
            scalars[:, v] = self.q_D[:, q]
        for q, v in table.scalars_K:
            scalars[:, 2 * n + v] = self.q_K[:, q]
        scalars[:, n : 2 * n], scalars[:, 2 * n + k :] = self.v_D, self.v_K
        return scalars

    @property
    def splits(self) -> list[int]:
        """Indices at which v_D, q_K and v_K begin in z."""
        n, k = self.table.n_vD, self.table.n_vK
        return [n, 2 * n, 2 * n + k]

    def inputs(self) -> Input:
        """The motion of the driven coordinates."""
        return Input.segments(self.table, self.t, self.q_K[0], self.v_K[0], self.acc_K)

    def refined(self, factor: int) -> Nodes:
        """The same accelerations in shorter intervals; new nodes repeat the previous state."""
        index = np.append(np.repeat(np.arange(len(self)), factor), len(self))
        states = {name: getattr(self, name)[index] for name in ("q_D", "v_D", "q_K", "v_K")}
        acc_K = np.repeat(self.acc_K, factor, axis=0)
        interval = self.interval / factor
        return replace(self, interval=interval, acc_K=acc_K, run=None, **states)


def entry_names(table: CoordinateTable) -> list[str]:
    """(n_z,) names of the entries of z = (dq_D, dv_D, dq_K, dv_K)."""
    D, K = list(table.v_D), list(table.v_K)
    return [*D, *(f"the speed of {v}" for v in D), *K, *(f"the speed of {v}" for v in K)]
