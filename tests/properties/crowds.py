"""Very many short runs of stages, mostly in compiled batches: `make soak-crowds`.

A crowd is a stage with the rules, obstacles and step of its seed, and many random starts and
inputs, which run in lanes (`timestepping`) or one by one in C++ (`event`). A run is short, and
begins near a collision. A crowd may also consist of performances (`live`), in which hands throw the
puppets about. `python -m properties.crowds STAGE SEED METHOD I` runs the I-th run of a crowd alone
and prints broken properties.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
import zlib
from collections import Counter
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

import fantoccini as fan
from fantoccini import Status
from properties import stages, throws
from properties.check import INACCURATE_STATUSES

RUNS_PER_CROWD = {"timestepping": 256, "event": 16, "live": 8}
"""Runs of a crowd, by method."""
RUN_SHARES = {"event": 0.002, "live": 0.001}
"""Shares of event-driven and live runs, which take up to a thousand times as long."""
STEP_RANGE = (40, 120)
"""Steps of a run with fixed steps."""
DURATION_RANGE = (0.1, 0.6)
"""Duration of an event-driven run [s]."""
STEPS_PER_SAMPLE = 4
"""Steps between samples."""
MAX_DRAWS = 8
"""Maximum number of crowds of candidates, drawn until enough of them are free of overlaps."""
EXPECTED_STATUSES = {
    "timestepping": stages.EXPECTED_STATUSES,
    "event": {
        Status.DONE,
        Status.TOO_MANY_EVENTS,
        Status.NO_UNIQUE_MOTION,
        Status.TOO_MANY_CONTACTS,
        Status.COLLAPSED,
        Status.LENGTH_NOT_POSITIVE,
        Status.IMPOSSIBLE_INPUT,
        Status.RUNAWAY,
        Status.REDUNDANT_STRINGS,
        Status.NOT_SETTLED,
    },
}
"""Expected statuses."""
MAX_LEDGER_RESIDUAL = {"timestepping": stages.MAX_LEDGER_RESIDUAL, "event": 1e-6}
"""Bound on the ledger's residual, relative to the energy of the stage."""
MAX_OVERLAP = {"timestepping": stages.MAX_OVERLAP, "event": 1e-9}
"""Depth beyond which a run may not be DONE [m]."""
MAX_CONTACT_RESIDUAL = {"timestepping": stages.MAX_CONTACT_RESIDUAL, "event": 1e-3}
"""Residual of the laws of contact beyond which a sample is broken, relative."""
CPU_TIME_LIMIT = 60.0
"""Time of the processor after which an event-driven run is stopped, and counts as hung [s]."""
REPORT_TIMEOUT = 1200.0
"""Time without a report after which the workers count as stuck [s]."""
MAX_COMMANDS = 5
"""Commands stored for each failure; all are counted."""
RESULTS_FILE = Path(__file__).resolve().parents[2] / "benchmarks" / "soak_crowds.json"


@dataclass(frozen=True, eq=False)
class Crowd:
    """Runs of one seed: n starts, an input for each, and a method."""

    marionette: fan.Marionette
    starts: list[fan.State]
    inputs: fan.motion.Inputs | None
    t_end: float
    method: fan.TimeStepping | fan.Event


@dataclass
class Count:
    """Sums and extremes over runs.

    Attributes:
        runs, touched: number of runs, and of those in which solids lost energy to one another.
        by_status: method -> status -> runs.
        worst: method -> measure -> largest value of a run that arrived.
        failures: broken property -> runs.
        commands: broken property -> commands that show it.
    """

    runs: int = 0
    touched: int = 0
    by_status: dict[str, Counter] = field(default_factory=dict)
    worst: dict[str, dict[str, float]] = field(default_factory=dict)
    failures: Counter = field(default_factory=Counter)
    commands: dict[str, list[str]] = field(default_factory=dict)

    def merge(self, other: Count) -> None:
        """Add all runs of another count."""
        self.runs += other.runs
        self.touched += other.touched
        for method, statuses in other.by_status.items():
            self.by_status.setdefault(method, Counter()).update(statuses)
        for method, measures in other.worst.items():
            own_worst = self.worst.setdefault(method, {})
            for name, value in measures.items():
                own_worst[name] = max(own_worst.get(name, 0.0), value)
        self.failures.update(other.failures)
        for message, commands in other.commands.items():
            self.commands[message] = sorted([*self.commands.get(message, []), *commands])[
                :MAX_COMMANDS
            ]


