"""Motion planning: inputs that take a puppet to a goal, clear of obstacles (Sec. VII)."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from fantoccini.marionette import Marionette
from fantoccini.motion import State
from fantoccini.plan.goals import Goal
from fantoccini.plan.obstacles import HalfSpace
from fantoccini.plan.planners import EST2007, Explore, Planner
from fantoccini.plan.problem import Problem
from fantoccini.plan.result import PlanResult, PlanStatus
from fantoccini.plan.search_tree import SearchTree
from fantoccini.puppet import Obstacle

PLANNERS: dict[str, type] = {"explore": Explore, "est-2007": EST2007}
"""Planners by name."""


def plan(
    marionette: Marionette,
    start: State,
    goal: Goal | State | Mapping[str, Any] | Any,
    obstacles: Iterable[Obstacle | HalfSpace | Mapping[str, Any]] = (),
    *,
    planner: str | Planner = "explore",
    time_limit: float = 10.0,
    iterations: int | None = None,
    seed: int = 0,
    **options,
) -> PlanResult:
    """Searches for inputs that take a puppet to a goal.

    The driven coordinates move from node to node of a tree with constant accelerations; their
    places and velocities are part of a node. The same seed gives the same plan, whatever the
    threads, as long as the time limit does not end the search. Ctrl-C ends it with the best so far.

    To plan the same with several seeds, make the :class:`Problem` once and ``search`` it.

    Args:
        marionette, start, goal, obstacles, options: see :class:`Problem`.
        planner, time_limit, iterations, seed: see :func:`search`.

    Returns:
        The plan; false unless it ends within the tolerance.

    Raises:
        StateError, UnknownNameError, FileError: what is asked makes no sense, or a string is too
            short for the start.
        ValueError: a number out of range, or an unknown planner.
    """
    problem = Problem(marionette, start, goal, obstacles, **options)
    return search(problem, planner=planner, time_limit=time_limit, iterations=iterations, seed=seed)


def search(
    problem: Problem,
    *,
    planner: str | Planner = "explore",
    time_limit: float = 10.0,
    iterations: int | None = None,
    seed: int = 0,
) -> PlanResult:
    """Searches a problem for a first plan.

    Args:
        problem: what is to be planned.
        planner: ``"explore"``, ``"est-2007"``, or one round of a planner.
        time_limit: after which the search ends [s].
        iterations: motions after which it ends; no bound by default.
        seed: of all random choices.

    Raises:
        ValueError: a number out of range, or an unknown planner.
    """
    if not 0.0 < time_limit < np.inf:
        raise ValueError(f"time_limit is {time_limit}; it must be finite and greater than 0")
    if iterations is not None and iterations < 1:
        raise ValueError(f"iterations is {iterations}; it must be at least 1")
    if isinstance(planner, str):
        if planner not in PLANNERS:
            raise ValueError(f"planner is {planner!r}; it must be one of {', '.join(PLANNERS)}")
        planner = PLANNERS[planner]()
    began = time.perf_counter()
    motions, tolerance = problem.motions, problem.tolerance
    tree = SearchTree(problem.root, problem.distance, problem.marionette.coordinates.n_vK)
    status = PlanStatus.INFEASIBLE_START if problem.reason else PlanStatus.APPROXIMATE
    rng, best, tried = np.random.default_rng(seed), 0, 0
    with contextlib.suppress(KeyboardInterrupt):
        while status is PlanStatus.APPROXIMATE:
            if tree.distance[best] <= tolerance:
                status = PlanStatus.EXACT
                break
            late = time.perf_counter() - began > time_limit
            if late or (iterations is not None and tried >= iterations):
                break
            grown = planner(tree, motions, rng)
            tried += grown.motions
            if len(grown.nodes):
                nearest = _best(tree, grown.nodes, tolerance)
                best = nearest if tree.distance[nearest] < tree.distance[best] else best
    return PlanResult(
        status, problem, tuple(tree.path(best)), tree, tried, time.perf_counter() - began
    )


def _best(tree: SearchTree, nodes: range, tolerance: float) -> int:
    """Of nodes at the goal the earliest, otherwise the nearest."""
    distance = tree.distance[nodes.start : nodes.stop]
    there = np.flatnonzero(distance <= tolerance)
    if len(there):
        return nodes[int(there[np.argmin(tree.time[nodes.start + there])])]
    return nodes[int(np.argmin(distance))]
