"""``fantoccini stand check``: checks whether a stand can do a run.

A stand is the machine that moves a puppet. An axis is one of its motors with its gear; a margin is
the remaining part of a bound, such as its torque. v_K are the velocities of driven coordinates,
which axes move, and q_D the dynamic coordinates.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import typer

from fantoccini.app.cli_support import (
    FAILED,
    ProgressDisplay,
    check_output,
    fail,
    load_marionette,
    print_output,
    print_table,
)
from fantoccini.base import FileError, Mistake
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Trajectory
from fantoccini.stand import (
    QUANTITIES,
    SlowedRun,
    StandCheck,
    check_stand,
    find_slower_tempo,
    load_stand,
    lost_step_lines,
    remedies,
)

_MAX_LISTED_LIMITS = 12
"""Largest number of broken limits that are listed."""


def check_run(
    stand: str,
    run: Path,
    puppet: str | None,
    report: Path | None,
    slower: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Checks whether a stand can do a run, prints its margins, and exits with 1 if it cannot."""
    if report is not None:
        check_output(report, (".html",), "--report")
    loaded_stand = load_stand(stand)
    with ProgressDisplay(quiet or as_json) as display:
        marionette, trajectory = load_run(run, puppet, display)
        display.stage("checking")
        result = check_stand(loaded_stand, trajectory, marionette)
        tempo: tuple[SlowedRun | None, str] | None = None
        if slower and not result.ok:
            display.stage("simulating slower tempos")
            tempo = find_slower_tempo(result)
        if report is not None:
            from fantoccini.output import reports

            display.stage(f"drawing {report}")
            reports.stand_report(result, report, tempo)
    if as_json:
        print_output(json.dumps(to_json_data(result, tempo), indent=2))
    elif not quiet:
        _print_check(result, tempo)
    if not result.ok:
        raise typer.Exit(FAILED)


def load_run(
    path: Path, puppet: str | None, display: ProgressDisplay
) -> tuple[Marionette, Trajectory]:
    """Puppet and motion of a run or a recording."""
    from fantoccini.app.cli_support import load_recording

    recording = load_recording(path)
    if recording is not None:
        return recording.marionette, recording.trajectory
    run = Trajectory.load(path)
    if puppet is not None:
        marionette, coordinates = load_marionette(puppet, display.update), run.coordinates
        if (marionette.coordinates.q_D, marionette.coordinates.v_K) != (
            coordinates.q_D,
            coordinates.v_K,
        ):
            fail(f"{puppet} has other coordinates than the run", "--puppet")
        return marionette, run
    if run.puppet is None:
        text = "the run does not say what its puppet is; needed: --puppet FILE"
        raise FileError([Mistake(str(path), None, "", text)])
    return Marionette(run.puppet, display.update), run


def _print_check(check: StandCheck, tempo: tuple[SlowedRun | None, str] | None) -> None:
    quantities = _checked_quantities(check)
    table_lines = []
    for axis in check.axes:
        cells = [check.margin_text(axis.name, q) for q in quantities]
        table_lines.append((axis.name, axis.kind, *cells))
    print_table("Margins [%]", ("axis", "motor", *(f"{q}>" for q in quantities)), table_lines)
    for limit in check.broken[:_MAX_LISTED_LIMITS]:
        print_output(f"from t = {limit.broken:.3f} s: {limit} (exceeded by {limit.excess_text})")
    if len(check.broken) > _MAX_LISTED_LIMITS:
        print_output(f"and {len(check.broken) - _MAX_LISTED_LIMITS} more")
    for line in lost_step_lines(check):
        print_output(line)
    for line in remedies(check):
        print_output(f"remedy: {line}")
    if tempo is not None:
        print_output(f"slower, simulated again: {tempo[1]}")
    for note in check.notes:
        print_output(f"note: {note}")
    print_output(check.summary())


def _checked_quantities(check: StandCheck) -> list[str]:
    checked = {limit.quantity for limit in check.limits} | {"torque"}
    return [quantity for quantity in QUANTITIES if quantity in checked]


def to_json_data(check: StandCheck, tempo: tuple[SlowedRun | None, str] | None) -> dict[str, Any]:
    """The printed results as plain data."""
    slowed_run = None if tempo is None else tempo[0]
    return {
        "stand": check.map.stand.name,
        "ok": check.ok,
        "summary": check.summary(),
        "first": None if check.first is None else dataclasses.asdict(check.first),
        "limits": [dataclasses.asdict(limit) for limit in check.limits],
        "undetermined": check.undetermined,
        "lost_steps": {name: dataclasses.asdict(lost) for name, lost in check.lost.items()},
        "remedies": list(remedies(check)),
        "slower": None
        if tempo is None
        else {
            "text": tempo[1],
            "factor": None if slowed_run is None else slowed_run.factor,
            "margin": None if slowed_run is None else slowed_run.check.margin,
            "apart": None if slowed_run is None else slowed_run.deviation,
            "rms": None if slowed_run is None else slowed_run.rms,
        },
        "notes": list(check.notes),
    }
