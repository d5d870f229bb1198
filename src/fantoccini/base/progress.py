"""Progress of long work: the callbacks that report it, and the bar that shows it on a terminal."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress

OnStep = Callable[[str], None]
"""Called with a line of text when a step begins ("deriving", "compiling")."""
OnAmount = Callable[[float], None]
"""Called with the amount done so far, in the unit of the whole: seconds simulated, or a share."""
OnCases = Callable[[int, int, int], None]
"""Called with the number of cases done, the total, and how many of those done have failed."""


def progress_bar(counted: bool = False, transient: bool = False) -> Progress:
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
