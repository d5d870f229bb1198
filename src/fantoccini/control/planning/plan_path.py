"""A plan as a path through its tree, and its simulations from start and inputs alone."""

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

        Where the puppet must stay at the goal, they come to rest after the last node. A plan
        without segments lasts one time step.
        """
        start, times, acceleration = self.start, self.times, self.acceleration
        lasts, then = self._tail
        times = np.concatenate([times, times[-1] + np.cumsum(lasts)])
        acceleration = np.concatenate([acceleration, then])
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
        """Simulates the plan in MuJoCo with a step [s]; see :meth:`PlanResult.verify`."""
        from fantoccini.dynamics.mujoco import mujoco_run

        start = exact_start(self.problem, "timestepping")
        return mujoco_run(self.problem.marionette, start, self.inputs, self.end, dt)

    @property
    def end(self) -> float:
        """When simulations of the plan end [s]."""
        last = float(self.times[-1] + np.sum(self._tail[0])) + self.problem.hold
        return max(last, self.start.t + self.rollouts.options.dt)

    @cached_property
    def _tail(self) -> tuple[Array, Array]:
        """Durations (k,) and accelerations (k, n_vK) after the last node.

        Where the puppet must stay at the goal, its inputs are brought to rest; where it can rest
        there on what it touches, they then go on to that rest, half of the way with constant
        acceleration and half with its opposite.
        """
        rollouts, problem, v = self.rollouts, self.problem, self.states.v_K[-1]
        bounds, table = rollouts.bounds, problem.marionette.coordinates
        if not problem.hold:
            return np.zeros(0), np.zeros((0, len(v)))
        lasts, made = list[float](), list[Array]()
        brake = self._whole(np.max(_ratio(np.abs(v), bounds.acceleration), initial=0.0))
        if brake:
            lasts.append(brake)
            made.append(-v / brake)
        way = np.zeros(len(v))
        if problem.rest_K is not None:
            for q, k in table.scalars_K:
                way[k] = problem.rest_K[q] - (self.states.q_K[-1, q] + 0.5 * brake * v[k])
        way[~bounds.moves] = 0.0
        slowest = np.max(_ratio(np.abs(way), bounds.speed), initial=0.0)
        weakest = np.max(_ratio(np.abs(way), bounds.acceleration), initial=0.0)
        half = self._whole(max(slowest, np.sqrt(weakest)))
        if half:
            lasts += [half, half]
            made += [way / half**2, -way / half**2]
        return np.array(lasts), np.reshape(made, (len(made), len(v)))

    def _whole(self, duration: float) -> float:
        """A duration in whole looks [s]."""
        interval = self.rollouts.options.interval
        return float(np.ceil(duration / interval)) * interval


def _ratio(a: Array, b: Array) -> Array:
    """a / b, 0 where b is."""
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0.0)


def exact_start(problem: Problem, method: Method | MethodName) -> State:
    """The problem's start, projected for methods that need exact string lengths."""
    try:
        check_start(problem.marionette, problem.start, as_method(method).name)
    except StateError:
        return problem.marionette.project(problem.start)
    return problem.start
