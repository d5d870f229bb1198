"""Our planner: first plans, better ones, and the full marionette."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

import fantoccini as fan

from ..strings.report import Section, Table
from .marks import Mark, percentage, spread

RTOL = 1e-10
"""Tolerance of the event-driven runs that confirm plans."""

TARGETS = {0.25: (10.0, 150.0, 100.0), 0.1: (50.0, 1000.0, 99.0)}
"""Tolerance -> targets: median [ms], 99 % [ms], found within a second [%]."""

CURVE_TIMES = (0.0, 0.02, 0.05, 0.1, 0.15)
"""Durations of the improvement at which the best plan is recorded [s]."""


def timed(make: Callable[[], Any]) -> tuple[float, Any]:
    """The duration of a call [s], and its result."""
    began = time.perf_counter()
    result = make()
    return time.perf_counter() - began, result


def first_plans(seeds: int) -> tuple[Section, list[Mark]]:
    """Times of first plans of ``arm3d_boxes``, and their confirmation."""
    section = Section("First plans of `arm3d_boxes`")
    section.parts.append(
        "Times in ms over all seeds: of everything (checking the start, placing the obstacles, "
        "computing the equilibrium and its regulator, and the search, without reading files), of "
        "the search alone, which is the time for another seed of the same problem, and of the "
        "search without its event-driven confirmation."
    )
    rows, confirmation_rows, marks = [], [], []
    for tolerance, (median, quantile, found_share) in TARGETS.items():
        read = fan.control.load_problem("arm3d_boxes", tolerance=tolerance)
        obstacles = read.rollouts.clearance.obstacles

        def make(
            tolerance: float = tolerance, read=read, obstacles=obstacles
        ) -> fan.control.Problem:
            return fan.control.Problem(
                read.marionette,
                read.start,
                read.goal,
                obstacles,
                tolerance=tolerance,
                bounds=fan.control.Bounds(clearance=0.005),
                slack=False,
            )

        total_times, search_times, unconfirmed_times, plans = [], [], [], []
        for seed in range(seeds):
            prepared, problem = timed(make)
            searched, plan = timed(lambda seed=seed, p=problem: fan.control.solve(p, seed=seed))
            total_times.append(prepared + searched)
            search_times.append(searched)
            unconfirmed_times.append(
                timed(lambda s=seed, p=problem: fan.control.solve(p, seed=s, confirm=False))[0]
            )
            plans.append(plan)
        found_in_time = [bool(p) and t <= 1.0 for p, t in zip(plans, total_times, strict=True)]
        rows += [
            [
                f"{tolerance:g}",
                "everything",
                *spread(total_times, 1e3),
                f"{sum(found_in_time)} of {seeds}",
            ],
            [f"{tolerance:g}", "search", *spread(search_times, 1e3), ""],
            [f"{tolerance:g}", "search, not confirmed", *spread(unconfirmed_times, 1e3), ""],
        ]
        events = [p.verify(method=fan.Event(rtol=RTOL, atol=RTOL)) for p in plans]
        halved = [p.verify() for p in plans]
        replayed = [bool(p) and p.replay() for p in plans]
        confirmation_rows.append(
            [
                f"{tolerance:g}",
                *(
                    f"{percentage(x):.1f} %"
                    for x in (replayed, [c.arrives for c in events], [c.arrives for c in halved])
                ),
                f"{np.median([c.deviation for c in events]):.2g}",
                f"{np.median([p.duration for p in plans]):.2f} s",
            ]
        )
        name = f"tolerance {tolerance:g}: "
        marks += [
            Mark(name + "plan within 1 s", percentage(found_in_time), found_share, "%", True),
            Mark(name + "median, everything", 1e3 * float(np.median(total_times)), median, "ms"),
            Mark(name + "median, search", 1e3 * float(np.median(search_times)), median, "ms"),
            Mark(
                name + "99 %, everything",
                1e3 * float(np.quantile(total_times, 0.99)),
                quantile,
                "ms",
            ),
            Mark(name + "replay to the last bit", percentage(replayed), 100.0, "%", True),
            Mark(
                name + "arrive event-driven",
                percentage([c.arrives for c in events]),
                95.0,
                "%",
                True,
            ),
        ]
    section.parts.append(
        Table(["tolerance", "of", "median", "90 %", "99 %", "greatest", "found"], rows)
    )
    section.parts.append(
        "Plans are repeated segment by segment to the last bit, by the event-driven method (rtol "
        f"{RTOL:g}) and with half the step; a plan arrives if it ends within the tolerance and "
        "touches nothing. The gap is the largest difference of a joint at a node from the "
        "event-driven run (median over all plans)."
    )
    section.parts.append(
        Table(
            ["tolerance", "replay", "event-driven", "half step", "gap", "duration"],
            confirmation_rows,
        )
    )
    return section, marks


def count_plans_through_boxes(seeds: int) -> tuple[Section, list[Mark]]:
    """Number of first plans without the boxes that pass through their places."""
    read = fan.control.load_problem("arm3d_boxes")
    free = fan.control.Problem(read.marionette, read.start, read.goal, tolerance=0.25, slack=False)
    clearance = read.rollouts.clearance
    through = [
        float(np.min(clearance.of(fan.control.solve(free, seed=s).trajectory))) < 0.0
        for s in range(seeds)
    ]
    section = Section("Whether the boxes matter")
    section.parts.append(
        f"Of {seeds} first plans without the boxes, {sum(through)} pass through the positions of "
        "the boxes."
    )
    return section, [
        Mark("pass through the boxes' positions", percentage(through), 90.0, "%", True)
    ]


def better_plans(seeds: int) -> tuple[Section, list[Mark]]:
    """Improvement of a first plan within a second."""
    problem = fan.control.load_problem("arm3d_boxes")
    plans = [fan.control.solve(problem, seed=s, improve=0.98) for s in range(seeds)]
    plans = [p for p in plans if p]
    ratios = [p.duration / p.curve[0][2] for p in plans]
    near = [p.distance <= 1e-3 for p in plans]
    active = [float(np.min(_tensions(p))) >= 0.0 for p in plans]
    held = [not _has_slackening(p) for p in plans]
    rough = [_roughness(p) for p in plans]
    peers = [p.verify(backend="mujoco").arrives for p in plans]
    events = [p.verify(method=fan.Event(rtol=RTOL, atol=RTOL)) for p in plans]
    curve = []
    for seconds in CURVE_TIMES:
        best = [
            min(t for s, _, t in p.curve if s <= p.curve[0][0] + seconds + 1e-9) / p.curve[0][2]
            for p in plans
        ]
        curve.append([f"{seconds:g} s", *(f"{x:.3f}" for x in np.quantile(best, [0.5, 0.1, 0.9]))])
    section = Section("Better plans within a second")
    section.parts += [
        "Duration of the shortest plan relative to the first plan's, after a further search in "
        "new trees whose plans must cost less (a catch costs 3 s): median and central 80 %.",
        Table(["after", "median", "10 %", "90 %"], curve),
        f"Then the plan is polished. Over {seeds} seeds the final plan lasts "
        f"{np.median([p.duration for p in plans]):.2f} s (first: "
        f"{np.median([p.curve[0][2] for p in plans]):.2f} s) and ends "
        f"{np.median([p.distance for p in plans]):.1e} from the goal (medians); "
        f"{percentage([c.arrives for c in events]):.0f} % arrive event-driven, at "
        f"{np.median([c.distance for c in events]):.2g}, and {percentage(peers):.0f} % in MuJoCo, "
        f"open loop. The string never goes slack on {percentage(held):.0f} % of them; the sum of "
        "squared "
        f"changes of acceleration is {np.median(rough):.3g} m^2/s^4 (median; a first plan's: "
        f"{np.median(_first_roughness(problem, seeds)):.3g}). The string alone needs 1.92 s: it "
        "is wound in by 0.837 m at 0.5 m/s, and 0.25 s are for accelerating and braking at 2 "
        "m/s^2.",
    ]
    seconds = [p.seconds for p in plans]
    return section, [
        Mark("improved: end within 1e-3 of the goal", percentage(near), 100.0, "%", True),
        Mark("improved: median duration relative to the first plan's", np.median(ratios), 0.6, ""),
        Mark("improved: tensions at least 0", percentage(active), 100.0, "%", True),
        Mark("improved: median total time", float(np.median(seconds)), 1.0, "s"),
    ]


def _has_slackening(plan: fan.control.PlanResult) -> bool:
    """Whether a taut string goes slack on the way."""
    return bool(np.any(np.diff((_tensions(plan) > 0.0).astype(int), axis=0) < 0))


def _tensions(plan: fan.control.PlanResult) -> np.ndarray:
    """Tensions (T, n_strings) [N]."""
    run = plan.trajectory
    return np.stack([run.tension[s.name] for s in plan.problem.marionette.tree.strings], axis=1)


def _roughness(plan: fan.control.PlanResult) -> float:
    """Squared changes of the driven accelerations from segment to segment [m^2/s^4]."""
    return float(np.sum(np.diff(plan.tree.acceleration[list(plan.path[1:])], axis=0) ** 2))


def _first_roughness(problem: fan.control.Problem, seeds: int) -> list[float]:
    plans = [fan.control.solve(problem, seed=s) for s in range(seeds)]
    return [_roughness(p) for p in plans]


def full_marionette(seeds: int) -> tuple[Section, list[Mark]]:
    """Confirmed plans of the 25-DOF puppet among obstacles."""
    rows, whole, verified = [], [], []
    for seed in range(seeds):
        prepared, problem = timed(lambda: fan.control.load_problem("marionette_bell"))
        searched, plan = timed(lambda p=problem, s=seed: fan.control.solve(p, seed=s))
        check = plan.verify(method=fan.Event(rtol=1e-9, atol=1e-9))
        whole.append(prepared + searched)
        verified.append(bool(plan) and check.arrives)
        rows.append(
            [
                str(seed),
                f"{prepared:.2f}",
                f"{searched:.2f}",
                f"{plan.duration:.2f}",
                f"{1e3 * check.distance:.1f}",
                f"{1e3 * check.clearance:.1f}",
                "yes" if verified[-1] else "no",
            ]
        )
    section = Section("The full marionette (`marionette_bell`)")
    section.parts += [
        "25 degrees of freedom, 7 strings, 21 driven coordinates: a hand is raised past a lamp "
        "and touches a bell, and no string that pulls goes slack. Times are for reading and "
        "preparing, and for the search with its event-driven confirmation.",
        Table(
            [
                "seed",
                "prepared [s]",
                "search [s]",
                "plan [s]",
                "from the bell [mm]",
                "clearance [mm]",
                "verified",
            ],
            rows,
        ),
    ]
    return section, [
        Mark("marionette: verified", percentage(verified), 100.0, "%", True),
        Mark("marionette: median, everything", float(np.median(whole)), 20.0, "s"),
    ]
