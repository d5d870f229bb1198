"""Motion planning: inputs that take a puppet to a goal, clear of obstacles (Sec. VII)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from fantoccini.marionette import Marionette
from fantoccini.motion import State
from fantoccini.planning.goals import Goal
from fantoccini.planning.objective import Objective
from fantoccini.planning.obstacles import HalfSpace
from fantoccini.planning.planners import Planner
from fantoccini.planning.problem import Problem
from fantoccini.planning.result import PlanResult
from fantoccini.planning.search import Search
from fantoccini.puppet import Obstacle

_NEAR = 1e-3
"""Distance from the goal at which a plan that is polished ends."""


def plan(
    marionette: Marionette,
    start: State,
    goal: Goal | State | Mapping[str, Any] | Any,
    obstacles: Iterable[Obstacle | HalfSpace | Mapping[str, Any]] = (),
    *,
    planner: str | Planner = "explore",
    time_limit: float = 10.0,
    iterations: int | None = None,
    improve: float = 0.0,
    confirm: bool = True,
    objective: str | Objective | None = None,
    seed: int = 0,
    **options,
) -> PlanResult:
    """Searches for inputs that take a puppet to a goal.

    The driven coordinates move from node to node of a tree with constant accelerations; their
    places and velocities are part of a node. The same seed gives the same plan, whatever the
    threads, as long as no time limit ends the search. Ctrl-C ends it with the best so far.

    To plan the same with several seeds, make the :class:`Problem` once and ``solve`` it.

    Args:
        marionette, start, goal, obstacles, options: see :class:`Problem`.
        planner, time_limit, iterations, improve, confirm, objective, seed: see :func:`solve`.

    Returns:
        The plan; true where it ends within the tolerance and touches nothing when it is simulated
        event-driven.

    Raises:
        StateError, UnknownNameError, FileError: what is asked makes no sense, or a string is too
            short for the start.
        ValueError: a number out of range, or an unknown planner or objective.
    """
    problem = Problem(marionette, start, goal, obstacles, **options)
    return solve(
        problem,
        planner=planner,
        time_limit=time_limit,
        iterations=iterations,
        improve=improve,
        confirm=confirm,
        objective=objective,
        seed=seed,
    )


def solve(
    problem: Problem,
    *,
    planner: str | Planner = "explore",
    time_limit: float = 10.0,
    iterations: int | None = None,
    improve: float = 0.0,
    confirm: bool = True,
    objective: str | Objective | None = None,
    seed: int = 0,
) -> PlanResult:
    """Searches a problem for a plan.

    Args:
        problem: what is to be planned.
        planner: ``"explore"``, ``"est-2007"``, or one round of a planner.
        time_limit: after which the search for a first plan ends [s].
        iterations: motions after which it ends; no bound by default.
        improve: how long to look for better plans, and to bring the end nearer to the goal, once
            there is one [s].
        confirm: whether a plan counts only if it holds event-driven: it ends within the tolerance
            and touches nothing when its events are located. The search goes on where it does not.
            This takes some milliseconds for every plan that is found; without it, the first
            ``bool(plan)`` does.
        objective: what better plans have less of, in place of the problem's.
        seed: of all random choices.

    Raises:
        ValueError: a number out of range, or an unknown planner or objective.
    """
    if not 0.0 < time_limit < np.inf:
        raise ValueError(f"time_limit is {time_limit}; it must be finite and greater than 0")
    if not 0.0 <= improve < np.inf:
        raise ValueError(f"improve is {improve}; it must be a finite number of at least 0 [s]")
    if iterations is not None and not iterations >= 1:
        raise ValueError(f"iterations is {iterations}; it must be at least 1")
    search = Search(problem, planner, seed, confirm, objective)
    try:
        search.first(time_limit, iterations)
        if improve and search.arrived:
            search.improve(improve, min(_NEAR, problem.motions.inner))
    except KeyboardInterrupt:
        pass
    return PlanResult.of(search)
