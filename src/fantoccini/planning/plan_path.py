"""A plan as a path through its tree, and its simulations from start and inputs alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fantoccini.arrays import Array, Indices, Times
from fantoccini.errors import StateError
from fantoccini.marionette import Method, MethodName, TimeStepping, as_method, check_start
from fantoccini.motion import Input, State, Trajectory
from fantoccini.planning.goals import Goal
from fantoccini.planning.problem import Problem
from fantoccini.planning.rollouts import Rollouts
from fantoccini.planning.search_tree import SearchTree
from fantoccini.planning.state_arrays import StateArrays
from fantoccini.simulation import simulate


@dataclass(frozen=True, eq=False)
class PlanPath:
    """A path of m segments through a search tree.

    Attributes:
        problem: what was planned.
        tree: in which the plan was found.
        path: (m + 1) nodes from the start to the plan's end.
    """

    problem: Problem
    tree: SearchTree
    path: tuple[int, ...]

    @property
    def start(self) -> State:
        """Where the plan begins."""
        return self.problem.start

    @property
    def goal(self) -> Goal:
        """The problem's goal."""
        return self.problem.goal

    @property
    def tolerance(self) -> float:
        """Tolerance of the goal's distance."""
        return self.problem.tolerance

    @property
    def rollouts(self) -> Rollouts:
        """What simulated its segments."""
        return self.problem.rollouts

    @property
    def times(self) -> Times:
        """(m + 1,) of the nodes [s]."""
        return self.start.t + self.tree.time[list(self.path)]

    @property
    def states(self) -> StateArrays:
        """(m + 1,) at the nodes."""
        return self.tree.states[list(self.path)]

    @property
    def looks(self) -> Indices:
        """(m,) checks that the segments last."""
        return self.tree.looks[list(self.path[1:])]

    @property
    def acceleration(self) -> Array:
        """(m, n_vK) of the driven coordinates [m/s^2 or rad/s^2]."""
        return self.tree.acceleration[list(self.path[1:])]

    @cached_property
    def inputs(self) -> Input:
        """The driven coordinates: constant accelerations from node to node, then held.

        Where the puppet must stay at the goal, they are brought to rest first. A plan without
        segments lasts one time step.
        """
        start, times, acceleration = self.start, self.times, self.acceleration
        if self._braking:
            times = np.append(times, times[-1] + self._braking)
            acceleration = np.concatenate([acceleration, -self.states.v_K[-1:] / self._braking])
        if len(times) == 1:
            times = np.append(times, times + self.rollouts.options.dt)
            acceleration = np.zeros((1, len(start.v_K)))
        return Input.segments(self.problem.marionette, times, start.q_K, start.v_K, acceleration)

    @cached_property
    def trajectory(self) -> Trajectory:
        """The plan by the time-stepper, with the planner's step."""
        return self.simulate(TimeStepping(dt=self.rollouts.options.dt, extrapolate=False))

    def simulate(self, method: Method, effort: bool = True) -> Trajectory:
        """Simulates the plan; a run that ends early is returned.

        Args:
            method: of the simulation.
            effort: compute the force on every driven coordinate.
        """
        start, end, save_at = exact_start(self.problem, method), self.end, None
        if method.name == "event":
            looks = np.arange(start.t, end, self.rollouts.options.interval)
            save_at = np.unique(np.minimum(np.append(self.times, looks), end))
        return simulate(
            self.problem.marionette, start, self.inputs, end, method=method, save_at=save_at,
            effort=effort, throw=False,
        )  # fmt: skip

    def simulate_in_mujoco(self, dt: float) -> Trajectory:
        """Simulates the plan in MuJoCo with a step [s]; see :meth:`PlanResult.verify`."""
        from fantoccini.exchange import mujoco_run

        start = exact_start(self.problem, "timestepping")
        return mujoco_run(self.problem.marionette, start, self.inputs, self.end, dt)

    @property
    def end(self) -> float:
        """When simulations of the plan end [s]."""
        last = float(self.times[-1]) + self._braking + self.problem.hold
        return max(last, self.start.t + self.rollouts.options.dt)

    @property
    def _braking(self) -> float:
        """How long the driven coordinates take to come to rest where the puppet is to stay [s]."""
        if not self.problem.hold:
            return 0.0
        rollouts = self.rollouts
        speed, most = np.abs(self.states.v_K[-1]), rollouts.bounds.acceleration
        longest = float(np.max(speed[most > 0.0] / most[most > 0.0], initial=0.0))
        return float(np.ceil(longest / rollouts.options.segment)) * rollouts.options.segment


def exact_start(problem: Problem, method: Method | MethodName) -> State:
    """The problem's start, projected for methods that need exact string lengths."""
    try:
        check_start(problem.marionette.model, problem.start, as_method(method).name)
    except StateError:
        return problem.marionette.project(problem.start)
    return problem.start
