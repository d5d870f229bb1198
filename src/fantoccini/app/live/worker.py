"""Long jobs in a thread beside a page, one after the other."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable

from fantoccini.base import FantocciniError


class Stopped(Exception):
    """The page is closed: a job that need not be completed ends."""


class Worker:
    """Thread that runs long jobs.

    Attributes:
        status: description of the running job, or result of the last one; empty at first.
        busy: whether a job is running.
    """

    def __init__(self) -> None:
        self.status, self.busy = "", False
        self._jobs: queue.SimpleQueue[tuple[str, Callable[[], str]] | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._end = threading.Event()

    def submit(self, description: str, job: Callable[[], str]) -> None:
        """Queues a job.

        Args:
            description: description of the job, such as ``writing a.mp4``.
            job: function that runs it and returns a message about the result.
        """
        self._jobs.put((description, job))
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="work", daemon=True)
            self._thread.start()

    def report_progress(self, description: str, share: float) -> None:
        """Reports the completed share of the running job, 0 to 1.

        Raises:
            Stopped: the page is closed.
        """
        if self._end.is_set():
            raise Stopped
        self.status = f"{description}, {100.0 * share:.0f} %"

    def finish(self) -> None:
        """Waits for jobs that must be completed, and stops the others."""
        self._end.set()
        if self._thread is not None:
            self._jobs.put(None)
            self._thread.join()
            self._thread = None

    def _run(self) -> None:
        while (item := self._jobs.get()) is not None:
            self.status, job = item
            self.busy = True
            try:
                self.status = job()
            except Stopped:
                self.status = ""
            except (FantocciniError, OSError, ValueError) as error:
                self.status = str(error)
            except Exception as error:  # otherwise nothing would report it
                self.status = f"internal error: {type(error).__name__}: {error}"
            self.busy = False
