"""The progress of a batch: a callback, or a bar on a terminal after a while."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from fantoccini.base import OnAmount, progress_bar

if TYPE_CHECKING:
    from rich.progress import Progress

_DELAY = 2.0
"""Time without a bar [s]."""


@contextmanager
def batch_progress(
    title: str, callback: OnAmount | None, t: float, t_end: float
) -> Iterator[Callable[[float], None]]:
    """Reports the share of a batch that is done, 0 to 1, on a terminal after two seconds.

    Args:
        title: of the bar.
        callback: called with the mean time reached [s], instead of the bar.
        t, t_end: the span of the runs [s].
    """
    began = time.monotonic()
    bar: Progress | None = None

    def show(share: float) -> None:
        nonlocal bar
        if callback:
            callback(t + share * (t_end - t))
        elif bar is None and time.monotonic() - began > _DELAY and sys.stderr.isatty():
            bar = progress_bar(transient=True)
            bar.add_task(title, total=1.0)
            bar.start()
        if bar:
            bar.update(bar.task_ids[0], completed=share)

    try:
        yield show
    finally:
        if bar:
            bar.stop()
