"""Required final states of motions, in whole or in part.

z = (dq_D, dv_D, dq_K, dv_K) is a change of a state: of dynamic coordinates and velocities, then of
driven ones. n_vD and n_vK are the numbers of velocities.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Mask
from fantoccini.control.tasks.goals import Goal
from fantoccini.control.tasks.nodes import Nodes
from fantoccini.control.tasks.touch import Touch
from fantoccini.kernel.runtime import POINT, POSE
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import State


@dataclass(frozen=True, eq=False)
class End:
    """The required end of a motion: all or some of the numbers of its last state.

    Attributes:
        state: a state with these numbers.
        required: (n_z,) bool, the entries of z = (dq_D, dv_D, dq_K, dv_K) that are required.
        places: places that points of bodies must reach at the end.
    """

    state: State
    required: Mask
    places: tuple[Touch, ...] = ()

    @classmethod
    def full_state(cls, table: CoordinateTable, state: State) -> End:
        """The end that requires a whole state, driven coordinates and velocities included."""
        return cls(state, np.ones(2 * (table.n_vD + table.n_vK), dtype=bool))

    @classmethod
    def of_goal(cls, goal: Goal, x0: State, latest_time: float) -> End | None:
        """The end at a goal's pose or place; None for any other goal, such as an interval.

        Velocities that the goal weights are required, too: dynamic and driven ones separately.

        Args:
            goal: goal of a plan.
            x0: start of the motion, for the numbers that are not required.
            latest_time: the latest end of the motion [s].
        """
        numbers, table = goal.numbers, goal.marionette.coordinates
        if goal.function is not None or goal.touches or numbers.kind not in (POSE, POINT):
            return None
        n, k = table.n_vD, table.n_vK
        required = np.zeros(2 * (n + k), dtype=bool)
        required[n : 2 * n] = numbers.speed_weight > 0.0
        required[2 * n + k :] = numbers.driven_weight > 0.0
        state = x0.replace(v_D=numbers.v_D, v_K=numbers.v_K)
        if numbers.kind == POINT:
            if not np.array_equal(numbers.place, numbers.place_high):
                return None
            body = goal.marionette.tree.links[numbers.link].name
            # The window holds only the last moment; for shorter motions it moves to their end.
            between = (math.nextafter(latest_time, x0.t), math.inf)
            x, y, z = map(float, numbers.at)
            return cls(state, required, (Touch(body, numbers.place, (x, y, z), between),))
        if not np.array_equal(numbers.low, numbers.high):
            return None
        required[:n] = numbers.weight > 0.0
        for _, v in table.quaternions_D:  # their weight is that of the first velocity
            required[v : v + 3] = required[v]
        return cls(state.replace(q_D=numbers.low), required)

    def gap(self, nodes: Nodes) -> Array:
        """(n_z,) change from the last node to the end; 0 for entries that are not required."""
        return np.where(self.required, nodes.end_change_to(self.state), 0.0)
