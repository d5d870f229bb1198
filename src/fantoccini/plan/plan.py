"""Motion planning: inputs that take a puppet to a goal, clear of obstacles (Sec. VII)."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fantoccini.marionette import Marionette
from fantoccini.motion import State
from fantoccini.plan.balance import balanced
from fantoccini.plan.clearance import Clearance
from fantoccini.plan.goals import Goal, Rows
from fantoccini.plan.motions import Bounds, Motions
from fantoccini.plan.obstacles import HalfSpace
from fantoccini.plan.planners import EST2007, Explore, Planner
from fantoccini.plan.result import PlanResult, PlanStatus
from fantoccini.plan.search_tree import SearchTree
from fantoccini.puppet import Obstacle
from fantoccini.runtime import default_threads

PLANNERS: dict[str, type] = {"explore": Explore, "est-2007": EST2007}
"""Planners by name."""


def plan(
    marionette: Marionette,
    start: State,
    goal: Goal | State | Mapping[str, Any] | Any,
    obstacles: Iterable[Obstacle | HalfSpace | Mapping[str, Any]] = (),
    *,
    planner: str | Planner = "explore",
    tolerance: float = 0.1,
    speed: float | Mapping[str, float] = 0.5,
    acceleration: float | Mapping[str, float] = 2.0,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    margin: float = 0.0,
    strings: bool = True,
    self_collision: bool = False,
    time_limit: float = 10.0,
    iterations: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    dt: float = 0.004,
    look: int = 5,
) -> PlanResult:
    """Searches for inputs that take a puppet to a goal.

    The driven coordinates move from node to node of a tree with constant accelerations; their
    places and velocities are part of a node. The same seed gives the same plan, whatever the
    threads, as long as the time limit does not end the search. Ctrl-C ends it with the best so far.

    Args:
        marionette: the puppet.
        start: where it begins; its driven coordinates may move.
        goal: a state, names and values (``{"elbow": 1.2}``), a :class:`Goal`, or a function of
            :class:`Rows` that gives distances.
        obstacles: more than the world has.
        planner: ``"explore"``, ``"est-2007"``, or one round of a planner.
        tolerance: of the goal's distance.
        speed, acceleration: largest of the driven coordinates, for all or by name [m/s, m/s^2].
        ranges: name of a driven coordinate -> (low, high) [m].
        margin: least clearance [m].
        strings: whether strings are kept clear of obstacles too.
        self_collision: whether bodies are kept clear of one another.
        time_limit: after which the search ends [s].
        iterations: motions after which it ends; no bound by default.
        seed: of all random choices.
        threads: that share the work; all processors by default.
        dt: step of the time-stepper [s].
        look: steps from one look for collisions and the goal to the next.

    Returns:
        The plan; false unless it ends within the tolerance.

    Raises:
        StateError, UnknownNameError, FileError: what is asked makes no sense, or a string is too
            short for the start.
        ValueError: a number out of range, or an unknown planner.
    """
    threads = default_threads() if threads is None else threads
    _check(tolerance, margin, time_limit, dt)
    for name, number in (
        ("look", look),
        ("iterations", 1 if iterations is None else iterations),
        ("threads", threads),
    ):
        if number < 1:
            raise ValueError(f"{name} is {number}; it must be at least 1")
    if isinstance(planner, str):
        if planner not in PLANNERS:
            raise ValueError(f"planner is {planner!r}; it must be one of {', '.join(PLANNERS)}")
        planner = PLANNERS[planner]()
    marionette.check_start(start)
    aim = Goal.of(marionette, goal)
    clearance = Clearance(marionette, obstacles, strings=strings, self_collision=self_collision)
    bounds = Bounds.of(marionette, speed, acceleration, ranges or {})
    # What is compiled once and kept does not count.
    _ = marionette.library, marionette.lanes, marionette.clearances
    began = time.perf_counter()
    if aim.q_K is None and aim.q_D is not None:
        there = balanced(marionette, aim.q_D, start.q_K, bounds.moves)
        aim = replace(aim, q_K=np.clip(there, bounds.low, bounds.high))
    motions = Motions(
        marionette, clearance, bounds, margin=margin, dt=dt, look=look,
        threads=threads,
    )  # fmt: skip
    slip = start.slip if len(start.slip) else np.zeros(len(marionette.tree.strings))
    root = Rows(*(np.array([a]) for a in (start.q_D, start.v_D, slip, start.q_K, start.v_K)))
    tree = SearchTree(root, aim.of_start(root), marionette.coordinates.n_vK)
    status, reason, tried = PlanStatus.APPROXIMATE, _blocked(start, motions), 0
    if reason:
        status = PlanStatus.INFEASIBLE_START
    rng, best = np.random.default_rng(seed), 0
    with contextlib.suppress(KeyboardInterrupt):
        while status is PlanStatus.APPROXIMATE:
            if tree.distance[best] <= tolerance:
                status = PlanStatus.EXACT
                break
            late = time.perf_counter() - began > time_limit
            if late or (iterations is not None and tried >= iterations):
                break
            grown = planner(tree, motions, aim, rng)
            tried += grown.motions
            if len(grown.nodes):
                nearest = grown.nodes[int(np.argmin(tree.distance[grown.nodes.start :]))]
                best = nearest if tree.distance[nearest] < tree.distance[best] else best
    return PlanResult(
        status, reason, start, aim, tolerance, tuple(tree.path(best)), tree, motions, tried,
        time.perf_counter() - began,
    )  # fmt: skip


def _blocked(start: State, motions: Motions) -> str:
    """Why no plan can begin at a state; nothing where one can."""
    nearest = motions.clearance.nearest(start)
    if nearest is not None and nearest.distance < motions.margin:
        return f"at the start {nearest}; the margin is {motions.margin:g} m"
    bounds, table = motions.bounds, motions.marionette.coordinates
    for k, name in enumerate(table.q_K):
        if not bounds.low[k] <= start.q_K[k] <= bounds.high[k]:
            span = f"{bounds.low[k]:g} to {bounds.high[k]:g}"
            return f"{name} starts at {start.q_K[k]:g}, outside of its range {span}"
    for k, name in enumerate(table.v_K):
        if abs(start.v_K[k]) > bounds.speed[k]:
            return f"{name} starts at {start.v_K[k]:g}, faster than its bound {bounds.speed[k]:g}"
    return ""


def _check(tolerance: float, margin: float, limit: float, dt: float) -> None:
    for name, value in (("tolerance", tolerance), ("time_limit", limit), ("dt", dt)):
        if not 0.0 < value < np.inf:
            raise ValueError(f"{name} is {value}; it must be finite and greater than 0")
    if not 0.0 <= margin < np.inf:
        raise ValueError(f"margin is {margin}; it must be a number of at least 0 [m]")
