"""Section 7: from the package's import to the first performance."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

from tests.harness import method_of

import fantoccini as fan
from fantoccini.kernel import build, codegen, equations
from fantoccini.model import tree
from fantoccini.theatre.perform import demo

from ..strings.report import Section, Table
from .figures import Chapter, Goal, Samples, spread_text, time_text
from .programs import source
from .subject import DT, marionette

IMPORT = """
import time
start = time.perf_counter()
import fantoccini
print(time.perf_counter() - start)
"""

LOAD = """
import time
import fantoccini
start = time.perf_counter()
fantoccini.puppets.marionette().compile()
print(time.perf_counter() - start)
"""


def time_runs(action: Callable[[], object], runs: int) -> Samples:
    """Times of several runs [s]."""
    took = []
    for _ in range(runs):
        start = time.perf_counter()
        action()
        took.append(time.perf_counter() - start)
    return Samples(tuple(took))


def run_fresh(code: str, runs: int) -> Samples:
    """Numbers printed by a program that runs in a new interpreter every time."""
    command = [sys.executable, "-c", code]
    return Samples(
        tuple(
            float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
            for _ in range(runs)
        )
    )


def derivation(runs: int) -> Samples:
    """Tree -> equations -> source text."""
    puppet = marionette().puppet
    return time_runs(lambda: codegen.generate(equations.derive(tree.grow(puppet))), runs)


def compilation(runs: int) -> Samples:
    """Source text -> shared library, in a separate cache folder."""
    text, cache = source(), os.environ.get("FANTOCCINI_CACHE")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["FANTOCCINI_CACHE"] = folder
        try:
            keys = iter(f"{k:064x}" for k in range(runs))
            return time_runs(lambda: build.obtain(next(keys), lambda: text), runs)
        finally:
            del os.environ["FANTOCCINI_CACHE"]
            if cache is not None:
                os.environ["FANTOCCINI_CACHE"] = cache


def performance(method: str, runs: int) -> Samples:
    """The demo's performance, from inputs to trajectory."""
    x0, inputs, duration = demo.performance(marionette())
    return time_runs(
        lambda: fan.simulate(
            marionette(), x0, inputs, t_end=duration, method=method_of(method, dt=DT)
        ),
        runs,
    )


def chapter(runs: int) -> Chapter:
    """All of it, in the order of the pipeline."""
    marionette().compile()  # fills the cache
    seconds = f"{demo.DURATION:g} s demo"
    goals = [
        Goal("import fantoccini", run_fresh(IMPORT, runs), 0.5, False),
        Goal("derivation", derivation(runs), 1.0, False),
        Goal("compile", compilation(max(2, runs // 2)), 10.0, False),
        Goal("load from cache", run_fresh(LOAD, runs), 0.2, False),
        Goal(f"{seconds}, event-driven", performance("event", runs), 0.5, False),
        Goal(f"{seconds}, steps of {time_text(DT)}", performance("timestepping", runs), 0.1, False),
    ]
    rows = [[goal.what, *spread_text(goal.measured)] for goal in goals]
    text = (
        f"Wall-clock times for the bundled marionette, {runs} times each (compilation half as "
        "often): operations once per machine, once per program, and at every run."
    )
    return Chapter(
        Section("7. From import to performance", [text, Table(["", "median", "min", "max"], rows)]),
        goals,
    )
