"""Runs very many cases and writes a list of failures: `make soak`.

A performance is run by all methods. `--runs` counts runs, so a million are a third of a million
performances, spread evenly over puppets and stages. A stage with contact has one start for each
method instead of a performance. Ctrl-C keeps the finished runs.
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import json
import multiprocessing
import os
import platform
import signal
import sys
import time
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

import fantoccini as fan
from fantoccini.kernel import build
from properties import performances, puppets, stages
from properties.check import METHODS, Result, check_case

PIECE_SIZE = 50
"""Performances that a worker runs before it reports."""

REPORT_TIMEOUT = 300.0
"""Time without a report after which the workers count as stuck [s]."""

MAX_STORED_CASES = 5
"""Cases stored for each failure of a puppet; all are counted."""

ALL_NAMES = (*puppets.ALL, *stages.ALL)
"""Names of all puppets and stages."""

RESULTS_FILE = Path(__file__).resolve().parents[2] / "benchmarks" / "soak.json"


@dataclass
class Failure:
    """A broken property of runs of one puppet.

    Attributes:
        runs: number of runs.
        cases: (seed, command that shows it) of the first ones.
    """

    runs: int = 0
    cases: list[tuple[int, str]] = field(default_factory=list)

    def add(self, runs: int, cases: list[tuple[int, str]]) -> None:
        """Add runs; the first cases by seed are kept, in any order of reports."""
        self.runs += runs
        self.cases = sorted([*self.cases, *cases])[:MAX_STORED_CASES]


@dataclass
class Tally:
    """Sums and extremes over runs.

    Attributes:
        runs, events, catches, runs_with_a_catch: counts.
        by_status: method -> status -> runs.
        worst: method -> measure -> largest value (see `check.Result`).
        failures: (broken property, puppet) -> number and places.
    """

    runs: int = 0
    events: int = 0
    catches: int = 0
    runs_with_a_catch: int = 0
    by_status: dict = field(default_factory=lambda: {m: collections.Counter() for m in METHODS})
    worst: dict = field(default_factory=lambda: {m: collections.Counter() for m in METHODS})
    failures: dict[tuple[str, str], Failure] = field(default_factory=dict)

    def add(self, result: Result) -> None:
        """Add one run."""
        self.runs += 1
        self.events += result.events
        self.catches += result.catches
        self.runs_with_a_catch += result.catches > 0
        self.by_status[result.method][result.status] += 1
        for name in ("violation", "gap", "residual"):
            self._update_worst(result.method, name, getattr(result, name))
        for message in result.broken:
            case = (result.seed, result.command)
            self._add_failure(f"{result.method}: {message}", result.puppet, 1, [case])

    def merge(self, other: Tally) -> None:
        """Add all runs of another tally."""
        for name in ("runs", "events", "catches", "runs_with_a_catch"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for method in METHODS:
            self.by_status[method] += other.by_status[method]
            for name, value in other.worst[method].items():
                self._update_worst(method, name, value)
        for (message, puppet), failure in other.failures.items():
            self._add_failure(message, puppet, failure.runs, failure.cases)

    def add_lost(self, message: str, pieces) -> None:
        """Add pieces (puppet, first seed, number) with lost runs."""
        module = "PYTHONPATH=tests .venv/bin/python -m properties.soak --workers 1"
        for puppet, first, n in pieces:
            runs = len(METHODS) * n
            command = f"{module} --only {puppet} --seed {first} --runs {runs}"
            self._add_failure(message, puppet, runs, [(first, command)])

    def failures_by_kind(self) -> list[tuple[str, int, list[tuple[str, Failure]]]]:
        """(broken property, runs, [(puppet, failure), ...]), the most frequent first."""
        by_kind = collections.defaultdict(list)
        for (message, puppet), failure in self.failures.items():
            by_kind[message].append((puppet, failure))
        kinds = [
            (
                message,
                sum(f.runs for _, f in by_puppet),
                sorted(by_puppet, key=lambda x: -x[1].runs),
            )
            for message, by_puppet in by_kind.items()
        ]
        return sorted(kinds, key=lambda kind: -kind[1])

    def _add_failure(self, message: str, puppet: str, runs: int, cases: list) -> None:
        self.failures.setdefault((message, puppet), Failure()).add(runs, cases)

    def _update_worst(self, method: str, name: str, value: float) -> None:
        self.worst[method][name] = max(self.worst[method][name], value)


def run_performances(puppet: str, first: int, n: int, methods: tuple[str, ...] = METHODS) -> Tally:
    """Run n performances of a puppet, or of a stage.

    Args:
        puppet: name in `puppets.ALL` or `stages.ALL`.
        first: seed of the first performance.
        n: number of performances.
        methods: methods; the event-driven one, which tests whether the inputs are possible, runs
            first.
    """
    tally = Tally()
    if puppet in stages.ALL:
        for seed in range(len(methods) * first, len(methods) * (first + n)):
            tally.add(stages.check_stage(puppet, seed))
        return tally
    for seed in range(first, first + n):
        performance = performances.draw_performance(puppet, seed)
        event_result = check_case(puppet, seed, "event", performance)
        tally.add(event_result)
        for method in methods[1:]:
            tally.add(
                check_case(puppet, seed, method, performance, fan.Status[event_result.status])
            )
    return tally


def split_into_pieces(names: list[str], performances: int, seed: int):
    """(puppet, first seed, number) of pieces with this total of performances, puppets in turn."""
    remaining, first = performances, seed
    while remaining > 0:
        for k, name in enumerate(names):
            n = min(PIECE_SIZE, -(-remaining // (len(names) - k)))
            if n > 0:
                yield name, first, n
            remaining -= n
        first += PIECE_SIZE


def soak(
    names: list[str],
    runs: int,
    seed: int,
    workers: int,
    progress=None,
    methods: tuple[str, ...] = METHODS,
) -> Tally:
    """Run cases in several processes; Ctrl-C returns the tally of the finished ones.

    Args:
        names: names of puppets and stages.
        runs: number of runs, over all methods.
        seed: seed of the first performance of each puppet.
        workers: processes.
        progress: called with the tally.
        methods: see `run_performances`.
    """
    for name in names:  # once, not by every worker
        if name in stages.ALL:
            stages.load(name).compile()
            continue
        puppets.load(name).compile()
        for method in methods:
            puppets.load(name).libraries.library_of(method)
    tally, todo = Tally(), split_into_pieces(names, -(-runs // len(methods)), seed)
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_ignore_interrupts) as pool:
        pieces_by_future: dict[Future, tuple] = {}
        with contextlib.suppress(KeyboardInterrupt):
            while True:
                # Only the pieces needed by the workers are queued, so that Ctrl-C ends soon.
                while len(pieces_by_future) < 2 * workers and (piece := next(todo, None)):
                    pieces_by_future[pool.submit(run_performances, *piece, methods)] = piece
                if not pieces_by_future:
                    break
                done, _ = wait(
                    pieces_by_future, timeout=REPORT_TIMEOUT, return_when=FIRST_COMPLETED
                )
                broke = any(isinstance(f.exception(), BrokenProcessPool) for f in done)
                if broke or not done:
                    message = "a worker died" if broke else f"no answer within {REPORT_TIMEOUT} s"
                    tally.add_lost(message, pieces_by_future.values())
                    for process in multiprocessing.active_children():
                        process.kill()
                    break
                for future in done:
                    del pieces_by_future[future]
                    tally.merge(future.result())
                if progress:
                    progress(tally)
        pool.shutdown(cancel_futures=True)
    return tally


def _ignore_interrupts() -> None:
    """Ignore Ctrl-C, which is for the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def report(tally: Tally, names: list[str], seed: int, seconds: float) -> dict:
    """Content of `soak.json`."""
    return {
        "runs": tally.runs,
        "puppets": len(names),
        "seed": seed,
        "events": tally.events,
        "catches": tally.catches,
        "runs_with_a_catch": tally.runs_with_a_catch,
        "by_status": {m: dict(tally.by_status[m].most_common()) for m in METHODS},
        "worst_violation": {m: tally.worst[m]["violation"] for m in METHODS},
        "worst_gap_under_tension": {m: tally.worst[m]["gap"] for m in METHODS},
        "worst_ledger_residual": {m: tally.worst[m]["residual"] for m in METHODS},
        "failures": [
            {
                "what": message,
                "puppet": puppet,
                "runs": failure.runs,
                "seeds": [seed for seed, _ in failure.cases],
                "command": failure.cases[0][1],
            }
            for message, _, by_puppet in tally.failures_by_kind()
            for puppet, failure in by_puppet
        ],
        "seconds": round(seconds, 1),
        "machine": machine(),
    }


