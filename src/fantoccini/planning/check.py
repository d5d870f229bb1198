"""Plans made again, from their start and inputs alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import StateError, Status
from fantoccini.marionette import Event, Method, MethodName, TimeStepping, as_method, check_start
from fantoccini.motion import Input, State, Trajectory
from fantoccini.planning.goals import Rows
from fantoccini.planning.motions import Motions
from fantoccini.planning.problem import Problem
from fantoccini.planning.search_tree import SearchTree
from fantoccini.simulation import simulate

BACKENDS = {"fantoccini": 0.5, "mujoco": 0.25}
"""What plans can be made again in, and the step there by default, as part of the planner's."""


_CONFIRMED = 1e-8
"""Tolerance of the event-driven runs by which plans are confirmed."""


@dataclass(frozen=True)
class Check:
    """A plan made again.

    Attributes:
        arrives: whether it is DONE, ends within the tolerance and touches nothing; the margin was
            for this.
        distance: from the goal at the end.
        clearance: the least on the way [m].
        gap: largest difference of a dynamic coordinate from the plan's own run, at its nodes.
        run: the trajectory.
    """

    arrives: bool
    distance: float
    clearance: float
    gap: float
    run: Trajectory


def inputs_along(problem: Problem, tree: SearchTree, path: Sequence[int]) -> Input:
    """The driven coordinates of a plan: constant accelerations from node to node, then held.

    A plan without a motion goes on for a step.

    Args:
        problem: what was planned.
        tree: of the plan.
        path: its nodes.
    """
    path, start = list(path), problem.start
    times, acceleration = start.t + tree.time[path], tree.acceleration[path[1:]]
    if len(path) == 1:
        times = np.append(times, times + problem.motions.dt)
        acceleration = np.zeros((1, len(start.v_K)))
    return Input.segments(problem.marionette, times, start.q_K, start.v_K, acceleration)


def run_along(
    problem: Problem,
    tree: SearchTree,
    path: Sequence[int],
    method: Method,
    backend: str = "fantoccini",
    effort: bool = True,
) -> Trajectory:
    """What a plan does.

    Args:
        problem, tree, path: see :func:`inputs_along`.
        method: of the simulation; MuJoCo takes its ``dt``.
        backend: one of ``BACKENDS``.
        effort: compute the force on every driven coordinate.
    """
    motions = problem.motions
    start = beginning(problem, method.name)
    nodes = start.t + tree.time[list(path)]
    # A plan of one node has nothing to run; it stands for one step.
    end = max(float(nodes[-1]), start.t + motions.dt)
    inputs = inputs_along(problem, tree, path)
    if backend == "mujoco":
        from fantoccini.exchange import mujoco_run

        return mujoco_run(problem.marionette, start, inputs, end, method.dt)
    save_at = None
    if method.name == "event":
        # The nodes, and looks from start to end.
        looks = np.arange(start.t, end, motions.interval)
        save_at = np.unique(np.minimum(np.append(nodes, looks), end))
    return simulate(
        problem.marionette, start, inputs, end, method=method, save_at=save_at, effort=effort,
        throw=False,
    )  # fmt: skip


def beginning(problem: Problem, method: str) -> State:
    """The problem's start; with exact lengths for methods that need these."""
    try:
        check_start(problem.marionette.model, problem.start, as_method(method).name)
    except StateError:
        return problem.marionette.project(problem.start)
    return problem.start


def checked(
    problem: Problem,
    tree: SearchTree,
    path: Sequence[int],
    dt_factor: float | None = None,
    method: Method | MethodName = "timestepping",
    backend: str = "fantoccini",
    effort: bool = True,
) -> Check:
    """Simulates a plan anew; see :meth:`PlanResult.verify`."""
    motions, path = problem.motions, list(path)
    if backend not in BACKENDS:
        raise ValueError(f"backend is {backend!r}; it must be {' or '.join(map(repr, BACKENDS))}")
    dt_factor = BACKENDS[backend] if dt_factor is None else dt_factor
    if backend == "mujoco":
        _check_mujoco(dt_factor, method)
    if method == "timestepping":
        method = TimeStepping(dt=motions.dt * dt_factor, extrapolate=False)
    run = run_along(problem, tree, path, as_method(method), backend, effort)
    distance = float(problem.goal.distance(Rows.of(run.state(-1)))[0])
    clearance = _least_clearance(motions, run)
    times = problem.start.t + tree.time[path]
    near = _nearest(run.t, times)
    gap = float(np.max(np.abs(run.q_D[near] - tree.q_D[path])))
    reached = run.status is Status.DONE and run.t[-1] >= times[-1] - 1e-9
    arrives = reached and distance <= problem.tolerance and clearance >= 0.0
    return Check(bool(arrives), distance, clearance, gap, run)


def holds(problem: Problem, tree: SearchTree, path: Sequence[int]) -> bool:
    """Whether a plan arrives when its events are located; see :class:`Check`.

    Raises:
        KeyboardInterrupt: Ctrl-C ended the run, which says nothing about the plan then.
    """
    method = Event(rtol=_CONFIRMED, atol=_CONFIRMED)
    made = checked(problem, tree, path, method=method, effort=False)
    if made.run.status is Status.STOPPED:
        raise KeyboardInterrupt
    return made.arrives


def _least_clearance(motions: Motions, run: Trajectory) -> float:
    """The least on the way [m]: at every row, and at steps between where it may be below 0.

    That is where the mean of two rows is less than half of what clearance changes from row to row
    there and in the next ones before and after.
    """
    seen = motions.clearance.of(run)
    least = float(np.min(seen))
    if motions.clearance.measures_nothing or run.method != "event" or not least >= 0.0:
        return least
    change = np.abs(np.diff(seen))
    around = np.max([change, np.append(change[1:], 0.0), np.append(0.0, change[:-1])], axis=0)
    near = np.flatnonzero(seen[:-1] + seen[1:] < around)
    parts = np.arange(1, motions.look) / motions.look
    times = run.t[near, None] + np.diff(run.t)[near, None] * parts
    if not times.size:
        return least
    return min(least, float(np.min(motions.clearance.of(run.resample(times.ravel())))))


def _nearest(t: Array, times: Array) -> Array:
    """(n,) rows of increasing times t whose time is nearest."""
    after = np.clip(np.searchsorted(t, times), 1, len(t) - 1)
    return np.maximum(after - (times - t[after - 1] <= t[after] - times), 0)


def _check_mujoco(dt_factor: float, method: Method | MethodName) -> None:
    """Raises ValueError for what does not go with MuJoCo."""
    if method != "timestepping":
        raise ValueError(
            f"backend='mujoco' steps through time: method must be 'timestepping', not {method!r}"
        )
    if not 0.0 < dt_factor < np.inf:
        raise ValueError(f"dt_factor is {dt_factor}; it must be finite and greater than 0")
