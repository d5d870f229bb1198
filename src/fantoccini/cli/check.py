"""``fantoccini check``: lists every mistake in every file, and warnings."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import typer

from fantoccini.cli.files import fail, marionette
from fantoccini.cli.guard import MISTAKE
from fantoccini.cli.motions import motion, parts
from fantoccini.cli.play import checked_play
from fantoccini.cli.terminal import say, write
from fantoccini.cli.warn import inputs_warnings, puppet_warnings
from fantoccini.errors import FileError, Mistake
from fantoccini.marionette import Marionette, check_mass_matrix
from fantoccini.plays import is_play, play_names
from fantoccini.tree import measure


def check_files(files: list[str], inputs: list[Path], quiet: bool) -> None:
    """Checks plays, and puppets with, against each of them, inputs.

    Args:
        files: FILE arguments: puppets and plays.
        inputs: inputs files.
        quiet: print nothing about files without mistakes.
    """
    clean = True
    for file in files:
        if is_play(file) or (file in play_names() and not Path(file).exists()):
            clean &= _play(file, inputs, quiet)
            continue
        made = _puppet(file)
        clean &= made is not None
        if made is None:
            continue
        found = puppet_warnings(made, file)
        _list(found)
        if not quiet:
            table = made.coordinates
            write(
                f"{file}: no mistakes{_count(found)}; {table.n_vD} DOF, "
                f"{len(made.tree.strings)} strings, {table.n_vK} driven"
            )
            write(f"{file}: {_size(made)}")
        for path in inputs:
            clean &= _inputs(made, path, quiet)
    if not clean:
        raise typer.Exit(MISTAKE)


def _puppet(file: str) -> Marionette | None:
    try:
        made = marionette(file)
        check_mass_matrix(made.puppet, made.tree)
    except FileError as error:
        _list(error.mistakes)
        return None
    return made


def _play(file: str, inputs: list[Path], quiet: bool) -> bool:
    if inputs:
        fail(f"applies to puppets, and {file} is a play", "--inputs")
    try:
        found = checked_play(Path(file))
    except FileError as error:
        _list(error.mistakes)
        return False
    if not quiet:
        write(f"{file}: no mistakes; {found}; `fantoccini play` tells whether it can be done")
    return True


def _inputs(made: Marionette, path: Path, quiet: bool) -> bool:
    try:
        given = motion(made, path)
    except FileError as error:
        _list(error.mistakes)
        return False
    read = given.inputs
    found = [*given.changes, *inputs_warnings(made, read, path)]
    _list(found)
    if not quiet:
        write(f"{path}: no mistakes{_count(found)}; drives {made.name} for {read.duration:g} s")
        for line in parts(given.score) if given.score is not None else ():
            write(f"{path}: {line}")
    return True


def _list(problems: Iterable[Mistake]) -> None:
    for problem in problems:
        say(str(problem))


def _count(found: list[Mistake]) -> str:
    if not found:
        return ""
    return ", 1 warning" if len(found) == 1 else f", {len(found)} warnings"


def _size(made: Marionette) -> str:
    """Mass, extent and hanging height of a puppet in its start pose."""
    size = measure(made.tree, made.model.number)
    lengths = " x ".join(f"{x:.3g}" for x in size.lengths)
    hangs = "" if size.hangs is None else f", hangs {size.hangs:.3g} m high"
    return f"{size.mass:.4g} kg, {lengths} m (x, y, z){hangs}"
