"""Rows of a motion: bounds that may be violated at a price.

low <= r_i(u_{i-1}, z_i, u_i, z_{i+1}) <= high

u_i are the driven accelerations in interval i, z_i and z_{i+1} the changes of the states at its
ends. A row is here a number r of the motion with its bounds, such as a tension. In names, D stands
for dynamic coordinates, which move by the equations of motion. A node is a time at which the inputs
may change, with its state; an interval leads to the next node.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.control.optimal.clear_rows import ClearanceRows
from fantoccini.control.optimal.dynamics import Ends, LinearEnds
from fantoccini.control.optimal.force_rows import ForceRows
from fantoccini.control.optimal.motor_rows import MotorRows
from fantoccini.control.tasks import (
    KEEP_OFF,
    ChosenParameters,
    Nodes,
    Task,
    TouchRules,
    entry_names,
)

_BOUND_TOLERANCE = 1e-3
"""Distance of a tension, force or voltage at its bound, relative to the largest such value."""
_MIN_PULL = 1e-9
"""Smallest such value [N, N m, V or A]."""


class Rows:
    """The rows of a task: tensions with bounds, then jerks, joints, forces, motors, clearances.

    Attributes:
        clearances: the rows of clearances.
        joint_indices: indices of the dynamic coordinates in z.
        joint_low, joint_high: bounds of these coordinates.

    Args:
        task: see :class:`Task`.
        free_parameters: the parameters chosen along with the motion.
        constant_indices: indices of the motion's constants that are variables of programs.
    """

    def __init__(self, task: Task, free_parameters: ChosenParameters, constant_indices: Indices):
        marionette = task.marionette
        self._table, self._row_names = marionette.coordinates, marionette.tree.row_names
        n = marionette.coordinates.n_vD
        self._tension_rows, self._tension_low, self._tension_high = task.bounds.tensions(marionette)
        self._jerk = task.bounds.magnitudes(marionette, "jerk")
        self._jerk_inputs = np.flatnonzero(np.isfinite(self._jerk) & (self._jerk > 0.0))
        low, high = task.bounds.intervals(marionette)
        bounded = np.isfinite(low[: 2 * n]) | np.isfinite(high[: 2 * n])
        self.joint_indices = np.flatnonzero(bounded)
        self.joint_low, self.joint_high = low[self.joint_indices], high[self.joint_indices]
        self._forces = ForceRows(task, free_parameters, constant_indices)
        self._motors = MotorRows(task, free_parameters, constant_indices)
        clearance = task.bounds.clearance
        if clearance is None and task.obstacles:
            clearance = 0.0  # as plans do
        self.clearances: ClearanceRows | None = None
        if clearance is not None:
            self.clearances = _clearance_rows(task, clearance)

    @property
    def names(self) -> list[tuple[str, int]]:
        """(m,) name of each bounded quantity, at the first (0) or last (1) node of the interval."""
        inputs, rows = self._table.v_K, self._row_names
        motors = [(name, later) for later in (0, 1) for name in self._motors.names]
        return [
            *((f"the tension of {rows[i]}", 0) for i in self._tension_rows),
            *((f"the change of the acceleration of {inputs[j]}", 0) for j in self._jerk_inputs),
            *((entry_names(self._table)[z], 1) for z in self.joint_indices),
            *((f"the force on {name}", 0) for name in self._forces.names),
            *motors,
            *(
                (f"the clearance of {name}", 1)
                for name in (self.clearances.names if self.clearances else ())
            ),
        ]

    def values(self, nodes: Nodes, ends: Ends) -> tuple[Array, Array, Array]:
        """(N, m) values of the rows, and their (m,) bounds."""
        jumps = np.diff(nodes.acc_K, axis=0, prepend=0.0)[:, self._jerk_inputs]
        max_jump = self._jerk[self._jerk_inputs] * nodes.interval
        numbers = nodes.scalars[1:, self.joint_indices]
        force = self._forces.value(nodes, ends)
        parts = [
            ends.tension[:, self._tension_rows],
            jumps,
            numbers,
            force,
            self._motors.value(nodes),
        ]
        value, motor_bounds = np.concatenate(parts, axis=1), self._motors.max_values
        low = np.concatenate(
            [self._tension_low, -max_jump, self.joint_low, self._forces.low, -motor_bounds]
        )
        high = np.concatenate(
            [self._tension_high, max_jump, self.joint_high, self._forces.high, motor_bounds]
        )
        if self.clearances:
            value = np.concatenate([value, self.clearances.value(nodes)], axis=1)
            low = np.append(low, np.full(len(self.clearances), self.clearances.margin))
            high = np.append(high, np.full(len(self.clearances), np.inf))
        return value, low, high

    def violation(self, nodes: Nodes, ends: Ends) -> Array:
        """(N, m) violations of the bounds."""
        value, low, high = self.values(nodes, ends)
        return np.maximum(np.maximum(low - value, value - high), 0.0)

    def derivatives(self, nodes: Nodes, linear: LinearEnds) -> Array:
        """(N, m, 2 (n_vK + n_z)) derivatives by (u_{i-1}, z_i, u_i, z_{i+1})."""
        N, n_z, k = linear.B.shape
        n_taut = len(self._tension_rows)
        n_jerks = len(self._jerk_inputs)
        n_joints = len(self.joint_indices)
        s, n_clear = k + n_z, len(self.clearances) if self.clearances else 0
        force_start = n_taut + n_jerks + n_joints
        motor_start = force_start + len(self._forces)
        derivatives = np.zeros((N, motor_start + len(self._motors) + n_clear, 2 * s))
        derivatives[:, :n_taut, k : s + k] = linear.dtension[:, self._tension_rows]
        row = n_taut + np.arange(n_jerks)
        derivatives[:, row, self._jerk_inputs] = -1.0
        derivatives[:, row, s + self._jerk_inputs] = 1.0
        derivatives[:, n_taut + n_jerks + np.arange(n_joints), s + k + self.joint_indices] = 1.0
        derivatives[:, force_start:motor_start, k : s + k] = self._forces.derivatives(nodes, linear)
        derivatives[:, motor_start : motor_start + len(self._motors), k:] = (
            self._motors.derivatives(nodes, n_z - nodes.n_z)
        )
        if self.clearances:
            derivatives[:, -n_clear:, s + k : s + k + nodes.n_z] = self.clearances.derivatives(
                nodes
            )
        return derivatives

    def has_active_force_bound(self, nodes: Nodes, ends: Ends) -> bool:
        """Whether a tension, a force or a motor is at one of its bounds, or beyond.

        A lower bound of 0 for a tension does not count: every slack string is at it.
        """
        value, low, high = self.values(nodes, ends)
        low[: len(self._tension_rows)][self._tension_low <= 0.0] = -np.inf
        force_start = len(self._tension_rows) + len(self._jerk_inputs) + len(self.joint_indices)
        n_drives = len(self._forces) + len(self._motors)
        columns = [*range(len(self._tension_rows)), *range(force_start, force_start + n_drives)]
        value, low, high = value[:, columns], low[columns], high[columns]
        tolerance = _BOUND_TOLERANCE * np.maximum(
            np.max(np.abs(value), axis=0, initial=0.0), _MIN_PULL
        )
        return bool(np.any((value <= low + tolerance) | (value >= high - tolerance)))

    def n_slack(self, ends: Ends) -> int:
        """Number of slack strings that must be taut, summed over all nodes."""
        return int(np.sum((ends.tension[:, self._tension_rows] == 0.0) & (self._tension_low > 0.0)))


def _clearance_rows(task: Task, margin: float) -> ClearanceRows | None:
    """The rows that keep a margin [m]; None if there is nothing to keep clear of."""
    marionette, self_collision, conditions = task.marionette, task.bounds.own_body, task.conditions
    allowed_pairs: frozenset[frozenset[str]] = frozenset()
    if conditions.contact != KEEP_OFF:
        allowed_pairs = TouchRules(
            marionette, conditions.contact, self_collision=self_collision
        ).allowed_pairs
    rows = ClearanceRows(
        marionette,
        margin,
        self_collision,
        task.obstacles,
        strings=conditions.rollouts.strings,
        allowed_pairs=allowed_pairs,
    )
    return rows if len(rows) else None
