"""Compares gains by time and by event in kicked runs of plans with slack strings.

    python -m benchmarks.planning.events [--plans 14] [--kicks 12] [--marionette 6]

Plans of ``arm3d_boxes`` with strings that may go slack, improved for half a second for time alone;
only those on which the string goes slack. Then the full marionette's bell.
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest, bootstrap

import fantoccini as fan
from fantoccini.base.arrays import Array
from fantoccini.control.planning import PlanResult, solve
from fantoccini.control.planning.feedback import Feedback
from fantoccini.control.problems import Problem
from fantoccini.motion import State

from ..strings.report import Table
from .feedback import follow, kicked_start

SIZES = (0.25, 0.5, 1.0)
"""Sizes of kicks: norms of changes of all joint velocities at the start [rad/s]."""

BELL_SIZES = (0.5, 1.0, 2.0)
"""Sizes for the marionette."""

LAWS = ("open loop", "gains by time", "gains by event")

Run = Callable[[Feedback, State, bool], float]
"""(Law, start, closed loop) -> distance at the end."""


@dataclass(frozen=True)
class Row:
    """Runs of one law.

    Attributes:
        name: name of the engine and the law.
        size: size of the kicks [rad/s].
        distance: (n,) distance from the goal at the end.
        by_time: (n,) distance of the law by time.
        tolerance: tolerance of the goal.
    """

    name: str
    size: float
    distance: Array
    by_time: Array
    tolerance: float

    def cells(self) -> list[str]:
        """Arrivals and the median distance, with 95 % intervals, and changes by the law."""
        hits, n = int(np.sum(self.distance <= self.tolerance)), len(self.distance)
        share = binomtest(hits, n).proportion_ci(method="wilson")
        spread = bootstrap(
            (self.distance,), np.median, n_resamples=2000, method="percentile", rng=0
        ).confidence_interval
        nearer, farther = (int(np.sum(s * (self.by_time - self.distance) > 1e-9)) for s in (1, -1))
        return [
            self.name,
            f"{self.size:g}",
            f"{hits} of {n}",
            f"{100 * share.low:.0f} to {100 * share.high:.0f} %",
            f"{np.median(self.distance):.3g}",
            f"{spread.low:.3g} to {spread.high:.3g}",
            f"{nearer} / {farther}",
        ]


HEAD = [
    "",
    "kick [rad/s]",
    "arrive",
    "(95 %)",
    "median distance",
    "(95 %)",
    "nearer / farther than gains by time",
]


def run_in_fantoccini(law: Feedback, x0: State, closed: bool) -> float:
    """The final distance."""
    return law.run(x0, closed=closed).distance


def run_in_mujoco(law: Feedback, x0: State, closed: bool) -> float:
    """The final distance; infinite if the run diverges."""
    return float(np.nan_to_num(follow(law, x0, closed).distance, nan=np.inf))


def compare_laws(
    plans: Sequence[PlanResult], kicks: int, sizes: Sequence[float], engines: dict[str, Run]
) -> list[Row]:
    """Kicked runs of plans, the same kicks for every law and engine.

    Args:
        plans: plans to follow.
        kicks: number of each size for every plan.
        sizes: sizes of the kicks [rad/s].
        engines: name -> function that runs a law.
    """
    laws = [(plan.feedback(window=0), plan.feedback()) for plan in plans]
    rows = []
    for (engine, run), size in itertools.product(engines.items(), sizes):
        random, distances = np.random.default_rng(1), []
        for by_time, by_event in laws:
            for _ in range(kicks):
                x0 = kicked_start(by_time.plan.problem, size, random)
                ways = (by_time, False), (by_time, True), (by_event, True)
                distances.append([run(law, x0, closed) for law, closed in ways])
        columns = np.transpose(distances)
        for name, column in zip(LAWS, columns, strict=True):
            tolerance = plans[0].tolerance
            rows.append(Row(f"{name}, {engine}", size, column, columns[1], tolerance))
    return rows


def slack_plans(n: int, seconds: float = 0.5) -> list[PlanResult]:
    """Plans on which the string goes slack, from the first seeds with such plans."""
    problem, plans = with_slack_allowed(fan.control.load_problem("arm3d_boxes")), []
    for seed in itertools.count():
        plan = solve(problem, seed=seed, improve=seconds, objective="time")
        if plan and not np.all(plan.feedback(window=0).active_sets):
            plans.append(plan)
        if len(plans) == n:
            return plans


def with_slack_allowed(problem: Problem) -> Problem:
    """The problem with strings that may go slack."""
    rollouts = problem.rollouts
    names = problem.marionette.coordinates.v_K
    return Problem(
        problem.marionette,
        problem.start,
        problem.goal,
        rollouts.clearance.obstacles,
        tolerance=problem.tolerance,
        bounds=fan.control.Bounds(
            speed=dict(zip(names, rollouts.bounds.speed, strict=True)),
            acceleration=dict(zip(names, rollouts.bounds.acceleration, strict=True)),
            clearance=rollouts.margin,
        ),
        slack=True,
    )


def bell(kicks: int) -> tuple[list[Row], float]:
    """The full marionette's bell, kicked, in fantoccini; and the time to compute its law [s]."""
    plan = fan.control.solve(fan.control.load_problem("marionette_bell"), seed=0, time_limit=60.0)
    began = time.perf_counter()
    plan.feedback()
    taken = time.perf_counter() - began
    return compare_laws([plan], kicks, BELL_SIZES, {"fantoccini": run_in_fantoccini}), taken


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plans", type=int, default=14)
    parser.add_argument("--kicks", type=int, default=12, help="kicks of each size for a plan")
    parser.add_argument("--marionette", type=int, default=6, help="kicks of each size; 0: none")
    arguments = parser.parse_args()
    if arguments.plans:
        engines = {"fantoccini": run_in_fantoccini, "MuJoCo": run_in_mujoco}
        rows = compare_laws(slack_plans(arguments.plans), arguments.kicks, SIZES, engines)
        print(Table(HEAD, [row.cells() for row in rows]).markdown())
    if arguments.marionette:
        rows, taken = bell(arguments.marionette)
        print(Table(HEAD, [row.cells() for row in rows]).markdown())
        print(f"The marionette's law takes {taken:.1f} s to make.")


if __name__ == "__main__":
    main()
