"""Crews: who runs the cases. The contract, and threads of this process."""

from __future__ import annotations

import queue
import threading
from typing import Protocol

from fantoccini.runtime import default_threads
from fantoccini.sweeps.case import Case
from fantoccini.sweeps.outcome import Job, Outcome

Report = tuple[tuple[Case, ...], list[Outcome] | None]
"""Cases that were handed out together, and their outcomes; None where the worker died."""


class Crew(Protocol):
    """Who runs the cases of a sweep.

    Attributes:
        room: how many pieces may be out at a time: one for every worker, and one that waits.
        piece: how long the cases handed out together should take in all [s]; what handing out
            costs is small beside it.
        busy: how many pieces were submitted and not collected.
    """

    room: int
    piece: float
    busy: int

    def submit(self, cases: tuple[Case, ...]) -> None:
        """Hands out cases; returns at once."""

    def collect(self, patience: float) -> list[Report]:
        """What has come in; waits up to ``patience`` [s] for the first."""

    def close(self) -> None:
        """Ends everything, without waiting for cases that are running."""


class Threads:
    """Threads of this process: cheapest, and parallel while compiled code runs.

    Args:
        job: what to run.
        workers: threads; one a core when None.
    """

    piece = 0.02

    def __init__(self, job: Job, workers: int | None):
        self._workers = workers or default_threads()
        self.room, self.busy = 2 * self._workers, 0
        self._job = job
        self._todo: queue.SimpleQueue = queue.SimpleQueue()
        self._done: queue.SimpleQueue = queue.SimpleQueue()
        self._closed = threading.Event()
        # Daemons: after Ctrl-C nobody waits for the cases that are running.
        for k in range(self._workers):
            threading.Thread(target=self._work, name=f"sweep-{k}", daemon=True).start()

    def submit(self, cases: tuple[Case, ...]) -> None:
        """As :meth:`Crew.submit`."""
        self.busy += 1
        self._todo.put(cases)

    def collect(self, patience: float) -> list[Report]:
        """As :meth:`Crew.collect`."""
        reports = []
        try:
            reports.append(self._done.get(timeout=patience))
            while True:
                reports.append(self._done.get_nowait())
        except queue.Empty:
            pass
        self.busy -= len(reports)
        return reports

    def close(self) -> None:
        """As :meth:`Crew.close`."""
        self._closed.set()
        for _ in range(self._workers):
            self._todo.put(None)

    def _work(self) -> None:
        while (cases := self._todo.get()) is not None:
            outcomes = []
            for case in cases:
                if self._closed.is_set():
                    return
                outcomes.append(self._job.perform(case))
            self._done.put((cases, outcomes))
