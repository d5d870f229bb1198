"""``fantoccini check``: every mistake in every file."""

from __future__ import annotations

from pathlib import Path

import typer

from fantoccini.cli.files import marionette
from fantoccini.cli.guard import MISTAKE
from fantoccini.cli.terminal import say, write
from fantoccini.errors import FileError
from fantoccini.marionette import Marionette
from fantoccini.motion import Input


def check_files(files: list[str], inputs: list[Path], quiet: bool) -> None:
    """Checks puppets and, against each of them, inputs.

    Args:
        files: FILE arguments.
        inputs: inputs files.
        quiet: say nothing about files without mistakes.
    """
    clean = True
    for file in files:
        made = _puppet(file)
        clean &= made is not None
        if made is None:
            continue
        if not quiet:
            table = made.coordinates
            write(
                f"{file}: no mistakes; {table.n_vD} DOF, {len(made.tree.strings)} strings, "
                f"{table.n_vK} driven"
            )
        for path in inputs:
            clean &= _inputs(made, path, quiet)
    if not clean:
        raise typer.Exit(MISTAKE)


def _puppet(file: str) -> Marionette | None:
    try:
        made = marionette(file)
        made.check_mass_matrix()
    except FileError as error:
        _list(error)
        return None
    return made


def _inputs(made: Marionette, path: Path, quiet: bool) -> bool:
    try:
        read = Input.load(made, path)
    except FileError as error:
        _list(error)
        return False
    if not quiet:
        write(f"{path}: no mistakes; drives {made.name} for {read.duration:g} s")
    return True


def _list(error: FileError) -> None:
    for problem in error.problems:
        say(str(problem))
