"""Plans as paths through a search tree; simulations of plans from their start and inputs.

A node is a state of the tree, and a segment a piece of the plan with constant driven accelerations.
v_K are the driven velocities, n_vK is their number.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fantoccini.base import Array, Indices, StateError, Times
from fantoccini.control.planning.search_tree import SearchTree
from fantoccini.control.problems import Problem, Rollouts
from fantoccini.control.tasks import Goal, StateArrays
from fantoccini.dynamics.compiled import Method, MethodName, TimeStepping, as_method, check_start
from fantoccini.dynamics.simulation import simulate
from fantoccini.motion import Input, State, Trajectory


@dataclass(frozen=True, eq=False)
class PlanPath:
    """A path of m segments through a search tree.

    Attributes:
        problem: the planning problem.
        tree: search tree with the plan.
        path: (m + 1) nodes from the start to the plan's end.
    """

    problem: Problem
    tree: SearchTree
    path: tuple[int, ...]

    @property
    def start(self) -> State:
        """The state at the start of the plan."""
        return self.problem.start

    @property
    def goal(self) -> Goal:
        """The problem's goal."""
        return self.problem.goal

    @property
    def tolerance(self) -> float:
        """Weighted distance from the goal at which it counts as reached."""
        return self.problem.tolerance

    @property
    def rollouts(self) -> Rollouts:
        """The rollouts that simulated the plan's segments."""
        return self.problem.rollouts

    @property
    def times(self) -> Times:
        """(m + 1,) times of the nodes [s]."""
        return self.start.t + self.tree.time[list(self.path)]

    @property
    def states(self) -> StateArrays:
        """(m + 1,) states at the nodes."""
        return self.tree.states[list(self.path)]

    @property
    def n_checks(self) -> Indices:
        """(m,) numbers of checks in the segments."""
        return self.tree.n_checks[list(self.path[1:])]

    @property
    def acceleration(self) -> Array:
        """(m, n_vK) accelerations of the driven coordinates [m/s^2 or rad/s^2]."""
        return self.tree.acceleration[list(self.path[1:])]

    @cached_property
    def inputs(self) -> Input:
        """The driven coordinates: constant accelerations from node to node, then held.

        If the puppet must stay at the goal, they come to rest after the last node. A plan without
        segments lasts one time step.
        """
        start, times, acceleration = self.start, self.times, self.acceleration
        tail_durations, tail_accelerations = self._tail
        times = np.concatenate([times, times[-1] + np.cumsum(tail_durations)])
        acceleration = np.concatenate([acceleration, tail_accelerations])
        if len(times) == 1:
            times = np.append(times, times + self.rollouts.options.dt)
            acceleration = np.zeros((1, len(start.v_K)))
        return Input.segments(self.problem.marionette, times, start.q_K, start.v_K, acceleration)

    @cached_property
    def trajectory(self) -> Trajectory:
        """A run of the plan by the time-stepper, with the planner's step."""
        return self.simulate(TimeStepping(dt=self.rollouts.options.dt, extrapolate=False))

    def simulate(self, method: Method, effort: bool = True) -> Trajectory:
        """A run of the plan, which may stop early.

        Args:
            method: method of the simulation.
            effort: whether to compute the force on every driven coordinate.
        """
        start, end, save_at = exact_start(self.problem, method), self.end, None
        if method.name == "event":
            check_times = np.arange(start.t, end, self.rollouts.options.interval)
            save_at = np.unique(np.minimum(np.append(self.times, check_times), end))
        return simulate(
            self.problem.marionette,
            start,
            self.inputs,
            end,
            method=method,
            save_at=save_at,
            effort=effort,
            throw=False,
        )

    def simulate_in_mujoco(self, dt: float) -> Trajectory:
        """A run of the plan in MuJoCo with a step [s]; see :meth:`PlanResult.verify`."""
        from fantoccini.dynamics.mujoco import mujoco_run

        start = exact_start(self.problem, "timestepping")
        return mujoco_run(self.problem.marionette, start, self.inputs, self.end, dt)

    @property
    def end(self) -> float:
        """Time at which simulations of the plan end [s]."""
        last = float(self.times[-1] + np.sum(self._tail[0])) + self.problem.hold
        return max(last, self.start.t + self.rollouts.options.dt)

    @cached_property
    def _tail(self) -> tuple[Array, Array]:
        """Durations (k,) and accelerations (k, n_vK) after the last node.

        If the puppet must stay at the goal, its inputs come to rest. If it can rest there in
        contact with other parts, they then move to that equilibrium: half of the way with constant
        acceleration and half with constant deceleration.
        """
        rollouts, problem, v = self.rollouts, self.problem, self.states.v_K[-1]
        bounds, table = rollouts.bounds, problem.marionette.coordinates
        if not problem.hold:
            return np.zeros(0), np.zeros((0, len(v)))
        durations, accelerations = list[float](), list[Array]()
        braking_time = self._rounded_up(np.max(_ratio(np.abs(v), bounds.acceleration), initial=0.0))
        if braking_time:
            durations.append(braking_time)
            accelerations.append(-v / braking_time)
        displacement = np.zeros(len(v))
        if problem.rest_K is not None:
            for q, k in table.scalars_K:
                displacement[k] = problem.rest_K[q] - (
                    self.states.q_K[-1, q] + 0.5 * braking_time * v[k]
                )
        displacement[~bounds.movable] = 0.0
        speed_time = np.max(_ratio(np.abs(displacement), bounds.speed), initial=0.0)
        squared_time = np.max(_ratio(np.abs(displacement), bounds.acceleration), initial=0.0)
        half_time = self._rounded_up(max(speed_time, np.sqrt(squared_time)))
        if half_time:
            durations += [half_time, half_time]
            accelerations += [displacement / half_time**2, -displacement / half_time**2]
        return np.array(durations), np.reshape(accelerations, (len(accelerations), len(v)))

    def _rounded_up(self, duration: float) -> float:
        """A duration, rounded up to whole checks [s]."""
        interval = self.rollouts.options.interval
        return float(np.ceil(duration / interval)) * interval


def _ratio(numerator: Array, denominator: Array) -> Array:
    """a / b, or 0 if b is 0."""
    return np.divide(numerator, denominator, out=np.zeros_like(numerator), where=denominator > 0.0)


def exact_start(problem: Problem, method: Method | MethodName) -> State:
    """The problem's start, projected for methods that need exact string lengths."""
    try:
        check_start(problem.marionette, problem.start, as_method(method).name)
    except StateError:
        return problem.marionette.project(problem.start)
    return problem.start
