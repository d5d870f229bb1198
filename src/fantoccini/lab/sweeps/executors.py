"""Executors run the cases of a sweep: the protocol, and a pool of threads in this process.

A case is one combination of values; a task is several cases that are sent together.
"""

from __future__ import annotations

import queue
import threading
from typing import Protocol

from fantoccini.kernel.runtime import default_threads
from fantoccini.lab.sweeps.case import Case
from fantoccini.lab.sweeps.outcome import Job, Outcome

CompletedTask = tuple[tuple[Case, ...], list[Outcome] | None]
"""Cases submitted together, and their outcomes; None if the worker died."""


class Executor(Protocol):
    """Runs the cases of a sweep, several of them per task.

    Attributes:
        task_seconds: duration of a task for which its overhead is negligible [s].
    """

    task_seconds: float

    @property
    def capacity(self) -> int:
        """Largest number of pending tasks: for each worker one that runs and one that waits."""

    @property
    def pending(self) -> int:
        """Number of tasks submitted and not collected."""

    def submit(self, cases: tuple[Case, ...]) -> None:
        """Submits cases as one task; returns at once."""

    def collect(self, timeout: float) -> list[CompletedTask]:
        """Completed tasks; waits up to ``timeout`` [s] for the first."""

    def close(self) -> None:
        """Stops the workers, without waiting for cases that are running."""


class ThreadExecutor:
    """A pool of threads in this process: smallest overhead, and parallel while compiled code runs.

    Args:
        job: function to run, with its arguments.
        workers: number of threads; one per core when None.
    """

    task_seconds = 0.02

    def __init__(self, job: Job, workers: int | None):
        self._workers = workers or default_threads()
        self.capacity, self.pending = 2 * self._workers, 0
        self._job = job
        self._submitted: queue.SimpleQueue[tuple[Case, ...] | None] = queue.SimpleQueue()
        self._completed: queue.SimpleQueue[CompletedTask] = queue.SimpleQueue()
        self._closed = threading.Event()
        # Daemon threads: Ctrl-C does not wait for the cases that are running.
        for k in range(self._workers):
            threading.Thread(target=self._run_tasks, name=f"sweep-{k}", daemon=True).start()

    def submit(self, cases: tuple[Case, ...]) -> None:
        """See :meth:`Executor.submit`."""
        self.pending += 1
        self._submitted.put(cases)

    def collect(self, timeout: float) -> list[CompletedTask]:
        """See :meth:`Executor.collect`."""
        completed: list[CompletedTask] = []
        try:
            completed.append(self._completed.get(timeout=timeout))
            while True:
                completed.append(self._completed.get_nowait())
        except queue.Empty:
            pass
        self.pending -= len(completed)
        return completed

    def close(self) -> None:
        """See :meth:`Executor.close`."""
        self._closed.set()
        for _ in range(self._workers):
            self._submitted.put(None)

    def _run_tasks(self) -> None:
        while (cases := self._submitted.get()) is not None:
            outcomes = []
            for case in cases:
                if self._closed.is_set():
                    return
                outcomes.append(self._job.run(case))
            self._completed.put((cases, outcomes))
