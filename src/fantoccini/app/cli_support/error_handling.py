"""Conversion of errors to messages and exit codes.

A mistake is an error in a file, with its line.
"""

from __future__ import annotations

import contextlib
import os
import traceback
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup

from fantoccini.app.cli_support.terminal import print_message
from fantoccini.base import (
    FantocciniError,
    FileError,
    SimulationError,
    StateError,
    Status,
    UnknownNameError,
)

FAILED = 1
"""Exit code: the run stopped early, something cannot be done, or a library is missing."""
MISTAKE = 2
"""Exit code: mistakes in files or arguments."""
INTERRUPTED = 130
"""Exit code: stopped with Ctrl-C."""

_TRACEBACK_VARIABLE = "FANTOCCINI_TRACEBACK"
"""Environment variable with which unexpected errors show their traceback."""


class CommandGroup(TyperGroup):
    """Group of commands whose errors become messages; see :func:`errors_as_messages`."""

    def invoke(self, ctx: Any) -> Any:
        """Runs the chosen command."""
        with errors_as_messages(), _warnings_as_messages():
            return super().invoke(ctx)


@contextlib.contextmanager
def errors_as_messages() -> Iterator[None]:
    """Context that turns errors and Ctrl-C into a message on stderr and an exit code."""
    try:
        yield
    except FileError as error:
        for mistake in error.mistakes:
            print_message(str(mistake))
        raise typer.Exit(MISTAKE) from None
    except (StateError, UnknownNameError) as error:
        print_message(f"fantoccini: {error}")
        raise typer.Exit(MISTAKE) from None
    except SimulationError as error:
        print_message(f"fantoccini: {error}")
        stopped = error.status is Status.STOPPED
        raise typer.Exit(INTERRUPTED if stopped else FAILED) from None
    except FantocciniError as error:
        print_message(f"fantoccini: {error}")
        raise typer.Exit(FAILED) from None
    except KeyboardInterrupt:
        print_message("stopped")
        raise typer.Exit(INTERRUPTED) from None
    except OSError as error:
        if isinstance(error, BrokenPipeError):
            raise  # typer exits silently
        name = f"{error.filename}: " if error.filename else ""
        print_message(f"fantoccini: {name}{error.strerror or error}")
        raise typer.Exit(FAILED) from None
    except Exception as error:
        # Usage errors and exits of typer carry their exit code.
        if hasattr(error, "exit_code") or isinstance(error, typer.Abort):
            raise
        if os.environ.get(_TRACEBACK_VARIABLE):
            raise
        last_frame = traceback.extract_tb(error.__traceback__)[-1]
        print_message(
            f"fantoccini: internal error: {type(error).__name__}: {error} "
            f"({Path(last_frame.filename).name}, line {last_frame.lineno}); "
            f"{_TRACEBACK_VARIABLE}=1 shows the traceback"
        )
        raise typer.Exit(FAILED) from None


@contextlib.contextmanager
def _warnings_as_messages() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_, **__: print_message(f"warning: {message}")
        yield
