"""Motion planning: inputs that take a puppet to a goal, clear of obstacles (Sec. VII).

A driven coordinate is the end or length of a string, or a driven joint; the inputs move it.
"""

from __future__ import annotations

import contextlib
import inspect
from collections.abc import Iterable, Mapping
from typing import Any, Unpack

from fantoccini.base import StateError, did_you_mean
from fantoccini.control.planning.options import SearchKeywords, SearchOptions
from fantoccini.control.planning.planners import Planner
from fantoccini.control.planning.result import PlanResult
from fantoccini.control.planning.search import Search
from fantoccini.control.problems import Problem
from fantoccini.control.tasks import GoalLike, Objective, Task
from fantoccini.dynamics.clearance import HalfSpace
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import Obstacle
from fantoccini.motion import State

_PROBLEM_OPTIONS = tuple(inspect.signature(Problem).parameters)[3:]
_POLISHED_DISTANCE = 1e-3
"""Distance from the goal at which polished plans must end, while plans are improved."""


def plan(
    marionette: Marionette | Task,
    start: State | None = None,
    goal: GoalLike | None = None,
    obstacles: Iterable[Obstacle | HalfSpace | Mapping[str, Any]] = (),
    *,
    planner: str | Planner = "explore",
    time_limit: float = 10.0,
    iterations: int | None = None,
    improve: float = 0.0,
    confirm: bool = True,
    objective: str | Objective | None = None,
    seed: int = 0,
    **options: Any,
) -> PlanResult:
    """The result of a search for inputs that take a puppet to a goal.

    The driven coordinates move with constant accelerations from node to node of a tree; their
    positions and velocities are part of a node. The same seed gives the same plan, with any number
    of threads, unless a time limit ends the search. Ctrl-C ends it with the best plan so far.

    To plan with several seeds, make the :class:`Problem` once and ``solve`` it.

    Args:
        marionette, start, goal, obstacles, options: see :class:`Problem`. Or a :class:`Task` alone,
            whose ``conditions`` hold the options.
        planner, time_limit, iterations, improve, confirm, objective, seed: see
            :class:`SearchOptions`.

    Returns:
        The plan; true if it ends within the tolerance and makes only allowed touches when simulated
        again.

    Raises:
        StateError, UnknownNameError, FileError: ill-defined problem, or a string that is too short
            for the start.
        ValueError: number out of range, or an unknown planner or objective.
        TypeError: unknown option.
    """
    search = SearchOptions(planner, time_limit, iterations, improve, confirm, objective, seed)
    allowed_options = () if isinstance(marionette, Task) else _PROBLEM_OPTIONS
    _refuse_unknown("plan", options, (*allowed_options, *SearchKeywords.__annotations__))
    if isinstance(marionette, Task):
        if start is not None or goal is not None or obstacles:
            raise StateError("plan: a task has its start, end and obstacles; give no others")
        return solve(Problem.from_task(marionette), search)
    if start is None or goal is None:
        raise StateError("plan: found no start or no goal; needed: both, or a Task alone")
    return solve(Problem(marionette, start, goal, obstacles, **options), search)


def solve(
    problem: Problem, options: SearchOptions | None = None, **keywords: Unpack[SearchKeywords]
) -> PlanResult:
    """The result of a search for a plan that solves a problem.

    Args:
        problem: the planning problem.
        options: options of the search.
        keywords: the same options as keywords, ``solve(problem, seed=1)``: planner, time_limit,
            iterations, improve, confirm, objective, seed.

    Raises:
        ValueError: number out of range, an unknown planner or objective, or options given twice.
        TypeError: unknown option.
    """
    _refuse_unknown("solve", keywords, SearchKeywords.__annotations__)
    if options is not None and keywords:
        raise ValueError(f"give either options or {', '.join(keywords)}, not both")
    options = options or SearchOptions(**keywords)
    search = Search(problem, options)
    with contextlib.suppress(KeyboardInterrupt):
        search.find_first(options.time_limit, options.iterations)
        if options.improve and search.arrived:
            distance = min(_POLISHED_DISTANCE, problem.rollouts.stop_distance)
            search.improve(options.improve, distance)
    return PlanResult.from_search(search)


def _refuse_unknown(function: str, options: Iterable[str], allowed: Iterable[str]) -> None:
    for name in options:
        if name not in allowed:
            raise TypeError(f"{function}() has no option {name!r}{did_you_mean(name, allowed)}")
