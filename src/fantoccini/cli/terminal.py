"""What people see. Data go to stdout, all else to stderr; names from files are plain text."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Any

import typer

_WIDE = 1000
"""Width of tables that do not go to a terminal: nothing is cut there [characters]."""


def plain(text: object) -> str:
    """The text with everything that is no visible character, line breaks aside, as an escape."""
    return "".join(
        c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode("ascii")
        for c in str(text)
    )


def write(text: object = "") -> None:
    """A line of data on stdout."""
    typer.echo(plain(text))


def say(text: object) -> None:
    """A message on stderr."""
    typer.echo(plain(text), err=True)


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """A table on stdout; nothing where there are no rows.

    Args:
        title: stands above it.
        columns: headings; those that end in ``>`` are set flush right.
        rows: cells; numbers are written with five digits.
    """
    if not rows:
        return
    from rich.table import Table
    from rich.text import Text

    made = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, header_style="bold")
    for heading in columns:
        right = heading.endswith(">")
        made.add_column(
            Text(heading.rstrip(">")), justify="right" if right else "left", overflow="fold"
        )
    for row in rows:
        made.add_row(*(Text(plain(number(cell))) for cell in row))
    console = _console(sys.stdout)
    console.print(Text(plain(title), style="bold"))
    console.print(made)
    console.print()


def version() -> str:
    """The package's version, which stands in the package itself, above all of its modules."""
    return sys.modules["fantoccini"].__version__


def number(cell: object) -> str:
    """A cell's text: five digits of a float, other things as they are."""
    return f"{cell + 0.0:.5g}" if isinstance(cell, float) else str(cell)


def width() -> int:
    """Characters on a line of stdout."""
    return _console(sys.stdout).width if sys.stdout.isatty() else 110


def _console(stream: Any) -> Any:
    from rich.console import Console

    return Console(
        file=stream,
        width=None if stream.isatty() else _WIDE,
        markup=False,
        highlight=False,
        emoji=False,
    )


class Steps:
    """Steps of a long job on stderr: bars on a terminal, lines elsewhere, nothing when quiet.

    Args:
        quiet: show nothing.
    """

    def __init__(self, quiet: bool = False):
        self._quiet = quiet
        self._progress: Any = None
        self._task: Any = None

    def __enter__(self) -> Steps:
        if sys.stderr.isatty() and not self._quiet:
            from rich.progress import (
                BarColumn,
                Progress,
                TaskProgressColumn,
                TextColumn,
                TimeElapsedColumn,
                TimeRemainingColumn,
            )

            self._progress = Progress(
                TextColumn("{task.description}", markup=False),
                BarColumn(),
                TaskProgressColumn(),
                TimeElapsedColumn(),
                TimeRemainingColumn(),
                console=_console(sys.stderr),
            )
            self._progress.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._progress is not None:
            if kind is None:
                self._finish()
            self._progress.stop()

    def step(self, text: str) -> None:
        """A step that cannot be measured begins; the one before it is done."""
        self._begin(text, None)

    def bar(self, text: str, total: float) -> Callable[[float], None]:
        """A step that can be measured begins; the result is told how much of it is done."""
        self._begin(text, total)

        def done(amount: float) -> None:
            if self._progress is not None:
                self._progress.update(self._task, completed=amount)

        return done

    def _begin(self, text: str, total: float | None) -> None:
        text = plain(text).replace("\n", " ")
        if self._progress is not None:
            self._finish()
            self._task = self._progress.add_task(text, total=total)
        elif not self._quiet:
            typer.echo(text, err=True)

    def _finish(self) -> None:
        if self._task is not None:
            task = self._progress.tasks[-1]
            total = task.total or 1.0
            self._progress.update(self._task, total=total, completed=total)
