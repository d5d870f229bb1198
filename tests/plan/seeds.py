"""Plans of the first seed that has a property: which seed that is hangs on the last bit."""

from __future__ import annotations

from collections.abc import Callable

from fantoccini.control.planning import PlanResult, solve
from fantoccini.control.problems import Problem

SEEDS = 20


def first_plan(
    problem: Problem,
    wanted: Callable[[PlanResult], object] = bool,
    made: Callable[[PlanResult], PlanResult] = lambda plan: plan,
    seeds: int = SEEDS,
) -> PlanResult:
    """The plan of the first seed that is as wanted.

    Args:
        problem: what is planned.
        wanted: of what was made of a plan that was found.
        made: what to make of a plan.
        seeds: how many are tried.
    """
    for seed in range(seeds):
        found = solve(problem, seed=seed, time_limit=60.0)
        if found and (plan := made(found)) and wanted(plan):
            return plan
    raise AssertionError(f"none of {seeds} seeds has a plan as wanted")


def calm(plan: PlanResult) -> bool:
    """Whether nothing is caught on the way."""
    return not plan.tree.catches[list(plan.path)].any()


def polished(plan: PlanResult) -> PlanResult:
    """The plan, brought to 1e-3 from the goal."""
    return plan.polish(1e-3, seconds=0.0)


def near(plan: PlanResult) -> bool:
    """Whether a plan was brought to its goal."""
    return plan.polished is not None and plan.polished.reached
