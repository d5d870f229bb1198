"""Thread that updates a page."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from typing import NamedTuple

from fantoccini.app.pages.server import Server


class Refresh(NamedTuple):
    """Rates and intervals of updates of a page."""

    rate: float = 60.0  # Frames per second, as browsers draw
    numbers: float = 0.1  # Interval of numbers and plots [s]: faster ones cannot be read
    marks: float = 1.0 / 15.0  # Interval of the marks on handles [s]


REFRESH = Refresh()


class PageLoop(ABC):
    """Contents of a page, updated by their own thread.

    Attributes:
        server: server of the page.
    """

    server: Server

    def __init__(self, name: str):
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    @property
    def running(self) -> bool:
        """Whether the thread is running."""
        return self._thread.is_alive()

    def start(self) -> None:
        """Starts the updates."""
        self._thread.start()

    def stop(self) -> None:
        """Ends the updates and, after completing unfinished work, the server."""
        self._end.set()
        if self.running:
            self._thread.join(timeout=2.0)
        self._finish()
        self.server.stop()

    @abstractmethod
    def _run(self) -> None:
        """Updates the page until ``_end`` is set."""

    @abstractmethod
    def _finish(self) -> None:
        """Completes unfinished work."""
