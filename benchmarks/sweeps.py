"""Prints the rate of cases of a sweep: on threads, and on Ray if it is installed.

    python -m benchmarks.sweeps

This is not a test: machines and their load differ.
"""

from __future__ import annotations

import importlib.util
import os
import time

from rich.console import Console
from rich.table import Table

import fantoccini as fan
from fantoccini.theatre.perform import demo

ROUNDS = 8
"""Number of sweeps for every figure; the fastest, the least disturbed, is printed."""


def empty_study(case: fan.lab.Case) -> dict:
    """An empty study: the overhead of a case."""
    return {"x": case["k"]}


def short_study(case: fan.lab.Case) -> dict:
    """0.3 s of the two-link arm, event-driven: some milliseconds, most of them Python's."""
    x0, lift = case["start"]
    run = fan.simulate(case.marionette, x0, lift, t_end=0.3)
    return {"peak": run.tension["hand"].max()}


def long_study(case: fan.lab.Case) -> dict:
    """The 25-DOF marionette's greeting, time-stepped: compiled code nearly all the time."""
    x0, greeting = case["start"]
    run = fan.simulate(
        case.marionette, x0, greeting, t_end=5.0, method="timestepping", save_every=50, effort=False
    )
    return {"peak": run.tension.values.max()}


def cases_per_second(study, n: int, puppet, start, **options) -> float:
    """Rate of the fastest of several sweeps of n cases [1/s]."""
    over = {"start": [start], "k": range(n)} if start else {"k": range(n)}
    rates = []
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        result = fan.sweep(study, over, puppet=puppet, progress=False, **options)
        rates.append(n / (time.perf_counter() - begun))
        assert result.failures == (), result.failures[0]
    return max(rates)


def main() -> None:
    """Measures and prints."""
    arm, marionette = fan.puppets.arm2d(), fan.puppets.marionette()
    x0 = arm.rest({"hand.length": 0.8})
    lift = fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (0.2, 0.7)]})
    hanging, greeting, _ = demo.performance(marionette)
    studies = (
        ("nothing", empty_study, 2000, None, None),
        ("arm2d, 0.3 s, event", short_study, 200, arm, (x0, lift)),
        ("marionette, 5 s, timestepping", long_study, 24, marionette, (hanging, greeting)),
    )
    crews = [("threads", 1), ("threads", 2)]
    if importlib.util.find_spec("ray"):
        import ray

        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        begun = time.perf_counter()
        ray.init(num_cpus=2, include_dashboard=False, logging_level=40, log_to_driver=False)
        print(f"starting Ray on this machine: {time.perf_counter() - begun:.1f} s")
        begun = time.perf_counter()
        fan.sweep(empty_study, {"k": range(2)}, puppet=arm, on="ray", progress=False)
        print(f"its first sweep, as its processes import: {time.perf_counter() - begun:.1f} s")
        crews.append(("ray", 2))
    table = Table("cases/s", *(f"{on}, {n}" for on, n in crews))
    for name, study, n, puppet, start in studies:
        rates = [
            cases_per_second(study, n, puppet, start, on=on, workers=workers)
            for on, workers in crews
        ]
        table.add_row(name, *(f"{rate:.0f}" for rate in rates))
    Console().print(table)
    print("load:", " ".join(f"{x:.1f}" for x in os.getloadavg()), "of", os.cpu_count(), "cores")


if __name__ == "__main__":
    main()
