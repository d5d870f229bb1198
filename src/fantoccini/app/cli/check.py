"""``fantoccini check``: lists every mistake in every file, and warnings."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import typer

from fantoccini.app.cli.play import checked_play
from fantoccini.app.console import (
    MISTAKE,
    fail,
    inputs_warnings,
    marionette,
    motion,
    parts,
    puppet_warnings,
    say,
    write,
)
from fantoccini.base import FileError, Mistake
from fantoccini.dynamics.compiled import check_mass_matrix
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import measure
from fantoccini.stand import AxisMap, is_stand, load_stand, stand_names
from fantoccini.theatre.plays import play_names
from fantoccini.theatre.script import is_play

_RATE = 200.0
"""Times per second at which inputs are looked at."""


def check_files(files: list[str], inputs: list[Path], quiet: bool) -> None:
    """Checks plays and stands, and puppets with, against each of them, inputs.

    Args:
        files: FILE arguments: puppets, plays and stands.
        inputs: inputs files.
        quiet: print nothing about files without mistakes.
    """
    clean = True
    for file in files:
        if is_play(file) or (file in play_names() and not os.path.exists(file)):
            clean &= _play(file, inputs, quiet)
            continue
        if is_stand(file) or (file in stand_names() and not os.path.exists(file)):
            clean &= _stand(file, inputs, quiet)
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


def _stand(file: str, inputs: list[Path], quiet: bool) -> bool:
    """A stand by itself, bound to its puppet, and with every inputs file."""
    try:
        stand = load_stand(file)
        path = stand.puppet_path
        made = None if path is None else marionette(str(path))
        bound = None if made is None else AxisMap.of(stand, made.coordinates)
    except FileError as error:
        _list(error.mistakes)
        return False
    if not quiet:
        of = "no puppet named" if made is None else f"moves {made.name}"
        held = "" if bound is None or not bound.held else f", {len(bound.held)} coordinates held"
        write(f"{file}: no mistakes; {len(stand.axes)} axes, {of}{held}")
    clean = True
    for given in inputs:
        if made is None or bound is None:
            fail(f"{file} names no puppet, which inputs need", "--inputs")
        clean &= _inputs(made, given, quiet) and _moved(bound, made, given)
    return clean


def _moved(bound: AxisMap, made: Marionette, path: Path) -> bool:
    """Whether a stand moves what inputs move."""
    given = motion(made, path).inputs
    times = np.linspace(given.start, given.end, max(2, round(_RATE * given.duration)))
    q_K = np.nan_to_num(given.evaluate(times)[0])
    try:
        bound.refuse_held(times, q_K)
    except FileError as error:
        _list(error.mistakes)
        return False
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
    size = measure(made.tree, made.number)
    lengths = " x ".join(f"{x:.3g}" for x in size.lengths)
    hangs = "" if size.hangs is None else f", hangs {size.hangs:.3g} m high"
    return f"{size.mass:.4g} kg, {lengths} m (x, y, z){hangs}"
