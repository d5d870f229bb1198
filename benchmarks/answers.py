"""Answers of bundled tasks and plans of a bundled problem, to the last bit.

    python -m benchmarks.answers tasks circle crane
    python -m benchmarks.answers plans arm3d_boxes --seeds 50
    python -m benchmarks.answers polished arm3d_boxes --seeds 5

Two versions that print the same lines, times left aside, give the same answers.
"""

from __future__ import annotations

import argparse
import hashlib
import time
from collections.abc import Sequence

import numpy as np

import fantoccini as fan
from fantoccini.control.planning import solve


def print_answers(names: Sequence[str]) -> None:
    """Prints status, iterations and cost of the answer to each task."""
    for name in names:
        best = fan.optimise(fan.control.load_task(name), time_limit=86_400.0)
        print(f"{name}: {best.status.name}, {best.iterations} iterations, cost {best.cost!r}")


def print_plans(name: str, seeds: int, polished: bool) -> None:
    """Prints the number of seeds with a plan, processor times, and a hash of all inputs.

    Args:
        name: name of the problem.
        seeds: number of seeds.
        polished: whether the plans are polished.
    """
    problem = fan.control.load_problem(name)
    digest, n_plans, total, seconds = hashlib.sha256(), 0, 0.0, []
    for seed in range(seeds):
        began = time.process_time()
        plan = solve(problem, seed=seed, iterations=20_000, time_limit=600.0)
        n_plans += bool(plan)
        if polished:
            plan = plan.polish(1e-3, seconds=0.0)
        seconds.append(time.process_time() - began)
        total += plan.duration
        digest.update(np.ascontiguousarray(plan.acceleration).tobytes())
        digest.update(repr((plan.status.name, plan.duration, plan.tried)).encode())
    text = digest.hexdigest()[:16]
    median, high = 1e3 * np.percentile(seconds, (50.0, 99.0))
    print(f"{name}: {n_plans} of {seeds} found, {total!r} s in all, {text}")
    print(f"processor time of a seed: median {median:.1f} ms, 99 % below {high:.1f} ms")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("tasks", "plans", "polished"))
    parser.add_argument("names", nargs="+")
    parser.add_argument("--seeds", type=int, default=50)
    arguments = parser.parse_args()
    if arguments.what == "tasks":
        print_answers(arguments.names)
    else:
        for name in arguments.names:
            print_plans(name, arguments.seeds, arguments.what == "polished")


if __name__ == "__main__":
    main()
