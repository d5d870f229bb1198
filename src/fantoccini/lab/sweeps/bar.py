"""Progress of a sweep: a bar on the terminal, or the user's callback."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from fantoccini.base import OnCases, progress_bar


@contextmanager
def progress_callback(progress: bool | OnCases) -> Iterator[OnCases]:
    """The user's callback; otherwise one that draws a bar, or does nothing without a terminal."""
    if callable(progress):
        yield progress
    elif not (progress and sys.stderr.isatty()):
        yield lambda done, total, failed: None
    else:
        with progress_bar(counted=True) as bar:
            task = bar.add_task("sweeping", total=None)

            def update(done: int, total: int, failed: int) -> None:
                text = f"sweeping, {failed} failed" if failed else "sweeping"
                bar.update(task, completed=done, total=total, description=text)

            yield update
