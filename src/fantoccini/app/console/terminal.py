"""Output: data on stdout, messages on stderr, names from files as plain text."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TextIO

import typer

from fantoccini.base import OnAmount, progress_bar

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

_FILE_WIDTH = 1000
"""Width of tables that do not go to a terminal, so that nothing is cut [characters]."""
_PAGE_WIDTH = 110
"""Width of equations that do not go to a terminal [characters]."""


def plain(text: object) -> str:
    """The text with invisible characters other than line breaks escaped."""
    return "".join(
        c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode("ascii")
        for c in str(text)
    )


def write(text: object = "") -> None:
    """Prints a line of data on stdout."""
    typer.echo(plain(text))


def say(text: object) -> None:
    """Prints a message on stderr."""
    typer.echo(plain(text), err=True)


def table(title: str, columns: Sequence[str], lines: Sequence[Sequence[object]]) -> None:
    """Prints a table on stdout; nothing if it has no lines.

    Args:
        title: printed above it.
        columns: headings; those that end in ``>`` are set flush right.
        lines: cells; numbers are printed with five digits.
    """
    if not lines:
        return
    from rich.table import Table
    from rich.text import Text

    grid = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, header_style="bold")
    for heading in columns:
        right = heading.endswith(">")
        grid.add_column(
            Text(heading.rstrip(">")), justify="right" if right else "left", overflow="fold"
        )
    for line in lines:
        grid.add_row(*(Text(plain(number(cell))) for cell in line))
    console = _console(sys.stdout)
    console.print(Text(plain(title), style="bold"))
    console.print(grid)
    console.print()


def version() -> str:
    """The package's version."""
    return sys.modules["fantoccini"].__version__


def number(cell: object) -> str:
    """A cell's text: five digits of a float, anything else unchanged."""
    return f"{cell + 0.0:.5g}" if isinstance(cell, float) else str(cell)


def width() -> int:
    """Characters on a line of stdout."""
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


class Steps:
    """Steps of a long job on stderr: bars on a terminal, otherwise lines.

    Args:
        quiet: show nothing.
    """

    def __init__(self, quiet: bool = False):
        self._quiet = quiet
        self._progress: Progress | None = None
        self._task: TaskID | None = None

    def __enter__(self) -> Steps:
        if sys.stderr.isatty() and not self._quiet:
            self._progress = progress_bar()
            self._progress.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._progress is not None:
            if kind is None:
                self._finish(self._progress)
            self._progress.stop()

    def step(self, text: str) -> None:
        """Begins a step of unknown length; the previous one is done."""
        self._begin(text, None)

    def bar(self, text: str, total: float) -> OnAmount:
        """Begins a step of known length; call the result with the amount done."""
        self._begin(text, total)

        def update(amount: float) -> None:
            if self._progress is not None and self._task is not None:
                self._progress.update(self._task, completed=amount)

        return update

    def shares(self) -> Callable[[str, float], None]:
        """One step whose name changes; call the result with what is done, and the share of it."""
        last = ""

        def update(text: str, share: float) -> None:
            nonlocal last
            if text != last and (self._progress is None or not last):
                self._begin(text, 1.0)
            last = text
            if self._progress is not None and self._task is not None:
                self._progress.update(self._task, completed=share, description=plain(text))

        return update

    def _begin(self, text: str, total: float | None) -> None:
        text = plain(text).replace("\n", " ")
        if self._progress is not None:
            self._finish(self._progress)
            self._task = self._progress.add_task(text, total=total)
        elif not self._quiet:
            say(text)

    def _finish(self, progress: Progress) -> None:
        if self._task is not None:
            total = progress.tasks[-1].total or 1.0
            progress.update(self._task, total=total, completed=total)
