"""A progress bar for batches."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress

_DELAY = 2.0
"""Time without a bar [s]."""


class ProgressBar:
    """Reports how much of a batch is done: to a callback, or on a terminal after two seconds.

    Args:
        title: of the bar.
        progress: called with the mean time reached [s], instead of the bar.
        t, t_end: the span of the runs [s].
    """

    def __init__(
        self, title: str, progress: Callable[[float], None] | None, t: float, t_end: float
    ):
        self._title, self._progress = title, progress
        self._t, self._t_end = t, t_end
        self._bar: Progress | None = None

    def __enter__(self) -> ProgressBar:
        self._began = time.monotonic()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar:
            self._bar.stop()

    def show(self, share: float) -> None:
        """Reports that a share of the work, 0 to 1, is done."""
        if self._progress:
            self._progress(self._t + share * (self._t_end - self._t))
            return
        if self._bar is None:
            if time.monotonic() - self._began < _DELAY or not sys.stderr.isatty():
                return
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

            columns = TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn()
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self._task = self._bar.add_task(self._title, total=1.0)
            self._bar.start()
        self._bar.update(self._task, completed=share)