def machine() -> dict[str, str]:
    """Description of the machine, without names of hosts or folders."""
    names = [platform.machine()]
    with contextlib.suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
        names = [x.split(":", 1)[1].strip() for x in lines if x.startswith("model name")] or names
    return {
        "processor": f"{names[0]}, {os.cpu_count()} cores",
        "system": f"{platform.system()} {platform.machine()}",
        "compiler": build.find_compiler().version,
        "python": platform.python_version(),
        "fantoccini": fan.__version__,
        **{name: metadata.version(name) for name in ("casadi", "numpy")},
    }


def main() -> int:
    """Run the soak, write and print its results; 1 when a property is broken."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=1_000_000, help="(default 1,000,000)")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="(default: all cores)")
    parser.add_argument("--seed", type=int, default=0, help="first seed of every puppet")
    parser.add_argument("--only", choices=list(ALL_NAMES), action="append", help="one of them")
    parser.add_argument(
        "--out", type=Path, default=RESULTS_FILE, help="(default benchmarks/soak.json)"
    )
    options = parser.parse_args()
    names = options.only or list(ALL_NAMES)
    start = time.perf_counter()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeRemainingColumn()) as bar:
        task = bar.add_task("soaking", total=options.runs)

        def show(tally: Tally) -> None:
            broken = sum(failure.runs for failure in tally.failures.values())
            bar.update(task, completed=tally.runs, description=f"soaking, {broken} broken")

        tally = soak(names, options.runs, options.seed, options.workers, show)
    results = report(tally, names, options.seed, time.perf_counter() - start)
    options.out.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    Console().print_json(json.dumps({k: v for k, v in results.items() if k != "failures"}))
    for message, runs, results in tally.failures_by_kind():
        puppet, failure = results[0]
        print(f"{runs:>8}  {message} (of {len(results)} puppets, {failure.runs} {puppet})")
        print(f"{'':10}{failure.cases[0][1]}")
    return int(bool(tally.failures))


if __name__ == "__main__":
    sys.exit(main())
