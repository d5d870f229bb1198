"""``fantoccini check``: lists all mistakes in files, and warnings.

A stand is the machine that moves a puppet by its axes, the motors. q_K are the driven coordinates,
ends and lengths of strings, which the inputs move. In names, D stands for dynamic coordinates,
which move by the equations of motion.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import typer

from fantoccini.app.cli.play import play_counts_text
from fantoccini.app.cli_support import (
    MISTAKE,
    ProgressDisplay,
    fail,
    inputs_warnings,
    load_marionette,
    load_motion,
    print_message,
    print_output,
    puppet_warnings,
    score_lines,
)
from fantoccini.base import FileError, Mistake, did_you_mean
from fantoccini.dynamics.compiled import check_mass_matrix
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import bundled_files
from fantoccini.model.tree import measure
from fantoccini.stand import AxisMap, is_stand, load_stand, stand_names
from fantoccini.theatre.plays import play_names
from fantoccini.theatre.script import is_play

_CHECK_RATE = 200.0
"""Times per second at which inputs are checked."""


def check_files(files: list[str], inputs: list[Path], quiet: bool) -> None:
    """Checks plays, stands and puppets, and each puppet and stand with all inputs.

    Args:
        files: FILE arguments: puppets, plays and stands.
        inputs: inputs files.
        quiet: print only mistakes and warnings.
    """
    all_correct = True
    for file in files:
        mistakes = _unknown_name(file)
        if mistakes:
            _print_problems(mistakes)
            all_correct = False
            continue
        if is_play(file) or (file in play_names() and not os.path.exists(file)):
            all_correct &= _check_play(file, inputs, quiet)
            continue
        if is_stand(file) or (file in stand_names() and not os.path.exists(file)):
            all_correct &= _check_stand(file, inputs, quiet)
            continue
        puppet = _load_puppet(file)
        all_correct &= puppet is not None
        if puppet is None:
            continue
        problems = puppet_warnings(puppet, file)
        _print_problems(problems)
        if not quiet:
            table = puppet.coordinates
            print_output(
                f"{file}: no mistakes{_warning_count(problems)}; {table.n_vD} DOF, "
                f"{len(puppet.tree.strings)} strings, {table.n_vK} driven"
            )
            print_output(f"{file}: {_size_text(puppet)}")
        for path in inputs:
            all_correct &= _check_inputs(puppet, path, quiet)
    if not all_correct:
        raise typer.Exit(MISTAKE)


def _unknown_name(file: str) -> list[Mistake]:
    """The mistake of a name that is neither a file nor bundled."""
    names = (*bundled_files.names(), *bundled_files.scenes(), *play_names(), *stand_names())
    path = Path(file)
    try:
        if file in names or path.name != file or path.suffix or path.exists():
            return []
    except OSError:
        return []  # reading it reports the error
    hint = did_you_mean(file, names)
    text = f"no such file, and no bundled puppet, scene, play or stand of this name{hint}"
    return [Mistake(file, None, "", text)]


def _load_puppet(file: str) -> Marionette | None:
    try:
        puppet = load_marionette(file)
        check_mass_matrix(puppet.puppet, puppet.tree)
    except FileError as error:
        _print_problems(error.mistakes)
        return None
    return puppet


def _check_play(file: str, inputs: list[Path], quiet: bool) -> bool:
    if inputs:
        fail(f"applies to puppets, and {file} is a play", "--inputs")
    try:
        with ProgressDisplay(quiet) as display:
            display.stage(f"reading {file}; the first time, its puppets are compiled")
            counts_text = play_counts_text(Path(file))
    except FileError as error:
        _print_problems(error.mistakes)
        return False
    if not quiet:
        print_output(
            f"{file}: no mistakes; {counts_text}; `fantoccini play` checks whether it can be done"
        )
    return True


def _check_stand(file: str, inputs: list[Path], quiet: bool) -> bool:
    """Checks a stand, alone, with its puppet, and with every inputs file."""
    try:
        stand = load_stand(file)
        path = stand.puppet_path
        puppet = None if path is None else load_marionette(str(path))
        axis_map = None if puppet is None else AxisMap.from_stand(stand, puppet.coordinates)
    except FileError as error:
        _print_problems(error.mistakes)
        return False
    if not quiet:
        motion_text = "no puppet named" if puppet is None else f"moves {puppet.name}"
        held_text = (
            ""
            if axis_map is None or not axis_map.held
            else f", {len(axis_map.held)} coordinates held"
        )
        n_controllers = len(stand.controllers)
        controllers_text = f" on {n_controllers} controllers" if n_controllers else ""
        print_output(
            f"{file}: no mistakes; {len(stand.axes)} axes{controllers_text}, {motion_text}"
            f"{held_text}"
        )
    all_correct = True
    for inputs_file in inputs:
        if puppet is None or axis_map is None:
            fail(f"{file} names no puppet, which inputs need", "--inputs")
        all_correct &= _check_inputs(puppet, inputs_file, quiet) and _check_moves(
            axis_map, puppet, inputs_file
        )
    return all_correct


def _check_moves(axis_map: AxisMap, puppet: Marionette, path: Path) -> bool:
    """Whether a stand can move everything that the inputs move."""
    inputs = load_motion(puppet, path).inputs
    times = np.linspace(inputs.start, inputs.end, max(2, round(_CHECK_RATE * inputs.duration)))
    q_K = np.nan_to_num(inputs.evaluate(times)[0])
    try:
        axis_map.check_held(times, q_K)
    except FileError as error:
        _print_problems(error.mistakes)
        return False
    return True


def _check_inputs(puppet: Marionette, path: Path, quiet: bool) -> bool:
    try:
        file_motion = load_motion(puppet, path)
    except FileError as error:
        _print_problems(error.mistakes)
        return False
    inputs = file_motion.inputs
    problems = inputs_warnings(puppet, inputs, path, file_motion.changes)
    _print_problems(problems)
    if not quiet:
        print_output(
            f"{path}: no mistakes{_warning_count(problems)}; "
            f"drives {puppet.name} for {inputs.duration:g} s"
        )
        for line in score_lines(file_motion.score) if file_motion.score is not None else ():
            print_output(f"{path}: {line}")
    return True


def _print_problems(problems: Iterable[Mistake]) -> None:
    for problem in problems:
        print_message(str(problem))


def _warning_count(problems: list[Mistake]) -> str:
    if not problems:
        return ""
    return ", 1 warning" if len(problems) == 1 else f", {len(problems)} warnings"


def _size_text(puppet: Marionette) -> str:
    """Mass, extent and hanging height of a puppet in its start pose."""
    size = measure(puppet.tree, puppet.number)
    lengths = " x ".join(f"{x:.3g}" for x in size.lengths)
    height = ""
    if size.hanging_height is not None:
        height = f"; its strings begin {size.hanging_height:.3g} m above its lowest point"
    return f"{size.mass:.4g} kg, {lengths} m (x, y, z){height}"
