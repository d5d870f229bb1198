"""Plans of the first seed with a property, because that seed depends on the last bit."""

from __future__ import annotations

from collections.abc import Callable

from fantoccini.control.planning import PlanResult, solve
from fantoccini.control.problems import Problem

SEEDS = 20


def first_plan(
    problem: Problem,
    condition: Callable[[PlanResult], object] = bool,
    process: Callable[[PlanResult], PlanResult] = lambda plan: plan,
    seeds: int = SEEDS,
) -> PlanResult:
    """The plan of the first seed with a property.

    Args:
        problem: planning problem.
        condition: condition on the plan returned by `process`.
        process: function that processes a plan.
        seeds: number of seeds to try.
    """
    for seed in range(seeds):
        result = solve(problem, seed=seed, time_limit=60.0)
        if result and (plan := process(result)) and condition(plan):
            return plan
    raise AssertionError(f"none of {seeds} seeds has a plan as wanted")


def without_catches(plan: PlanResult) -> bool:
    """Whether nothing is caught on the way."""
    return not plan.tree.catches[list(plan.path)].any()


def polish_plan(plan: PlanResult) -> PlanResult:
    """The plan, polished to 1e-3 from the goal."""
    return plan.polish(1e-3, seconds=0.0)


def is_polished(plan: PlanResult) -> bool:
    """Whether a plan was polished to its goal."""
    return plan.polished is not None and plan.polished.reached
