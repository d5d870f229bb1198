"""Required final states of motions, in whole or in part.

z = (dq_D, dv_D, dq_K, dv_K) is a change of a state: of dynamic coordinates and velocities, then of
driven ones. n_vD and n_vK are the numbers of velocities.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Mask
from fantoccini.control.tasks.goals import Goal
from fantoccini.control.tasks.nodes import Nodes
from fantoccini.kernel.runtime import POSE
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import State


@dataclass(frozen=True, eq=False)
class End:
    """The required end of a motion: all or some of the numbers of its last state.

    Attributes:
        state: a state with these numbers.
        required: (n_z,) bool, the entries of z = (dq_D, dv_D, dq_K, dv_K) that are required.
    """

    state: State
    required: Mask

    @classmethod
    def full_state(cls, table: CoordinateTable, state: State) -> End:
        """The end that requires a whole state, driven coordinates and velocities included."""
        return cls(state, np.ones(2 * (table.n_vD + table.n_vK), dtype=bool))

    @classmethod
    def of_goal(cls, goal: Goal, x0: State) -> End | None:
        """The end at a goal's pose; None for goals that do not fix values of coordinates.

        Velocities that the goal weights are required, too: dynamic and driven ones separately.

        Args:
            goal: goal of a plan.
            x0: start of the motion, for the numbers that are not required.
        """
        numbers, table = goal.numbers, goal.marionette.coordinates
        is_pose = numbers.kind == POSE and goal.function is None and not goal.touches
        if not is_pose or not np.array_equal(numbers.low, numbers.high):
            return None
        n, k = table.n_vD, table.n_vK
        required = np.zeros(2 * (n + k), dtype=bool)
        required[:n] = numbers.weight > 0.0
        for _, v in table.quaternions_D:  # their weight is that of the first velocity
            required[v : v + 3] = required[v]
        required[n : 2 * n] = numbers.speed_weight > 0.0
        required[2 * n + k :] = numbers.driven_weight > 0.0
        return cls(x0.replace(q_D=numbers.low, v_D=numbers.v_D, v_K=numbers.v_K), required)

    def gap(self, nodes: Nodes) -> Array:
        """(n_z,) change from the last node to the end; 0 for entries that are not required."""
        return np.where(self.required, nodes.end_change_to(self.state), 0.0)
