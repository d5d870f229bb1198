"""Rows for the forces that drive coordinates, just after the nodes.

    low <= f_K <= high,   f_K = M_KD acc_D + M_KK acc_K + c_K - A_K^T lambda

The accelerations acc_D and the tensions depend on the state and the inputs, too:

    df_K = f_K(x + dx, acc_K + du, acc_D + acc (dx, du), tension + pull (dx, du)) - f_K

A row is a condition on a number of the motion. D stands for dynamic and K for driven coordinates; M
is the inertia matrix, c the bias (Coriolis forces, gravity), A_K the derivative of string lengths
by driven coordinates, and lambda minus the tension. u = acc_K are the inputs.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, Indices, StateError
from fantoccini.control.optimal.dynamics import Ends, LinearEnds
from fantoccini.control.tasks import ChosenParameters, Nodes, Task
from fantoccini.dynamics.marionette import Marionette

_DIFFERENCE = 1e-6
"""Step of finite differences [m, rad and their rates]."""
_TIME_ROUNDING = 1e-12
"""Rounding error of times [s]."""


class ForceRows:
    """Rows for the forces with bounds in a task.

    Attributes:
        names: names of the driven velocities.
        low, high: (m,) their bounds [N or N m].

    Args:
        task: see :class:`Task`.
        free_parameters: the parameters chosen along with the motion.
        constant_indices: indices of the motion's constants that are variables of programs.
    """

    def __init__(self, task: Task, free_parameters: ChosenParameters, constant_indices: Indices):
        self._columns, self.low, self.high = task.bounds.forces(task.marionette)
        self.names = tuple(task.bounds.force)
        self._free_parameters, self._constant_indices = free_parameters, constant_indices

    def __len__(self) -> int:
        return len(self._columns)

    def value(self, nodes: Nodes, forces_at_steps: Ends) -> Array:
        """(N, m) forces [N or N m].

        Raises:
            StateError: nodes that do not belong to a run.
        """
        if not len(self):
            return np.zeros((len(nodes), 0))
        marionette = self._free_parameters.marionette(nodes.parameters)
        zeros = np.zeros((1, nodes.n_z))
        acc_D, u = _accelerations(nodes), np.zeros((1, nodes.acc_K.shape[1]))
        return self._changed_values(marionette, nodes, zeros, u, acc_D, forces_at_steps.tension)[0]

    def derivatives(self, nodes: Nodes, linear: LinearEnds) -> Array:
        """(N, m, n_z + n_c + n_vK) derivatives by the state, constants and accelerations."""
        N, n_z, k = len(nodes), nodes.n_z, nodes.acc_K.shape[1]
        n_c = linear.B.shape[1] - n_z
        derivatives = np.zeros((N, len(self), n_z + n_c + k))
        if not len(self):
            return derivatives
        acc_D = _accelerations(nodes)
        columns = np.concatenate([np.arange(n_z), n_z + n_c + np.arange(k)])
        steps = _DIFFERENCE * np.eye(n_z + k)
        # (n, N, ...) for all directions
        dacc, dtension = (
            np.moveaxis(array[..., columns], 2, 0) for array in (linear.dacc, linear.dtension)
        )
        marionette = self._free_parameters.marionette(nodes.parameters)
        forces_at_steps = [
            self._changed_values(
                marionette,
                nodes,
                sign * steps[:, :n_z],
                sign * steps[:, n_z:],
                acc_D + sign * _DIFFERENCE * dacc,
                linear.tension + sign * _DIFFERENCE * dtension,
            )
            for sign in (-1.0, 1.0)
        ]
        derivatives[..., columns] = np.moveaxis(forces_at_steps[1] - forces_at_steps[0], 0, 2) / (
            2.0 * _DIFFERENCE
        )
        neighbours = self._free_parameters.neighbours(nodes.parameters)
        zeros, u = np.zeros((1, n_z)), np.zeros((1, k))
        for j, i in enumerate(self._constant_indices):
            if i == 0:  # the length of intervals does not affect the values at a node
                continue
            forces = [
                self._changed_values(
                    self._free_parameters.marionette(p),
                    nodes,
                    zeros,
                    u,
                    acc_D + (p[i - 1] - nodes.parameters[i - 1]) * linear.dacc[..., n_z + j],
                    linear.tension
                    + (p[i - 1] - nodes.parameters[i - 1]) * linear.dtension[..., n_z + j],
                )[0]
                for p in neighbours[i - 1]
            ]
            below, above = neighbours[i - 1]
            derivatives[..., n_z + j] = (forces[1] - forces[0]) / (above[i - 1] - below[i - 1])
        return derivatives

    def _changed_values(
        self, marionette: Marionette, nodes: Nodes, z: Array, u: Array, acc_D: Array, tension: Array
    ) -> Array:
        """(n, N, m) forces for n changes z and u of states and accelerations."""
        shape = (len(z), len(nodes))
        parts = (*nodes.perturbed_states(z), acc_D, nodes.acc_K + u[:, None], tension)
        arguments = [np.broadcast_to(array, (*shape, array.shape[-1])) for array in parts]
        return np.asarray(marionette.effort(*arguments)[..., self._columns])


def _accelerations(nodes: Nodes) -> Array:
    """(N, n_vD) accelerations just after the nodes."""
    run = nodes.run
    if run is None:
        raise StateError("bounds of forces need nodes of a run")
    index = np.searchsorted(run.t, nodes.t[:-1] + _TIME_ROUNDING, side="right") - 1
    return np.asarray(run.acc_D[index])
