"""Prints the success of the arm's swing-up search from a cold start, by seed and by method.

    python -m benchmarks.optimal.modes [--seeds 20] [--methods]

Initial inputs are constant; seeds are those of the random motions of the explorations. With
--methods, it compares searches after one exploration: for taut motions, with derivatives of
time steps and with exact ones, and in a trust region.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

import fantoccini as fan
from fantoccini.control.optimal.attribution import largest_bound_violation
from fantoccini.control.optimal.dynamics import TimeSteps
from fantoccini.control.optimal.exploring import Exploration
from fantoccini.control.optimal.hybrid import HybridRuns
from fantoccini.control.optimal.iterations import Limits
from fantoccini.control.optimal.multi_start import MAX_RESIDUAL
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.shooting import EventRuns
from fantoccini.control.optimal.sqp import Iterate, Search
from fantoccini.control.optimal.trust_region import TrustRegionSearch
from fantoccini.control.tasks.chosen_parameters import ChosenParameters
from fantoccini.control.tasks.nodes import Nodes

LIMITS = Limits(tolerance=1e-6, cost_tolerance=1e-6, iterations=100)
METHODS: dict[str, tuple[type[EventRuns], Callable[..., Search | TrustRegionSearch]]] = {
    "filter, time steps": (EventRuns, Search),
    "filter, exact": (HybridRuns, Search),
    "trust region, exact": (HybridRuns, TrustRegionSearch),
}


def slack_time(run: fan.Trajectory) -> float:
    """Total time with a slack string [s]."""
    return float(np.sum(np.diff(run.t) * (run.tension["hand"][:-1] == 0.0)))


def by_seed(task: fan.Task, seeds: int) -> None:
    """Prints full searches."""
    successes = []
    for seed in range(seeds):
        best = fan.optimise(
            task,
            seed=seed,
            cost_tolerance=LIMITS.cost_tolerance,
            iterations=LIMITS.iterations,
            threads=1,
            time_limit=300.0,
        )
        again = fan.simulate(task.marionette, task.x0, best.inputs, best.run.t[-1])
        off = max(np.max(np.abs(again.q_D[-1] - task.end.q_D)), np.max(np.abs(again.v_D[-1])))
        successes.append(best.holds and off < MAX_RESIDUAL)
        print(f"seed {seed:2}: {best}, end within {off:.1e}, slack {slack_time(best.run):.2f} s")
    print(f"found: {sum(successes)} of {seeds}")


def by_method(task: fan.Task, seeds: int) -> None:
    """Prints searches after one exploration."""
    marionette, chosen = task.marionette, ChosenParameters(task.marionette, task.x0, {})
    first = Nodes.constant(marionette, task.x0, task.durations[1], task.n_intervals)
    costs: dict[str, list[float]] = {name: [] for name in METHODS}
    seconds = dict.fromkeys(METHODS, 0.0)
    for seed in range(seeds):
        rng = np.random.default_rng([seed, 0])
        drawn = Exploration(first, Objective(task), rng, 1).run()
        for name, (kind, search) in METHODS.items():
            runs = kind(TimeSteps(marionette, task.dt, 1, chosen), chosen)
            objective = Objective(task)
            nodes, run = runs.run(drawn.nodes)
            ends = runs.ends(nodes, run)
            began = time.perf_counter()
            at = Iterate(nodes, ends, objective.cost(nodes, ends))
            best = search(at, runs, objective, LIMITS).run()
            seconds[name] += time.perf_counter() - began
            off = np.max(np.abs(objective.end_gap(best.nodes)))
            held = (
                max(off, largest_bound_violation(objective, best.nodes, best.ends).size)
                <= MAX_RESIDUAL
            )
            costs[name].append(best.cost if held else np.inf)
    for name, J in costs.items():
        held = np.isfinite(J)
        print(
            f"{name:20} holds: {np.sum(held)} of {seeds}, median cost "
            f"{np.median(np.array(J)[held]) if np.any(held) else np.nan:.4g}, "
            f"{seconds[name] / seeds:.2f} s each"
        )


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--methods", action="store_true", help="compare methods instead")
    arguments = parser.parse_args()
    task = fan.control.load_task("swing_up")
    cold = fan.optimise(replace(task, explore=0), iterations=LIMITS.iterations)
    print(f"without exploration: {cold}")
    (by_method if arguments.methods else by_seed)(task, arguments.seeds)


if __name__ == "__main__":
    main()
