"""OMPL's planners beside ours, on the same problem, in processes of their own."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np

import fantoccini as fan

from ..strings import ROOT
from ..strings.report import Section, Table
from .ompl_peers import LOOKS, PLANNERS
from .propagators import PROPAGATORS

MISSING = 3
"""Exit code of a run without OMPL."""


def section(seeds: int, limit: float) -> Section:
    """A row for every planner and propagator.

    Args:
        seeds: of each.
        limit: of a search [s].
    """
    rows = []
    for planner in PLANNERS:
        for propagator in PROPAGATORS:
            command = [
                sys.executable, "-m", "benchmarks.planning.ompl_peers", "--planner", planner,
                "--propagator", propagator, "--seeds", str(seeds), "--time-limit", str(limit),
            ]  # fmt: skip
            done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
            if done.returncode == MISSING:
                return Section("Beside OMPL", ["OMPL was not installed."])
            done.check_returncode()
            found = [json.loads(line) for line in done.stdout.splitlines() if line[:1] == "{"]
            rows.append(_row(f"OMPL {planner}", propagator, found))
    problem = fan.load_problem("arm3d_boxes")
    for planner in ("est-2007", "explore"):
        ours = [fan.solve(problem, planner=planner, seed=s, time_limit=limit) for s in range(seeds)]
        found = [{"found": bool(p), "seconds": p.seconds, "distance": p.distance} for p in ours]
        rows.append(_row(f"fantoccini {planner}", "own, in lanes", found))
    text = (
        f"`arm3d_boxes` at tolerance 0.25, {seeds} seeds, {limit:g} s for each. OMPL's segments "
        f"are ours: constant accelerations for {LOOKS[0]} to {LOOKS[1]} looks of 20 ms; its states "
        "are propagated by our compiled time-stepper, or by MuJoCo with steps as long, and "
        "clearances, ranges, speeds and slack strings are looked at alike. One thread: OMPL's "
        "control planners have no more."
    )
    header = ["planner", "propagator", "found", "median [s]", "nearest, median"]
    return Section("Beside OMPL", [text, Table(header, rows)])


def _row(planner: str, propagator: str, found: list[dict]) -> list[str]:
    there = [f for f in found if f["found"]]
    return [
        planner,
        propagator,
        f"{len(there)} of {len(found)}",
        f"{np.median([f['seconds'] for f in there]):.3g}" if there else "-",
        f"{np.median([f['distance'] for f in found]):.2f}",
    ]
