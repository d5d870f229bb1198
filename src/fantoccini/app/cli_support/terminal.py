"""Terminal output: data on stdout, messages on stderr, names from files as plain text."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, TextIO

import typer

from fantoccini.base import OnProgress, Progress, progress_bar

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress as RichProgress, TaskID

_FILE_WIDTH = 1000
"""Width of tables outside a terminal, so that nothing is cut [characters]."""
_PAGE_WIDTH = 110
"""Width of equations outside a terminal [characters]."""


def escape_unprintable(text: object) -> str:
    """The text with unprintable characters escaped, except line breaks."""
    return "".join(
        c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode("ascii")
        for c in str(text)
    )


def print_output(text: object = "") -> None:
    """Prints a line of data on stdout."""
    typer.echo(escape_unprintable(text))


def print_message(text: object) -> None:
    """Prints a message on stderr."""
    typer.echo(escape_unprintable(text), err=True)


def print_table(title: str, columns: Sequence[str], lines: Sequence[Sequence[object]]) -> None:
    """Prints a table on stdout; nothing if it has no lines.

    Args:
        title: title above the table.
        columns: headings; a final ``>`` aligns a column to the right.
        lines: cells; numbers are printed with five digits.
    """
    if not lines:
        return
    from rich.table import Table
    from rich.text import Text

    grid = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, header_style="bold")
    for heading in columns:
        align_right = heading.endswith(">")
        grid.add_column(
            Text(heading.rstrip(">")), justify="right" if align_right else "left", overflow="fold"
        )
    for line in lines:
        grid.add_row(*(Text(escape_unprintable(format_number(cell))) for cell in line))
    console = _console(sys.stdout)
    console.print(Text(escape_unprintable(title), style="bold"))
    console.print(grid)
    console.print()


def version_text() -> str:
    """Version of the package."""
    return sys.modules["fantoccini"].__version__


def format_number(cell: object) -> str:
    """Text of a cell: five digits of a float, anything else unchanged."""
    return f"{cell + 0.0:.5g}" if isinstance(cell, float) else str(cell)


def terminal_width() -> int:
    """Width of a line on stdout [characters]."""
    return _console(sys.stdout).width if sys.stdout.isatty() else _PAGE_WIDTH


def _console(stream: TextIO) -> Console:
    from rich.console import Console

    return Console(
        file=stream,
        width=None if stream.isatty() else _FILE_WIDTH,
        markup=False,
        highlight=False,
        emoji=False,
    )


class ProgressDisplay:
    """Display of a long job's stages on stderr: bars on a terminal, otherwise lines.

    Args:
        quiet: show nothing.
    """

    def __init__(self, quiet: bool = False):
        self._quiet = quiet
        self._bars: RichProgress | None = None
        self._stage = ""
        self._task: TaskID | None = None

    def __enter__(self) -> ProgressDisplay:
        if sys.stderr.isatty() and not self._quiet:
            self._bars = progress_bar()
            self._bars.start()
        return self

    def __exit__(self, error_type: type[BaseException] | None, *_: object) -> None:
        if self._bars is not None:
            if error_type is None:
                self._finish(self._bars)
            self._bars.stop()

    def stage(self, text: str) -> None:
        """Begins a stage of unknown length, after finishing the previous one."""
        self._begin(text, None)

    def bar(self, text: str) -> OnProgress:
        """Begins a stage of known length; returns its progress callback."""
        self._begin(text, 1.0)
        return lambda progress: self._show_share(progress.share)

    def update(self, progress: Progress) -> None:
        """Progress callback of a job that names its stages, with or without their share done."""
        share_known = not math.isnan(progress.share)
        same_stage = progress.what == self._stage or (self._bars is not None and self._stage)
        if not share_known or not same_stage:
            self._begin(progress.what, 1.0 if share_known else None)
        self._stage = progress.what if share_known else ""
        if share_known:
            self._show_share(progress.share, escape_unprintable(progress.what))

    def _show_share(self, share: float, text: str | None = None) -> None:
        if self._bars is not None and self._task is not None:
            self._bars.update(self._task, completed=share, description=text)

    def _begin(self, text: str, total: float | None) -> None:
        text, self._stage = escape_unprintable(text).replace("\n", " "), ""
        if self._bars is not None:
            self._finish(self._bars)
            self._task = self._bars.add_task(text, total=total)
        elif not self._quiet:
            print_message(text)

    def _finish(self, bars: RichProgress) -> None:
        if self._task is not None:
            total = bars.tasks[-1].total or 1.0
            bars.update(self._task, total=total, completed=total)