def case_command(name: str, seed: int, method: str, i: int | None = None) -> str:
    """Command that repeats a crowd, or one of its runs."""
    number = "" if i is None else f" {i}"
    return f"PYTHONPATH=tests .venv/bin/python -m properties.crowds {name} {seed} {method}{number}"


def draw_crowd(name: str, seed: int, method: str) -> Crowd | None:
    """The crowd of a stage and seed; None if nothing fits among its obstacles."""
    rng = np.random.default_rng([seed, zlib.crc32(f"{name} {method}".encode())])
    marionette, n = stages.draw_stage(name, rng), RUNS_PER_CROWD[method]
    dt = float(np.exp(rng.uniform(np.log(5e-4), np.log(4e-3))))
    duration = (
        float(rng.uniform(*DURATION_RANGE)) if method == "event" else rng.integers(*STEP_RANGE) * dt
    )
    t_end = float(duration)
    starts = _draw_starts(rng, marionette, n)
    if not starts:
        return None
    inputs = None
    if marionette.coordinates.n_vK and rng.random() < 0.6:
        inputs = fan.motion.Inputs.random(
            marionette,
            len(starts),
            seed,
            t_end=t_end,
            every=float(rng.uniform(0.04, 0.1)),
            reach=float(rng.choice([0.003, 0.03])),
            turn=float(rng.choice([0.02, 0.2])),
        )
    options = fan.Event() if method == "event" else fan.TimeStepping(dt=dt)
    return Crowd(marionette, starts, inputs, t_end, options)


def _draw_starts(rng: np.random.Generator, marionette: fan.Marionette, n: int) -> list[fan.State]:
    """Thrown bodies at random places without overlaps; strings longer than needed."""
    table, x = marionette.coordinates, marionette.state()
    spread, states = float(rng.choice([0.15, 0.3])), []
    lengths = [s.length_index for s in marionette.tree.strings]
    for k in range(MAX_DRAWS):
        q = np.tile(x.q_D, (n, 1))
        for q_index, _ in table.quaternions_D:
            tilt = np.where(rng.random((n, 1)) < 0.3, 0.02, 1.0)
            quaternion = rng.normal(size=(n, 4)) * tilt + [1, 0, 0, 0]
            q[:, q_index : q_index + 4] = quaternion / np.linalg.norm(quaternion, axis=1)[:, None]
            name = table.q_D[q_index].rpartition(".")[0]
            if f"{name}.x" in table.q_D:
                x_index = table.q_D.index(f"{name}.x")
                low, high = (-0.2, 0.5) if "trunk" in name else (0.05, 2.0)
                position = rng.uniform([-1, -1, low], [1, 1, high], (n, 3))
                q[:, x_index : x_index + 3] = position * spread * (1.0 + 0.2 * k)
        q_K = np.tile(x.q_K, (n, 1))
        rows = marionette.library.evaluate("rows", q_D=q, q_K=q_K, p=marionette.p).h
        for row, length_place in enumerate(lengths):
            if length_place is not None:
                q_K[:, length_place[0]] += rows[:, row] + rng.choice([0.001, 0.02])
        limits = rows[:, len(lengths) :]
        v = rng.normal(size=(n, len(x.v_D))) * rng.choice([0.0, 0.3, 2.0, 8.0], (n, 1))
        v *= rng.random(v.shape) < 0.7
        for i in np.flatnonzero(np.all(limits <= 0.0, axis=1)):
            if not marionette.overlaps(q[i], q_K[i]):
                states.append(x.replace(q_D=q[i], q_K=q_K[i], v_D=v[i]))
            if len(states) == n:
                return states
    return states


