"""``sweep``: a study run for many cases, on threads or a cluster, resumable.

A study is a function, and a case one combination of values to which it is applied.
"""

from __future__ import annotations

import sys
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any, Literal

from fantoccini.base import OnProgress, Progress, SweepStopped, reporting
from fantoccini.dynamics.marionette import Marionette
from fantoccini.lab.sweeps.case import Case
from fantoccini.lab.sweeps.design import (
    Design,
    Distribution,
    VariedValues,
    check_integer,
    make_design,
)
from fantoccini.lab.sweeps.executors import Executor, ThreadExecutor
from fantoccini.lab.sweeps.identity import study_digest, study_name
from fantoccini.lab.sweeps.outcome import Failure, Job, Outcome, Study
from fantoccini.lab.sweeps.ray_executor import RayExecutor
from fantoccini.lab.sweeps.result import SweepResult
from fantoccini.lab.sweeps.store import Store
from fantoccini.model.puppet import Puppet
from fantoccini.model.scene import Scene


@dataclass(frozen=True)
class Dispatch:
    """Settings for handing cases to an executor.

    Attributes:
        poll_timeout: longest wait for a completed task, so that Ctrl-C is noticed soon [s].
        max_cases_per_task: bound on a task of very short cases.
        recent_cases: number of cases whose median duration predicts the next one's.
        max_worker_deaths: number of workers that a case may end before it counts as failed; one
            death may be the fault of another case.
    """

    poll_timeout: float = 0.2
    max_cases_per_task: int = 1000
    recent_cases: int = 15
    max_worker_deaths: int = 2


DISPATCH = Dispatch()


def sweep(
    study: Study,
    over: VariedValues | None = None,
    *,
    puppet: Marionette | Puppet | Scene | None = None,
    draw: Mapping[str, Distribution] | None = None,
    seeds: int | None = None,
    seed: int = 0,
    on: Literal["threads", "ray"] = "threads",
    workers: int | None = None,
    address: str | None = None,
    store: str | Path | None = None,
    version: str | None = None,
    retry: bool = False,
    progress: bool | OnProgress = True,
) -> SweepResult:
    """Runs a study for every case of a grid, a list or a Monte-Carlo sample.

    A case that fails is reported in the result and does not stop the others. The outcome of a case
    depends on its values and the seed alone: not on the order, the workers, or other cases.

    Args:
        study: called with every :class:`Case`; returns a dict: name -> number, text or array.
            :class:`Trial` is a ready-made study.
        over: the values to vary. A dict of lists gives all combinations (the last name is the
            fastest), a list of dicts one case per dict. A list may also be a dict: label -> value.
            Values are numbers, texts, arrays, inputs, states, or lists and dicts of them;
            ``puppet`` takes marionettes, and ``p:NAME`` is a parameter of the puppet.
        puppet: the puppet of all cases, unless ``over`` has one.
        draw: random values for every case: a range (low, high), a distribution of
            ``scipy.stats``, or a function of a NumPy generator.
        seeds: repetitions of every case, each with its own random numbers; the last axis of the
            results is then ``repeat``.
        seed: seed of all random numbers.
        on: ``threads`` of this process, or ``ray``: the cluster that ``ray.init`` joined, the one
            at ``address``, or one started on this machine for the duration of the sweep.
        workers: cases at a time; when not given, one per core or per processor of the cluster.
        address: address of a Ray cluster, as ``ray.init`` takes it.
        store: a folder that keeps every finished case. The same sweep, or one with more values or
            seeds, reads those and runs only the others.
        version: version of the study, for the store; a store of another version is refused. By
            default it is a digest of the study's code, without the functions that it calls.
        retry: run stored cases that failed again.
        progress: whether to show a bar on a terminal; or a callback for the cases done and failed.

    Returns:
        The figures, shaped like the grid, and the failures.

    Raises:
        StoreError: the store belongs to another sweep, or cannot be written.
        SweepStopped: Ctrl-C; the error carries the finished cases.
    """
    if not callable(study):
        raise TypeError(f"study is {study!r:.80}; it must be a function of a case, or a Trial")
    if on not in ("threads", "ray"):
        raise ValueError(f"on is {on!r}; it must be 'threads' or 'ray'")
    workers = None if workers is None else check_integer("workers", workers, 1)
    if address is not None and on != "ray":
        raise ValueError("address goes with on='ray'")
    design = make_design(over, draw, seeds, seed, puppet)
    case_store = None if store is None else Store(store, _manifest(study, design, seed, version))
    outcomes: list[Outcome | None] = [None] * len(design.cases)
    if case_store is not None:
        outcomes = [case_store.read(key) for key in design.keys]
        if retry:
            outcomes = [None if o is not None and o.failure else o for o in outcomes]
    remaining = [
        case for case, outcome in zip(design.cases, outcomes, strict=True) if outcome is None
    ]
    if remaining:
        job = Job(study, design.puppets, design.names)
        try:
            executor: Executor = (
                RayExecutor(job, workers, address) if on == "ray" else ThreadExecutor(job, workers)
            )
            try:
                with reporting("sweeping", _callback(progress), counted=True) as report:
                    _run(executor, remaining, Recorder(design, outcomes, case_store, report))
            finally:
                executor.close()
        except KeyboardInterrupt:
            raise SweepStopped(
                _stop_message(outcomes, store), SweepResult(design, outcomes)
            ) from None
    return SweepResult(design, outcomes)


