"""Runs the command line inside the test's process."""

from __future__ import annotations

from typing import Any

from typer.testing import CliRunner

from fantoccini.app.cli.app import app


def fantoccini(*arguments: object) -> Any:
    """Result of `fantoccini ARGUMENTS`: `exit_code`, `stdout`, `stderr`."""
    return CliRunner().invoke(app, [str(a) for a in arguments], prog_name="fantoccini")


def mistake(*arguments: object) -> str:
    """Text of stderr for a mistake: exit code 2, nothing on stdout, no traceback."""
    result = fantoccini(*arguments)
    assert result.exit_code == 2, (result.stdout, result.stderr, result.exception)
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    return result.stderr
