"""Rows for the voltages and currents of dc motors, at the beginning and end of intervals.

    |R i + k n v| <= voltage,  |i| <= current,   i = f / (n k)

f is the force that the controller asks for (:mod:`fantoccini.kernel.equations.drives`), and v the
velocity of its coordinate. A motor within its own limits exerts this force. Beyond them its voltage
stays at a limit whatever the motion; the requested force then still shows the way back. f depends
only on the state and the commands' accelerations. As accelerations jump at nodes, each interval has
two rows,

    just after node i:  r(z_i, acc_i),   just before node i + 1:  r(z_{i+1}, acc_i)

A row is a condition on a number of the motion. R is the resistance, k the motor constant, n the
gear ratio and i the current of a motor. A drive moves a driven coordinate by such a motor towards
its command; acc_i are the accelerations of commands and driven coordinates in interval i. In names,
D stands for dynamic coordinates, which move by the equations of motion.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.control.tasks import ChosenParameters, Nodes, Task
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import DirectCurrent
from fantoccini.model.tree import DriveRow

_DIFFERENCE = 1e-6
"""Step of finite differences [m, rad and their rates]."""


class MotorRows:
    """Rows for the voltages and currents with bounds in a task.

    Attributes:
        names: (m / 2,) names of the quantities.
        max_values: (m,) their largest magnitudes, at the beginning of intervals, then at the end
            [V or A].

    Args:
        task: see :class:`Task`.
        free_parameters: the parameters chosen along with the motion.
        constant_indices: indices of the motion's constants that are variables of programs.
    """

    def __init__(self, task: Task, free_parameters: ChosenParameters, constant_indices: Indices):
        voltages, volts = task.bounds.motors(task.marionette, "voltage")
        currents, amperes = task.bounds.motors(task.marionette, "current")
        self._drives, self._n_voltages = [*voltages, *currents], len(voltages)
        self.max_values = np.tile(np.concatenate([volts, amperes]), 2)
        inputs = task.marionette.coordinates.v_K
        self.names = [
            f"the {kind} of {inputs[drive.command[1]]}"
            for kind, drives in (("voltage", voltages), ("current", currents))
            for drive in drives
            if drive.command is not None
        ]
        self._free_parameters, self._constant_indices = free_parameters, constant_indices

    def __len__(self) -> int:
        return len(self.max_values)

    def value(self, nodes: Nodes) -> Array:
        """(N, m) voltages and currents [V or A]."""
        return self._values(self._free_parameters.marionette(nodes.parameters), nodes)

    def derivatives(self, nodes: Nodes, n_c: int) -> Array:
        """(N, m, n_z + n_c + n_vK + n_z + n_c) derivatives by z_i, acc_i and z_{i+1}.

        Args:
            nodes: the motion.
            n_c: number of constants that follow the numbers of a state.
        """
        N, n_z, k, m = len(nodes), nodes.n_z, nodes.acc_K.shape[1], len(self._drives)
        derivatives = np.zeros((N, len(self), 2 * (n_z + n_c) + k))
        if not m:
            return derivatives
        marionette, n_s = self._free_parameters.marionette(nodes.parameters), n_z + n_c
        steps = _DIFFERENCE * np.eye(n_z + k)
        neighbours = self._free_parameters.neighbours(nodes.parameters)
        for node_offset, rows, first_column in ((0, slice(m), 0), (1, slice(m, 2 * m), n_s + k)):
            below, above = (
                self._changed_values(
                    marionette, nodes, node_offset, sign * steps[:, :n_z], sign * steps[:, n_z:]
                )
                for sign in (-1.0, 1.0)
            )
            columns = np.concatenate([first_column + np.arange(n_z), n_s + np.arange(k)])
            derivatives[:, rows, columns] = np.moveaxis(above - below, 0, 2) / (2.0 * _DIFFERENCE)
        for j, i in enumerate(self._constant_indices):
            if i == 0:  # the length of intervals does not affect the values at a node
                continue
            below, above = neighbours[i - 1]
            change = self._values(self._free_parameters.marionette(above), nodes)
            change -= self._values(self._free_parameters.marionette(below), nodes)
            change /= above[i - 1] - below[i - 1]
            derivatives[:, :m, n_z + j], derivatives[:, m:, n_s + k + n_z + j] = (
                change[:, :m],
                change[:, m:],
            )
        return derivatives

    def _values(self, marionette: Marionette, nodes: Nodes) -> Array:
        """(N, m) values for one puppet."""
        if not self._drives:
            return np.zeros((len(nodes), 0))
        z, u = np.zeros((1, nodes.n_z)), np.zeros((1, nodes.acc_K.shape[1]))
        values = [
            self._changed_values(marionette, nodes, node_offset, z, u)[0] for node_offset in (0, 1)
        ]
        return np.concatenate(values, axis=1)

    def _changed_values(
        self, marionette: Marionette, nodes: Nodes, node_offset: int, z: Array, u: Array
    ) -> Array:
        """(n, N, m / 2) values for n changes z and u of states and accelerations."""
        q_D, v_D, q_K, v_K = nodes.perturbed_states(z, node_offset)
        force = marionette.library.evaluate(
            "motor_demands",
            q_D=q_D,
            v_D=v_D,
            q_K=q_K,
            v_K=v_K,
            acc_K=nodes.acc_K + u[:, None],
            p=marionette.p,
        ).f_D
        values = [
            _motor_value(marionette, drive, force, v_D, j < self._n_voltages)
            for j, drive in enumerate(self._drives)
        ]
        return np.stack(values, axis=-1)


def _motor_value(
    marionette: Marionette, row: DriveRow, force: Array, v_D: Array, is_voltage: bool
) -> Array:
    """(...) R i + k n v, or the current i, of a drive's motor [V or A]."""
    motor, number = row.drive.motor, marionette.number
    assert isinstance(motor, DirectCurrent), "has no such bound"
    gain = row.ratio(number) * number(motor.constant)
    current = force[..., row.v.start] / gain
    if not is_voltage:
        return current
    return number(motor.resistance) * current + gain * v_D[..., row.v.start]