def _callback(progress: bool | OnProgress) -> OnProgress | None:
    """The progress callback; None for a bar."""
    if callable(progress):
        return progress
    return None if progress else lambda event: None


class Recorder:
    """Records outcomes in the list and the store, and reports progress."""

    def __init__(
        self,
        design: Design,
        outcomes: list[Outcome | None],
        case_store: Store | None,
        report: OnProgress,
    ):
        self._design = design
        self._outcomes = outcomes
        self._store = case_store
        self._report = report
        self._done = sum(o is not None for o in outcomes)
        self._failed = sum(o is not None and o.failure is not None for o in outcomes)
        self._report_progress()

    def _report_progress(self) -> None:
        self._report(Progress(done=self._done, total=len(self._outcomes), failed=self._failed))

    def record(self, case: Case, outcome: Outcome) -> None:
        """Adds the outcome of a case."""
        if self._store is not None:
            k = case.index
            self._store.write(self._design.keys[k], outcome, self._design.labels[k])
        self._outcomes[case.index] = outcome
        self._done += 1
        self._failed += outcome.failure is not None
        self._report_progress()


def _run(executor: Executor, cases: list[Case], recorder: Recorder) -> None:
    """Submits the cases, a bounded number of tasks ahead, and records their outcomes."""
    remaining: deque[Case] = deque(cases)
    suspects: deque[Case] = deque()  # cases of a dead worker; each then runs alone in a task
    deaths: Counter[int] = Counter()
    # The median, because a worker's first case may compile a puppet.
    recent_seconds = deque([executor.task_seconds], maxlen=DISPATCH.recent_cases)
    while remaining or suspects or executor.pending:
        capacity = executor.capacity
        while (remaining or suspects) and executor.pending < capacity:
            if suspects:
                executor.submit((suspects.popleft(),))
                continue
            fitting_cases = executor.task_seconds / max(median(recent_seconds), 1e-9)
            fair_share = len(remaining) / capacity
            n = max(1, min(DISPATCH.max_cases_per_task, int(fitting_cases), int(fair_share)))
            executor.submit(tuple(remaining.popleft() for _ in range(n)))
        for task, outcomes in executor.collect(DISPATCH.poll_timeout):
            if outcomes is None:
                # One of the cases killed the worker.
                for case in task:
                    deaths[case.index] += 1
                    if deaths[case.index] < DISPATCH.max_worker_deaths:
                        suspects.append(case)
                    else:
                        recorder.record(case, Outcome({}, 0.0, _worker_death()))
                continue
            for case, outcome in zip(task, outcomes, strict=True):
                recent_seconds.append(outcome.seconds)
                recorder.record(case, outcome)


def _worker_death() -> Failure:
    return Failure(
        "WorkerDied",
        f"the process that ran this case ended {DISPATCH.max_worker_deaths} times: it crashed, "
        "was killed, or ran out of memory",
    )


def _manifest(study: Study, design: Design, seed: int, version: str | None) -> dict[str, Any]:
    """Properties that all cases of a store share."""
    code = study_digest(study) if version is None else None
    if version is None and code is None:
        raise ValueError(
            f"the study {study_name(study)} is neither a function nor a dataclass, so a store "
            "cannot tell when it changes; give version='1'"
        )
    return {
        "fantoccini": sys.modules["fantoccini"].__version__,
        "study": study_name(study),
        "version": version,
        "code": code,
        "seed": int(seed),
        "values": sorted(design.names),
    }


def _stop_message(outcomes: list[Outcome | None], store: str | Path | None) -> str:
    done = sum(o is not None for o in outcomes)
    advice = (
        f"{store} keeps them; run the same sweep again to resume"
        if store is not None
        else "the error carries them; with store='folder' a sweep can resume"
    )
    return f"stopped after {done} of {len(outcomes)} cases; {advice}"
