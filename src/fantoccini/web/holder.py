"""Who holds the strings: one viewer at a time, until hands are off for a while."""

from __future__ import annotations

import time
from collections.abc import Callable
from threading import Lock

IDLE = 3.0
"""Hands that are off for so long have let go [s]."""

Viewer = int | str
"""A client of viser by its number, or a gamepad by its name."""


class Holder:
    """The viewer that holds the strings.

    Args:
        idle: after so long without a move the strings are free [s].
        clock: tells the time [s].
    """

    def __init__(self, idle: float = IDLE, clock: Callable[[], float] = time.monotonic):
        self._idle, self._clock = idle, clock
        self._viewer: Viewer | None = None
        self._since = 0.0
        self._lock = Lock()

    @property
    def viewer(self) -> Viewer | None:
        """Who holds the strings now, or None."""
        with self._lock:
            self._let_go_when_idle()
            return self._viewer

    def claim(self, viewer: Viewer) -> bool:
        """Whether a viewer may move the puppet now; from then on it holds the strings."""
        with self._lock:
            self._let_go_when_idle()
            if self._viewer not in (None, viewer):
                return False
            self._viewer, self._since = viewer, self._clock()
            return True

    def leave(self, viewer: Viewer) -> None:
        """A viewer is gone."""
        with self._lock:
            if self._viewer == viewer:
                self._viewer = None

    def _let_go_when_idle(self) -> None:
        if self._viewer is not None and self._clock() - self._since > self._idle:
            self._viewer = None
