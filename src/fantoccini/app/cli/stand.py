"""``fantoccini stand``: whether a stand can do a run."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import typer

from fantoccini.app.console import FAILED, Steps, check_output, fail, marionette, table, write
from fantoccini.base import FileError, Mistake
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Trajectory
from fantoccini.stand import (
    QUANTITIES,
    SlowedRun,
    StandCheck,
    check_stand,
    load_stand,
    lost_lines,
    remedies,
    slower as found_slower,
)

_MAX_NAMED = 12
"""Broken limits that are listed."""


def check_run(
    stand: str,
    run: Path,
    puppet: str | None,
    report: Path | None,
    slower: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Checks a stand with a run, prints the margins, and exits with 1 if it cannot do it."""
    if report is not None:
        check_output(report, (".html",), "--report")
    read = load_stand(stand)
    with Steps(quiet or as_json) as steps:
        made, moved = motion_of(run, puppet, steps)
        steps.step("checking")
        found = check_stand(read, moved, made)
        tempo: tuple[SlowedRun | None, str] | None = None
        if slower and not found.ok:
            steps.step("simulating slower tempos")
            tempo = found_slower(found)
        if report is not None:
            from fantoccini.output import reports

            steps.step(f"drawing {report}")
            reports.stand_report(found, report, tempo)
    if as_json:
        write(json.dumps(as_data(found, tempo), indent=2))
    elif not quiet:
        _print(found, tempo)
    if not found.ok:
        raise typer.Exit(FAILED)


def motion_of(path: Path, puppet: str | None, steps: Steps) -> tuple[Marionette, Trajectory]:
    """The puppet and the run of a file: a run or a recording."""
    from fantoccini.app.console import load_recording

    recording = load_recording(path)
    if recording is not None:
        return recording.marionette, recording.trajectory
    run = Trajectory.load(path)
    if puppet is not None:
        made, table = marionette(puppet, steps.named), run.coordinates
        if (made.coordinates.q_D, made.coordinates.v_K) != (table.q_D, table.v_K):
            fail(f"{puppet} has other coordinates than the run", "--puppet")
        return made, run
    if run.puppet is None:
        text = "the run does not say what its puppet is; needed: --puppet FILE"
        raise FileError([Mistake(str(path), None, "", text)])
    return Marionette(run.puppet, steps.named), run


def _print(found: StandCheck, tempo: tuple[SlowedRun | None, str] | None) -> None:
    used = _columns(found)
    lines = []
    for axis in found.axes:
        cells = [found.margin_text(axis.name, q) for q in used]
        lines.append((axis.name, axis.kind, *cells))
    table("Margins [%]", ("axis", "motor", *(f"{q}>" for q in used)), lines)
    for limit in found.broken[:_MAX_NAMED]:
        write(f"from t = {limit.broken:.3f} s: {limit} ({limit.over} too much)")
    if len(found.broken) > _MAX_NAMED:
        write(f"and {len(found.broken) - _MAX_NAMED} more")
    for line in lost_lines(found):
        write(line)
    for line in remedies(found):
        write(f"would help: {line}")
    if tempo is not None:
        write(f"slower, simulated again: {tempo[1]}")
    for note in found.notes:
        write(f"note: {note}")
    write(found.summary())


def _columns(found: StandCheck) -> list[str]:
    told = {limit.quantity for limit in found.limits} | {"torque"}
    return [quantity for quantity in QUANTITIES if quantity in told]


def as_data(found: StandCheck, tempo: tuple[SlowedRun | None, str] | None) -> dict[str, Any]:
    """What is printed, as plain data."""
    slow = None if tempo is None else tempo[0]
    return {
        "stand": found.map.stand.name,
        "ok": found.ok,
        "summary": found.summary(),
        "first": None if found.first is None else dataclasses.asdict(found.first),
        "limits": [dataclasses.asdict(limit) for limit in found.limits],
        "undetermined": found.undetermined,
        "lost_steps": {name: dataclasses.asdict(lost) for name, lost in found.lost.items()},
        "remedies": list(remedies(found)),
        "slower": None
        if tempo is None
        else {
            "text": tempo[1],
            "factor": None if slow is None else slow.factor,
            "margin": None if slow is None else slow.check.margin,
            "apart": None if slow is None else slow.apart,
            "rms": None if slow is None else slow.rms,
        },
        "notes": list(found.notes),
    }
