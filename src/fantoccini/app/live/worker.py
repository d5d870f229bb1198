"""Long work beside a page, one piece after the other."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable

from fantoccini.base import FantocciniError


class Stopped(Exception):
    """The page is closed: work that can be left undone ends."""


class Worker:
    """Does long work in a thread of its own.

    Attributes:
        status: what it does, or what became of the last work; empty at first.
        busy: whether it works.
    """

    def __init__(self) -> None:
        self.status, self.busy = "", False
        self._jobs: queue.SimpleQueue[tuple[str, Callable[[], str]] | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._end = threading.Event()

    def do(self, what: str, job: Callable[[], str]) -> None:
        """Does something as soon as the work before is done.

        Args:
            what: it does, as ``writing a.mp4``.
            job: does it, and returns what became of it.
        """
        self._jobs.put((what, job))
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="work", daemon=True)
            self._thread.start()

    def progress(self, what: str, share: float) -> None:
        """Tells how far work is, 0 to 1.

        Raises:
            Stopped: the page is closed.
        """
        if self._end.is_set():
            raise Stopped
        self.status = f"{what}, {100.0 * share:.0f} %"

    def finish(self) -> None:
        """Waits for what has to be done, and leaves the rest."""
        self._end.set()
        if self._thread is not None:
            self._jobs.put(None)
            self._thread.join()
            self._thread = None

    def _run(self) -> None:
        while (one := self._jobs.get()) is not None:
            self.status, job = one
            self.busy = True
            try:
                self.status = job()
            except Stopped:
                self.status = ""
            except (FantocciniError, OSError, ValueError) as error:
                self.status = str(error)
            except Exception as error:  # nobody else would report it
                self.status = f"internal error: {type(error).__name__}: {error}"
            self.busy = False
