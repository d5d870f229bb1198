"""sweep: a study and what to vary -> SweepResult, on threads or on a cluster, resumable."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any, Literal

from fantoccini.errors import SweepStopped
from fantoccini.marionette import Marionette
from fantoccini.puppet import Puppet
from fantoccini.sweeps.bar import Progress, shown
from fantoccini.sweeps.case import Case
from fantoccini.sweeps.crew import Crew, Threads
from fantoccini.sweeps.design import Design, Draw, check_whole, designed
from fantoccini.sweeps.identity import study_digest, study_name
from fantoccini.sweeps.on_ray import RayCrew
from fantoccini.sweeps.outcome import Failure, Job, Outcome, Study
from fantoccini.sweeps.result import SweepResult
from fantoccini.sweeps.store import Store
from fantoccini.world import World

_PATIENCE = 0.2
"""Longest wait for an answer, so that Ctrl-C is heard at once [s]."""
_MOST_AT_ONCE = 1000
"""Most cases handed out together."""
_RECENT = 15
"""Cases from which one tells how long the next will take."""
_LIVES = 2
"""How many workers a case may see die before it is given up."""


def sweep(
    study: Study,
    over: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None = None,
    *,
    puppet: Marionette | Puppet | World | None = None,
    draw: Mapping[str, Draw] | None = None,
    seeds: int | None = None,
    seed: int = 0,
    on: Literal["threads", "ray"] = "threads",
    workers: int | None = None,
    address: str | None = None,
    store: str | Path | None = None,
    version: str | None = None,
    retry: bool = False,
    progress: bool | Progress = True,
) -> SweepResult:
    """Runs a study for every case of a grid, a list or a Monte-Carlo sample.

    A case that fails is reported in the result and stops nothing. What a case gives depends on its
    values and the seed alone: not on the order, the workers, or the other cases.

    Args:
        study: called with every :class:`Case`; returns a dict: name -> number, text or array. A
            :class:`Trial` is a study that is written already.
        over: what to vary. A dict of lists, for all combinations (the last name is the fastest),
            or a list of dicts, one for each case. A list may be a dict as well: label -> value.
            Values are numbers, texts, arrays, inputs, states, or lists and dicts of them;
            ``puppet`` takes marionettes, and ``p:NAME`` is a parameter of the puppet.
        puppet: the puppet of all cases, where ``over`` has none.
        draw: what is drawn at random for every case: a range (low, high), a distribution of
            ``scipy.stats``, or a function of a NumPy generator.
        seeds: repeat every case so often, each with random numbers of its own; the last axis of the
            results is then ``repeat``.
        seed: from which all random numbers grow.
        on: ``threads`` of this process, or ``ray``: the cluster that ``ray.init`` joined, the one
            at ``address``, or one started on this machine for the time of the sweep.
        workers: cases at a time; one a core, or one a processor of the cluster, when not given.
        address: of a Ray cluster, as ``ray.init`` takes it.
        store: a folder that keeps every finished case. The same sweep finds them there and goes on
            with the others; so does one with more values or more seeds.
        version: of the study, in a store. When not given the study's own code decides, without what
            it calls; a store made by another version is refused.
        retry: run cases again that the store has as failed.
        progress: show a bar on a terminal; or a function that is told (done, total, failed).

    Returns:
        The figures, shaped like the grid, and the failures.

    Raises:
        StoreError: the store is another sweep's, or cannot be written.
        SweepStopped: Ctrl-C; the error carries the cases that were finished.
    """
    if not callable(study):
        raise TypeError(f"study is {study!r:.80}; it must be a function of a case, or a Trial")
    if on not in ("threads", "ray"):
        raise ValueError(f"on is {on!r}; it must be 'threads' or 'ray'")
    workers = None if workers is None else check_whole("workers", workers, 1)
    if address is not None and on != "ray":
        raise ValueError("address goes with on='ray'")
    design = designed(over, draw, seeds, seed, puppet)
    kept = None if store is None else Store(store, _manifest(study, design, seed, version))
    outcomes: list[Outcome | None] = [None] * len(design.cases)
    if kept is not None:
        outcomes = [kept.read(key) for key in design.keys]
        if retry:
            outcomes = [None if o is not None and o.failure else o for o in outcomes]
    todo = [case for case, outcome in zip(design.cases, outcomes, strict=True) if outcome is None]
    if todo:
        job = Job(study, design.puppets, design.names)
        try:
            crew = RayCrew(job, workers, address) if on == "ray" else Threads(job, workers)
            try:
                with shown(progress) as tell:
                    _run(crew, todo, _Ledger(design, outcomes, kept, tell))
            finally:
                crew.close()
        except KeyboardInterrupt:
            raise SweepStopped(_stopped(outcomes, store), SweepResult(design, outcomes)) from None
    return SweepResult(design, outcomes)


class _Ledger:
    """Where outcomes go: into the list, the store and the bar."""

    def __init__(self, design: Design, outcomes: list, kept: Store | None, tell: Progress):
        self._design, self._outcomes, self._kept, self._tell = design, outcomes, kept, tell
        self._done = sum(o is not None for o in outcomes)
        self._failed = sum(o is not None and o.failure is not None for o in outcomes)
        tell(self._done, len(outcomes), self._failed)

    def book(self, case: Case, outcome: Outcome) -> None:
        """Notes what a case gave."""
        if self._kept is not None:
            k = case.index
            self._kept.write(self._design.keys[k], outcome, self._design.labels[k])
        self._outcomes[case.index] = outcome
        self._done += 1
        self._failed += outcome.failure is not None
        self._tell(self._done, len(self._outcomes), self._failed)


def _run(crew: Crew, cases: list[Case], ledger: _Ledger) -> None:
    """Hands the cases out, a bounded number ahead, and books what comes back."""
    todo, alone = deque(cases), deque()
    deaths: dict[int, int] = {}
    # The median, since a worker's first case may compile a puppet.
    recent = deque([crew.piece], maxlen=_RECENT)
    while todo or alone or crew.busy:
        room = crew.room
        while (todo or alone) and crew.busy < room:
            if alone:
                crew.submit((alone.popleft(),))
                continue
            fitting = crew.piece / max(median(recent), 1e-9)
            fair = len(todo) / room
            n = max(1, min(_MOST_AT_ONCE, int(fitting), int(fair)))
            crew.submit(tuple(todo.popleft() for _ in range(n)))
        for handed, outcomes in crew.collect(_PATIENCE):
            if outcomes is None:
                # One of them killed the worker: each runs again, by itself.
                for case in handed:
                    deaths[case.index] = deaths.get(case.index, 0) + 1
                    if deaths[case.index] < _LIVES:
                        alone.append(case)
                    else:
                        ledger.book(case, Outcome({}, 0.0, _dead()))
                continue
            for case, outcome in zip(handed, outcomes, strict=True):
                recent.append(outcome.seconds)
                ledger.book(case, outcome)


def _dead() -> Failure:
    return Failure(
        "WorkerDied",
        f"the process that ran this case ended {_LIVES} times: it crashed, was killed, or needed "
        "more memory than there is",
    )


def _manifest(study: Study, design: Design, seed: int, version: str | None) -> dict[str, Any]:
    """What all cases of a store have in common."""
    code = study_digest(study) if version is None else None
    if version is None and code is None:
        raise ValueError(
            f"the study {study_name(study)} is neither a function nor a dataclass, so that a store "
            "cannot tell when it changes; say it with version='1'"
        )
    return {
        "fantoccini": sys.modules["fantoccini"].__version__,
        "study": study_name(study),
        "version": version,
        "code": code,
        "seed": int(seed),
        "values": sorted(design.names),
    }


def _stopped(outcomes: list[Outcome | None], store: str | Path | None) -> str:
    done = sum(o is not None for o in outcomes)
    how = (
        f"{store} keeps them; run the same sweep again to go on"
        if store is not None
        else "they are in the result of this error; with store='folder' a sweep can go on later"
    )
    return f"stopped after {done} of {len(outcomes)} cases; {how}"
