"""OMPL's planners compared with our own, on the same problem, each in its own process."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np

import fantoccini as fan

from ..strings import ROOT
from ..strings.report import Section, Table
from .ompl_peers import LOOKS, PLANNERS, easier_problem
from .propagators import PROPAGATORS

MISSING = 3
"""Exit code of a run without OMPL."""


HEADER = ["planner", "propagator", "plans", "median [s]", "nearest, median", "ratio"]


def section(seeds: int, limit: float) -> Section:
    """``arm3d_boxes`` and an easier problem, with a row for every planner and propagator.

    Args:
        seeds: number of seeds of each.
        limit: time limit of a search [s].
    """
    problem = fan.control.load_problem("arm3d_boxes")
    whole, easy = (
        _rows(problem, seeds, limit, []),
        _rows(easier_problem(problem), seeds, limit, ["--easy"]),
    )
    if not whole or not easy:
        return Section("Compared with OMPL", ["OMPL was not installed."])
    text = (
        f"`arm3d_boxes` at tolerance 0.25, {seeds} seeds, {limit:g} s for each. OMPL uses our "
        f"segments: constant accelerations for {LOOKS[0]} to {LOOKS[1]} checks of 20 ms; its "
        "states are propagated by our compiled time-stepper, or by MuJoCo with equal steps, and "
        "clearances, ranges, speeds and slack strings are checked in the same way. One thread is "
        "used, because OMPL's control planners have only one. The last column is the ratio of "
        "the median search time to that of `explore`. A search without a plan counts with its "
        "time limit, so the true ratio is larger if fewer than half found a plan."
    )
    more = (
        "The same arm, start and goal without the boxes, with a string that may go slack, and at "
        "twice the tolerance, for which OMPL's planners also find plans:"
    )
    return Section("Compared with OMPL", [text, Table(HEADER, whole), more, Table(HEADER, easy)])


def _rows(
    problem: fan.control.Problem, seeds: int, limit: float, changes: list[str]
) -> list[list[str]]:
    """Table rows of OMPL's planners and ours; none if OMPL is not installed."""
    ours = {
        planner: [
            {"found": bool(p), "seconds": p.seconds, "distance": p.distance}
            for p in (
                fan.control.solve(problem, planner=planner, seed=s, time_limit=limit)
                for s in range(seeds)
            )
        ]
        for planner in ("est-2007", "explore")
    }
    reference = _median(ours["explore"], limit)
    rows = []
    for planner in PLANNERS:
        for propagator in PROPAGATORS:
            command = [
                sys.executable,
                "-m",
                "benchmarks.planning.ompl_peers",
                "--planner",
                planner,
                "--propagator",
                propagator,
                "--seeds",
                str(seeds),
                "--time-limit",
                str(limit),
                *changes,
            ]
            done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
            if done.returncode == MISSING:
                return []
            done.check_returncode()
            outcomes = [json.loads(line) for line in done.stdout.splitlines() if line[:1] == "{"]
            rows.append(_row(f"OMPL {planner}", propagator, outcomes, limit, reference))
    for planner, outcomes in ours.items():
        rows.append(_row(f"fantoccini {planner}", "own, in lanes", outcomes, limit, reference))
    return rows


def _median(outcomes: list[dict], limit: float) -> float:
    """Median time of the searches [s]; those without a plan count with the limit."""
    return float(np.median([f["seconds"] if f["found"] else limit for f in outcomes]))


def _row(
    planner: str, propagator: str, outcomes: list[dict], limit: float, reference: float
) -> list[str]:
    there = [f for f in outcomes if f["found"]]
    more = "" if 2 * len(there) > len(outcomes) else "> "
    return [
        planner,
        propagator,
        f"{len(there)} of {len(outcomes)}",
        f"{np.median([f['seconds'] for f in there]):.3g}" if there else "-",
        f"{np.median([f['distance'] for f in outcomes]):.2f}",
        f"{more}{_median(outcomes, limit) / reference:.3g}x",
    ]