def run_crowd(crowd: Crowd) -> fan.Trajectories:
    """The runs of a crowd, on one thread."""
    save_options = {} if isinstance(crowd.method, fan.Event) else {"save_every": STEPS_PER_SAMPLE}
    times = np.linspace(0.0, crowd.t_end, 9) if isinstance(crowd.method, fan.Event) else None
    start_time = time.process_time()

    def watch(_: object) -> None:
        if time.process_time() - start_time > CPU_TIME_LIMIT * len(crowd.starts):
            raise KeyboardInterrupt  # the partial run is kept, with the status STOPPED

    return fan.simulate_batch(
        crowd.marionette,
        crowd.starts,
        crowd.inputs,
        crowd.t_end,
        method=crowd.method,
        save=("q_D", "v_D", "ledger", "contact_residual"),
        save_at=times,
        threads=1,
        progress=watch,
        **save_options,
    )


def single_run(crowd: Crowd, i: int) -> Crowd:
    """The i-th run of a crowd, alone."""
    inputs = crowd.inputs
    if inputs is not None:
        bound = inputs.bound(np.array([x.q_K for x in crowd.starts]))
        inputs = fan.motion.Inputs.stack([bound[i]])
    return Crowd(crowd.marionette, [crowd.starts[i]], inputs, crowd.t_end, crowd.method)


