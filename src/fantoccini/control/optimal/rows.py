"""Rows of a motion that may be passed at a price: tensions, jerks, joints, forces, motors, gaps.

low <= r_i(u_{i-1}, z_i, u_i, z_{i+1}) <= high
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.control.optimal.clear_rows import ClearRows
from fantoccini.control.optimal.dynamics import Ends, LinearEnds
from fantoccini.control.optimal.force_rows import ForceRows
from fantoccini.control.optimal.motor_rows import MotorRows
from fantoccini.control.tasks import Chosen, Nodes, Task, number_names

_AT_BOUND = 1e-3
"""Distance of a tension, force or voltage from a bound that it is at, relative to its largest."""
_LEAST_PULL = 1e-9
"""Its least size [N, N m, V or A]."""


class Rows:
    """The rows of a task: tensions with bounds, then jerks, joints, forces, motors, clearances.

    Attributes:
        clear: the rows of clearances.
        places: of the dynamic coordinates in z.
        joint_low, joint_high: their bounds.

    Args:
        task: see :class:`Task`.
        chosen: parameters along with the motion.
        c: of its constants, those that programs have.
    """

    def __init__(self, task: Task, chosen: Chosen, c: Indices):
        marionette = task.marionette
        self._table, self._row_names = marionette.coordinates, marionette.tree.row_names
        n = marionette.coordinates.n_vD
        self._taut, self._least, self._most = task.bounds.tensions(marionette)
        self._jerk = task.bounds.magnitudes(marionette, "jerk")
        self._jerks = np.flatnonzero(np.isfinite(self._jerk) & (self._jerk > 0.0))
        low, high = task.bounds.intervals(marionette)
        bounded = np.isfinite(low[: 2 * n]) | np.isfinite(high[: 2 * n])
        self.places = np.flatnonzero(bounded)
        self.joint_low, self.joint_high = low[self.places], high[self.places]
        self._forces = ForceRows(task, chosen, c)
        self._motors = MotorRows(task, chosen, c)
        clearance = task.bounds.clearance
        self.clear = None
        if clearance is not None:
            self.clear = ClearRows(marionette, clearance, task.bounds.own_body, task.obstacles)

    @property
    def names(self) -> list[tuple[str, int]]:
        """(m,) name of each bounded quantity, at the first (0) or last (1) node of the interval."""
        inputs, rows = self._table.v_K, self._row_names
        motors = [(name, later) for later in (0, 1) for name in self._motors.names]
        return [
            *((f"the tension of {rows[i]}", 0) for i in self._taut),
            *((f"the change of the acceleration of {inputs[j]}", 0) for j in self._jerks),
            *((number_names(self._table)[z], 1) for z in self.places),
            *((f"the force on {name}", 0) for name in self._forces.names),
            *motors,
            *((f"the clearance of {name}", 1) for name in (self.clear.names if self.clear else ())),
        ]

    def values(self, nodes: Nodes, ends: Ends) -> tuple[Array, Array, Array]:
        """(N, m) their values, and (m,) their bounds."""
        jumps = np.diff(nodes.acc_K, axis=0, prepend=0.0)[:, self._jerks]
        most = self._jerk[self._jerks] * nodes.interval
        numbers = nodes.numbers[1:, self.places]
        force = self._forces.value(nodes, ends)
        parts = [ends.tension[:, self._taut], jumps, numbers, force, self._motors.value(nodes)]
        value, top = np.concatenate(parts, axis=1), self._motors.most
        low = np.concatenate([self._least, -most, self.joint_low, self._forces.low, -top])
        high = np.concatenate([self._most, most, self.joint_high, self._forces.high, top])
        if self.clear:
            value = np.concatenate([value, self.clear.value(nodes)], axis=1)
            low = np.append(low, np.full(len(self.clear), self.clear.margin))
            high = np.append(high, np.full(len(self.clear), np.inf))
        return value, low, high

    def violation(self, nodes: Nodes, ends: Ends) -> Array:
        """(N, m) how far they are beyond their bounds."""
        value, low, high = self.values(nodes, ends)
        return np.maximum(np.maximum(low - value, value - high), 0.0)

    def by(self, nodes: Nodes, linear: LinearEnds) -> Array:
        """(N, m, 2 (n_vK + n_z)) derivatives by (u_{i-1}, z_i, u_i, z_{i+1})."""
        N, n_z, k = linear.B.shape
        n_taut, n_jerks, n_places = len(self._taut), len(self._jerks), len(self.places)
        s, n_clear = k + n_z, len(self.clear) if self.clear else 0
        first = n_taut + n_jerks + n_places
        last = first + len(self._forces)
        C = np.zeros((N, last + len(self._motors) + n_clear, 2 * s))
        C[:, :n_taut, k : s + k] = linear.pull[:, self._taut]
        row = n_taut + np.arange(n_jerks)
        C[:, row, self._jerks], C[:, row, s + self._jerks] = -1.0, 1.0
        C[:, n_taut + n_jerks + np.arange(n_places), s + k + self.places] = 1.0
        C[:, first:last, k : s + k] = self._forces.by(nodes, linear)
        C[:, last : last + len(self._motors), k:] = self._motors.by(nodes, n_z - nodes.n_z)
        if self.clear:
            C[:, -n_clear:, s + k : s + k + nodes.n_z] = self.clear.by(nodes)
        return C

    def pulls_bind(self, nodes: Nodes, ends: Ends) -> bool:
        """Whether a tension, a force or a motor is at one of its bounds, or beyond.

        A least tension of 0 is none: that is what slack strings have.
        """
        value, low, high = self.values(nodes, ends)
        low[: len(self._taut)][self._least <= 0.0] = -np.inf
        first = len(self._taut) + len(self._jerks) + len(self.places)
        drives = len(self._forces) + len(self._motors)
        at = [*range(len(self._taut)), *range(first, first + drives)]
        value, low, high = value[:, at], low[at], high[at]
        near = _AT_BOUND * np.maximum(np.max(np.abs(value), axis=0, initial=0.0), _LEAST_PULL)
        return bool(np.any((value <= low + near) | (value >= high - near)))

    def n_slack(self, ends: Ends) -> int:
        """How often, over all nodes, a string is slack that is to stay taut."""
        return int(np.sum((ends.tension[:, self._taut] == 0.0) & (self._least > 0.0)))
