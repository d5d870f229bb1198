"""Prints how fast the bundled 25-DOF marionette is, beside the marks that are to be met.

``make bench`` runs this. Every figure is the median of several runs, with the fastest and the
slowest beside it. Nothing here is a test: machines differ, and so do their neighbours.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

import fantoccini as fan
from fantoccini import build, codegen, demo, equations, tree
from fantoccini.build.compiler import BASE_FLAGS
from fantoccini.motion import Input
from fantoccini.world import World

HERE = Path(__file__).resolve().parent

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
fantoccini.puppets.marionette().library
print(time.perf_counter() - start)
"""


@dataclass(frozen=True)
class Figure:
    """One measured figure.

    Attributes:
        name: what was timed.
        seconds: one number a run.
        mark: what the median is to stay below [s].
    """

    name: str
    seconds: tuple[float, ...]
    mark: float

    @property
    def median(self) -> float:
        return statistics.median(self.seconds)

    @property
    def met(self) -> bool:
        return self.median <= self.mark


def timed(action: Callable[[], object], runs: int) -> tuple[float, ...]:
    """Seconds that each of some runs takes."""
    took = []
    for _ in range(runs):
        start = time.perf_counter()
        action()
        took.append(time.perf_counter() - start)
    return tuple(took)


def fresh(code: str, runs: int) -> tuple[float, ...]:
    """What a program prints that runs in a new interpreter every time."""
    command = [sys.executable, "-c", code]
    return tuple(
        float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
        for _ in range(runs)
    )


def derivation(runs: int) -> tuple[float, ...]:
    """Tree -> equations -> source text."""
    puppet = fan.puppets.marionette().puppet
    return timed(lambda: codegen.generate(equations.derive(tree.grow(World.of(puppet)))), runs)


def compilation(runs: int) -> tuple[float, ...]:
    """Source text -> shared library, in a cache folder of its own."""
    marionette = fan.puppets.marionette()
    generated = codegen.generate(marionette.equations)
    source = build.Source(generated.files, generated.main, units=generated.units)
    kept = os.environ.get("FANTOCCINI_CACHE")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["FANTOCCINI_CACHE"] = folder
        try:
            keys = iter(f"{k:064x}" for k in range(runs))
            return timed(lambda: build.obtain(next(keys), lambda: source), runs)
        finally:
            del os.environ["FANTOCCINI_CACHE"]
            if kept is not None:
                os.environ["FANTOCCINI_CACHE"] = kept


def evaluation(runs: int) -> tuple[float, ...]:
    """Accelerations and tensions with all strings taut, compiled as the library is."""
    marionette = fan.puppets.marionette()
    x0 = marionette.rest()
    bound = Input.hold(marionette).bound(x0.q_K, 0.0)
    generated = codegen.generate(marionette.equations)
    source = build.Source(generated.files, generated.main)
    with tempfile.TemporaryDirectory() as folder:
        for name, text in generated.files.items():
            Path(folder, name).write_text(text, encoding="utf-8")
        flags = [f for f in (*BASE_FLAGS, *build.default_flags(source)) if f != "-shared"]
        include = ["-I", folder, "-I", str(build.runtime_folder())]
        program = str(Path(folder, "evaluate"))
        command = [*build.find_compiler().command, *flags, *include]
        subprocess.run([*command, str(HERE / "evaluate.cpp"), "-o", program], check=True)
        parts = [[runs, 20_000], x0.q_D, x0.v_D, marionette.p, [len(bound.coef)]]
        parts += [bound.breaks, bound.coef, bound.base]
        words = "\n".join(repr(float(x)) for part in parts for x in np.ravel(part))
        done = subprocess.run([program], input=words, capture_output=True, text=True, check=True)
    *seconds, tension = map(float, done.stdout.split())
    if not 0.5 * marionette.weight < tension < 2 * marionette.weight:
        raise RuntimeError(f"the strings carry {tension} N of {marionette.weight} N")
    return tuple(seconds)


def performance(method: str, runs: int) -> tuple[float, ...]:
    """The demo's performance, from inputs to trajectory."""
    marionette = fan.puppets.marionette()
    x0, inputs, duration = demo.performance(marionette)
    return timed(
        lambda: fan.simulate(marionette, x0, inputs, t_end=duration, method=method, dt=0.002), runs
    )


def measure(runs: int) -> list[Figure]:
    """All figures, in the order of the pipeline."""
    fan.puppets.marionette().library  # noqa: B018  (fills the cache)
    few = max(2, runs // 2)
    duration = demo.DURATION
    return [
        Figure("import fantoccini", fresh(IMPORT, runs), 0.5),
        Figure("derivation", derivation(runs), 1.0),
        Figure("compile", compilation(few), 10.0),
        Figure("load from cache", fresh(LOAD, runs), 0.2),
        Figure("one constrained evaluation", evaluation(max(9, runs)), 2e-6),
        Figure(f"{duration:g} s demo, event-driven", performance("event", runs), 0.5),
        Figure(f"{duration:g} s demo, steps of 2 ms", performance("timestepping", runs), 0.1),
    ]


def machine() -> dict[str, str]:
    """Where the figures were measured."""
    names = [platform.processor() or platform.machine()]
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
        names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    except OSError:
        pass
    packages = ("fantoccini", "casadi", "numpy")
    return {
        "processor": f"{names[0] if names else platform.machine()}, {os.cpu_count()} cores",
        "system": platform.platform(),
        "compiler": build.find_compiler().version,
        "python": platform.python_version(),
        **{name: _version(name) for name in packages},
    }


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return fan.__version__ if package == "fantoccini" else "unknown"


def shown(seconds: float) -> str:
    """Seconds with a fitting unit."""
    for unit, factor in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= factor:
            return f"{seconds / factor:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def print_table(figures: list[Figure], where: dict[str, str]) -> None:
    """The figures for a reader."""
    console = Console()
    for name, value in where.items():
        console.print(f"{name:>10}  {value}", highlight=False)
    table = Table("25-DOF marionette, 7 strings")
    for title in ("median", "min", "max", "mark"):
        table.add_column(title, justify="right")
    table.add_column("")
    for f in figures:
        numbers = (f.median, min(f.seconds), max(f.seconds), f.mark)
        verdict = "[green]pass[/green]" if f.met else "[red]fail[/red]"
        table.add_row(f.name, *map(shown, numbers), verdict)
    console.print(table)


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--runs", type=int, default=7, help="runs of each figure (default 7)")
    options = parser.parse_args()
    figures, where = measure(max(1, options.runs)), machine()
    if options.json:
        keys = ("name", "median", "seconds", "mark", "met")
        rows = [{k: getattr(f, k) for k in keys} for f in figures]
        print(json.dumps({"machine": where, "figures": rows}, indent=1))
    else:
        print_table(figures, where)


if __name__ == "__main__":
    main()