def broken_properties(
    crowd: Crowd, runs: fan.Trajectories
) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Broken property -> (n,) bool of the runs; and the largest measures."""
    method = runs.method
    status, done = runs.status, runs.status == Status.DONE
    reached = np.nan_to_num(runs.reached)[:, None] >= runs.t - 1e-12
    is_finite = np.ones(len(status), dtype=bool)
    for array in (runs.q_D, runs.v_D, runs.ledger.values, runs.contact_residual[..., None]):
        is_finite &= np.all(np.isfinite(array) | ~reached[..., None], axis=(1, 2))
    contact_residual = np.max(np.where(reached, np.nan_to_num(runs.contact_residual), 0.0), axis=1)
    q_K = np.array([x.q_K for x in crowd.starts])
    if crowd.inputs is not None:
        bound = crowd.inputs.bound(q_K)
        q_K = np.array([bound[i].evaluate(crowd.t_end)[0] for i in range(len(bound))])
    depth = np.zeros(len(status))
    for i in np.flatnonzero(done):
        overlaps = crowd.marionette.overlaps(runs.q_D[i, -1], q_K[i])
        depth[i] = max(overlaps.values(), default=0.0)
    ledger = {
        n: np.nan_to_num(runs.ledger[n]) for n in ("kinetic", "potential", "work", "residual")
    }
    energy_scale = np.max(np.abs(ledger["kinetic"]), axis=1) + np.max(
        np.abs(ledger["work"]), axis=1
    )
    energy_scale += np.ptp(
        np.where(reached, ledger["potential"], ledger["potential"][:, :1]), axis=1
    )
    residual = np.max(np.abs(ledger["residual"]), axis=1) / (energy_scale + crowd.marionette.weight)
    is_unbalanced = done & (residual > MAX_LEDGER_RESIDUAL[method])
    turns_slowly = np.full(len(status), crowd.inputs is None)
    if isinstance(crowd.method, fan.TimeStepping):
        # Some turn faster between the samples.
        turns_slowly &= _largest_turns(crowd, runs) < stages.MAX_TURN / 3.0
    expected = np.isin(status, [int(s) for s in EXPECTED_STATUSES[method]])
    failures = {
        "is not finite": ~is_finite,
        "ends before its end as DONE": done & ~(runs.reached >= crowd.t_end - 1e-9),
        "overlaps silently": done & (depth > MAX_OVERLAP[method]),
        "breaks the law of contact silently": done
        & (contact_residual > MAX_CONTACT_RESIDUAL[method]),
        "the ledger does not close silently": is_unbalanced,
        "the ledger does not close": turns_slowly & np.isin(status, list(INACCURATE_STATUSES)),
    } | {f"ends with {Status(int(s)).name}": status == s for s in np.unique(status[~expected])}
    worst = {
        "overlap": float(np.max(depth, initial=0.0)),
        "law": float(np.max(contact_residual[done], initial=0.0)),
        "residual": float(np.max(residual[done], initial=0.0)),
    }
    return failures, worst


def _largest_turns(crowd: Crowd, runs: fan.Trajectories) -> np.ndarray:
    """(n,) largest turn of a body in a step [rad]."""
    table, v = crowd.marionette.coordinates, np.abs(np.nan_to_num(runs.v_D))
    rows = [v[..., v_index : v_index + 3] for _, v_index in table.quaternions_D]
    rows += [
        v[..., v_index : v_index + 1] for q, v_index in table.scalars_D if "leg" in table.q_D[q]
    ]
    return crowd.method.dt * np.max([np.max(speeds, axis=(1, 2)) for speeds in rows], axis=0)


def count_crowd(name: str, seed: int, method: str) -> Count:
    """Run a crowd and count: in lanes, or one by one, each within its limit of time."""
    if method == "live":
        return count_throws(name, seed)
    crowd, count = draw_crowd(name, seed, method), Count()
    if crowd is None:
        return count
    in_lanes = isinstance(crowd.method, fan.TimeStepping)
    for first in range(1 if in_lanes else len(crowd.starts)):
        subset = crowd if in_lanes else single_run(crowd, first)
        runs = run_crowd(subset)
        failures, worst = broken_properties(subset, runs)
        names = Counter(Status(int(s)).name for s in runs.status)
        energy_lost = np.nan_to_num(runs.ledger["friction"]) + np.nan_to_num(runs.ledger["impact"])
        touched = int(np.sum(np.max(energy_lost, axis=1) > 0.0))
        run_count = Count(len(runs.status), touched, {method: names}, {method: worst})
        for message, is_broken in failures.items():
            run_indices = first + np.flatnonzero(is_broken)
            if len(run_indices):
                key = f"{name}, {method}: {message}"
                run_count.failures[key] = len(run_indices)
                run_count.commands[key] = [
                    case_command(name, seed, method, int(i)) for i in run_indices[:MAX_COMMANDS]
                ]
        count.merge(run_count)
    return count


def count_throws(name: str, seed: int) -> Count:
    """Throw the puppets of a stage about live, and count."""
    count = Count()
    for i in range(RUNS_PER_CROWD["live"]):
        result = throws.throw_puppets(name, seed, i)
        if result is None:
            continue
        worst = {"overlap": result.overlap, "energy": result.energy}
        run_count = Count(
            1, int(result.touched), {"live": Counter([result.status])}, {"live": worst}
        )
        for message in result.broken:
            key = f"{name}, live: {message}"
            run_count.failures[key] = 1
            run_count.commands[key] = [case_command(name, seed, "live", i)]
        count.merge(run_count)
    return count


def check_single_run(name: str, seed: int, method: str, i: int) -> list[str]:
    """Broken properties of the i-th run of a crowd, run alone."""
    if method == "live":
        result = throws.throw_puppets(name, seed, i)
        print(result)
        return [] if result is None else list(result.broken)
    crowd = draw_crowd(name, seed, method)
    assert crowd is not None
    single_crowd = single_run(crowd, i)
    runs = run_crowd(single_crowd)
    failures, worst = broken_properties(single_crowd, runs)
    print(Status(int(runs.status[0])).name, worst)
    return [message for message, is_broken in failures.items() if is_broken[0]]


def crowd_cases(names: list[str], seed: int, shares: dict[str, float]):
    """(stage, seed, method) of an endless series of crowds: most with fixed steps, shares of the
    others.
    """
    counts = dict.fromkeys(RUNS_PER_CROWD, 0)
    stages_of = {method: names for method in RUNS_PER_CROWD}
    stages_of["live"] = [name for name in names if name in throws.STAGES]
    rare_methods = [method for method, share in shares.items() if share > 0.0 and stages_of[method]]
    k = dict.fromkeys(RUNS_PER_CROWD, 0)
    while True:
        total = sum(counts.values())
        method = next((m for m in rare_methods if counts[m] < shares[m] * total), "timestepping")
        counts[method] += RUNS_PER_CROWD[method]
        method_stages = stages_of[method]
        yield (
            method_stages[k[method] % len(method_stages)],
            seed + k[method] // len(method_stages),
            method,
        )
        k[method] += 1


def soak(
    names: list[str], n: int, seed: int, workers: int, shares: dict[str, float], progress=None
) -> Count:
    """Run crowds in several processes until n runs are done; Ctrl-C returns the present count."""
    for name in names:  # once, not by every worker
        for method in ("timestepping", "event"):
            stages.load(name).libraries.batch_library_of(method)
        stages.load(name).libraries.library_of("timestepping")
    count, context = Count(), multiprocessing.get_context("spawn")
    cases_by_future: dict[Future, tuple[str, int, str]] = {}
    remaining_cases = crowd_cases(names, seed, shares)
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        try:
            while True:
                while count.runs < n and len(cases_by_future) < 2 * workers:
                    case = next(remaining_cases)
                    cases_by_future[pool.submit(count_crowd, *case)] = case
                if not cases_by_future:
                    break
                done, _ = wait(cases_by_future, timeout=REPORT_TIMEOUT, return_when=FIRST_COMPLETED)
                if not done:
                    for case in cases_by_future.values():
                        count.failures["no answer"] += 1
                        count.commands.setdefault("no answer", []).append(case_command(*case))
                    for process in multiprocessing.active_children():
                        process.kill()
                    break
                for future in done:
                    case = cases_by_future.pop(future)
                    try:
                        count.merge(future.result())
                    except Exception as error:  # A crash of a worker is a failure to report.
                        message = f"{type(error).__name__}: {str(error)[:200]}"
                        count.failures[message] += 1
                        count.commands.setdefault(message, []).append(case_command(*case))
                        if type(error).__name__ == "BrokenProcessPool":
                            return count
                if progress:
                    progress(count)
        except KeyboardInterrupt:
            pool.shutdown(cancel_futures=True)
    return count


def main() -> int:
    """Run the soak, write and print its results; 1 when a property is broken."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("case", nargs="*", help="STAGE SEED METHOD [I]: one crowd, or one run")
    parser.add_argument("--runs", type=int, default=1_000_000, help="(default 1,000,000)")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="(default: all)")
    parser.add_argument("--seed", type=int, default=0, help="first seed of every stage")
    for method, share in RUN_SHARES.items():
        parser.add_argument(f"--{method}", type=float, default=share, help=f"part that is {method}")
    parser.add_argument("--only", choices=list(stages.ALL), action="append", help="one of them")
    parser.add_argument("--out", type=Path, default=RESULTS_FILE, help="(default %(default)s)")
    options = parser.parse_args()
    if options.case:
        name, seed, method, *number = options.case
        if number:
            failures = check_single_run(name, int(seed), method, int(number[0]))
            print("broken:", *(failures or ["nothing"]), sep="\n  ")
            return int(bool(failures))
        count = count_crowd(name, int(seed), method)
    else:
        names, start = options.only or list(stages.ALL), time.perf_counter()
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
        with Progress(*columns, TimeRemainingColumn()) as bar:
            task = bar.add_task("soaking", total=options.runs)

            def show(count: Count) -> None:
                text = f"soaking, {sum(count.failures.values())} broken"
                bar.update(task, completed=count.runs, description=text)

            shares = {method: getattr(options, method) for method in RUN_SHARES}
            count = soak(names, options.runs, options.seed, options.workers, shares, show)
        seconds = round(time.perf_counter() - start, 1)
        report = {
            "runs": count.runs,
            "touched": count.touched,
            "stages": names,
            "seed": options.seed,
            "seconds": seconds,
            "by_status": {m: dict(c.most_common()) for m, c in count.by_status.items()},
            "worst": count.worst,
            "failures": {w: [k, count.commands[w]] for w, k in count.failures.most_common()},
        }
        options.out.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
        print(f"{count.runs} runs in {seconds} s")
    print(f"{count.touched} of {count.runs} touched", count.by_status, count.worst)
    for message, k in count.failures.most_common():
        print(f"{k:>8}  {message}\n{'':10}{count.commands[message][0]}")
    return int(bool(count.failures))


if __name__ == "__main__":
    sys.exit(main())
