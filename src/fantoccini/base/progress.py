"""Progress of long work: the callback's argument, and a progress bar on a terminal."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.progress import Progress as Bar


@dataclass(frozen=True)
class Progress:
    """Progress of long work: the argument of every ``progress`` callback.

    Attributes:
        what: current stage ("deriving", a candidate); empty if there is only one.
        done: amount done: seconds simulated, iterations, frames, cases, or a share of 1.
        total: total amount; NaN if it is not known.
        failed: number of failed cases among those done.
        best: best result of a search so far: a motion with its cost, or a cost; else None.
    """

    what: str = ""
    done: float = 0.0
    total: float = math.nan
    failed: int = 0
    best: Any = None

    @property
    def share(self) -> float:
        """Share that is done, 0 to 1; NaN if the total is not known."""
        return self.done / self.total if self.total else 1.0


OnProgress = Callable[[Progress], None]
"""The callback of long work."""


def progress_bar(counted: bool = False, transient: bool = False) -> Bar:
    """A bar on stderr with elapsed and remaining time; use it as a context manager.

    Args:
        counted: show "3/10" instead of a percentage.
        transient: remove the bar when it stops.
    """
    from rich import progress
    from rich.console import Console

    return progress.Progress(
        progress.TextColumn("{task.description}", markup=False),
        progress.BarColumn(),
        progress.MofNCompleteColumn() if counted else progress.TaskProgressColumn(),
        progress.TimeElapsedColumn(),
        progress.TimeRemainingColumn(),
        console=Console(stderr=True, markup=False, highlight=False, emoji=False),
        transient=transient,
    )


@contextmanager
def reporting(
    title: str, callback: OnProgress | None, *, counted: bool = False, delay: float = 0.0
) -> Iterator[OnProgress]:
    """Yields the callback; without one, another that draws a bar if stderr is a terminal.

    Args:
        title: title of the bar.
        callback: callback of the caller.
        counted: show "3/10" instead of a percentage.
        delay: time before the bar appears [s]; if positive, the bar is removed at the end.
    """
    if callback is not None:
        yield callback
        return
    began = time.monotonic()
    bar: Bar | None = None

    def show(progress: Progress) -> None:
        nonlocal bar
        if bar is None and sys.stderr.isatty() and time.monotonic() - began >= delay:
            bar = progress_bar(counted, transient=delay > 0.0)
            bar.add_task(title, total=None)
            bar.start()
        if bar is not None:
            text = f"{title}, {progress.failed} failed" if progress.failed else title
            bar.update(
                bar.task_ids[0], completed=progress.done, total=progress.total, description=text
            )

    try:
        yield show
    finally:
        if bar is not None:
            bar.stop()
