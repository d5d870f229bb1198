"""Rows of the forces that drive coordinates, just after the nodes.

    low <= f_K <= high,   f_K = M_KD acc_D + M_KK acc_K + c_K - A_K^T lambda

The accelerations acc_D and the tensions hang on the state and the inputs as well:

    df_K = f_K(x + dx, acc_K + du, acc_D + acc (dx, du), tension + pull (dx, du)) - f_K
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, Indices, StateError
from fantoccini.control.optimal.dynamics import Ends, LinearEnds
from fantoccini.control.tasks import Chosen, Nodes, Task
from fantoccini.dynamics.marionette import Marionette

_STEP = 1e-6
"""Of differences [m, rad and their rates]."""
_ROUNDING = 1e-12
"""Of times [s]."""


class ForceRows:
    """The forces of a task that have bounds.

    Attributes:
        names: of the driven velocities.
        low, high: (m,) their bounds [N or N m].

    Args:
        task: see :class:`Task`.
        chosen: parameters along with the motion.
        c: of its constants, those that programs have.
    """

    def __init__(self, task: Task, chosen: Chosen, c: Indices):
        self._columns, self.low, self.high = task.bounds.forces(task.marionette)
        self.names = tuple(task.bounds.force)
        self._chosen, self._c = chosen, c

    def __len__(self) -> int:
        return len(self._columns)

    def value(self, nodes: Nodes, ends: Ends) -> Array:
        """(N, m) [N or N m].

        Raises:
            StateError: the nodes are those of no run.
        """
        if not len(self):
            return np.zeros((len(nodes), 0))
        marionette, still = self._chosen.marionette(nodes.parameters), np.zeros((1, nodes.n_z))
        acc_D, u = _accelerations(nodes), np.zeros((1, nodes.acc_K.shape[1]))
        return self._at(marionette, nodes, still, u, acc_D, ends.tension)[0]

    def by(self, nodes: Nodes, linear: LinearEnds) -> Array:
        """(N, m, n_z + n_c + n_vK) derivatives by the state, constants and accelerations."""
        N, n_z, k = len(nodes), nodes.n_z, nodes.acc_K.shape[1]
        n_c = linear.B.shape[1] - n_z
        out = np.zeros((N, len(self), n_z + n_c + k))
        if not len(self):
            return out
        acc_D = _accelerations(nodes)
        moves = np.concatenate([np.arange(n_z), n_z + n_c + np.arange(k)])
        way = _STEP * np.eye(n_z + k)
        # (n, N, ...) of the directions of all moves
        acc, pull = (np.moveaxis(a[..., moves], 2, 0) for a in (linear.acc, linear.pull))
        marionette = self._chosen.marionette(nodes.parameters)
        ends = [
            self._at(
                marionette,
                nodes,
                sign * way[:, :n_z],
                sign * way[:, n_z:],
                acc_D + sign * _STEP * acc,
                linear.tension + sign * _STEP * pull,
            )
            for sign in (-1.0, 1.0)
        ]
        out[..., moves] = np.moveaxis(ends[1] - ends[0], 0, 2) / (2.0 * _STEP)
        neighbours = self._chosen.neighbours(nodes.parameters)
        still, u = np.zeros((1, n_z)), np.zeros((1, k))
        for j, i in enumerate(self._c):
            if i == 0:  # the length of intervals does not change what is at a node
                continue
            found = [
                self._at(
                    self._chosen.marionette(p),
                    nodes,
                    still,
                    u,
                    acc_D + (p[i - 1] - nodes.parameters[i - 1]) * linear.acc[..., n_z + j],
                    linear.tension
                    + (p[i - 1] - nodes.parameters[i - 1]) * linear.pull[..., n_z + j],
                )[0]
                for p in neighbours[i - 1]
            ]
            below, above = neighbours[i - 1]
            out[..., n_z + j] = (found[1] - found[0]) / (above[i - 1] - below[i - 1])
        return out

    def _at(
        self, marionette: Marionette, nodes: Nodes, z: Array, u: Array, acc_D: Array, tension: Array
    ) -> Array:
        """(n, N, m) forces where states and accelerations are changed by n rows z and u."""
        lead = (len(z), len(nodes))
        parts = (*nodes.states(z), acc_D, nodes.acc_K + u[:, None], tension)
        given = [np.broadcast_to(a, (*lead, a.shape[-1])) for a in parts]
        return np.asarray(marionette.effort(*given)[..., self._columns])


def _accelerations(nodes: Nodes) -> Array:
    """(N, n_vD) accelerations just after the nodes."""
    run = nodes.run
    if run is None:
        raise StateError("bounds of forces want the motion of a run")
    at = np.searchsorted(run.t, nodes.t[:-1] + _ROUNDING, side="right") - 1
    return np.asarray(run.acc_D[at])
