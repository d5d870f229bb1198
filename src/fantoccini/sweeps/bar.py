"""The progress bar of a sweep: on a terminal, on stderr, with the time that is left."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[int, int, int], None]
"""Told how many cases are done, how many there are, and how many of those done have failed."""


@contextmanager
def shown(progress: bool | Progress) -> Iterator[Progress]:
    """Whom to tell how far a sweep is: a bar, the user's function, or nobody."""
    if callable(progress):
        yield progress
        return
    if not (progress and sys.stderr.isatty()):
        yield lambda done, total, failed: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("sweeping", total=None)

        def tell(done: int, total: int, failed: int) -> None:
            text = f"sweeping, {failed} failed" if failed else "sweeping"
            bar.update(task, completed=done, total=total, description=text)

        yield tell
