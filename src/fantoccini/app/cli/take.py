"""``fantoccini take``: describes or edits a recording.

A take is a recording of a performance for editing.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from fantoccini.app.cli_support import (
    ProgressDisplay,
    check_output,
    fail,
    output_errors,
    print_message,
    print_output,
    print_table,
)
from fantoccini.base import StateError
from fantoccini.theatre.perform import Recording


def edit_take(
    file: Path,
    out: Path | None,
    trim: str | None,
    smooth: float | None,
    stretch: float | None,
    loop: int | None,
    quiet: bool,
) -> None:
    """Reads a recording, edits it in the order of the options, and writes it.

    Args:
        file: the recording.
        out: file for the edited recording; None only describes the recording.
        trim: ``A:B``, seconds after the recording's start; either may be missing.
        smooth: time over which the hands' paths are averaged [s].
        stretch: factor on its duration.
        loop: number of repetitions.
        quiet: print nothing.
    """
    edits = [trim, smooth, stretch, loop]
    if out is None and any(edit is not None for edit in edits):
        fail("needed: a file for the edited recording", "--out")
    if out is not None:
        check_output(out, (".npz",), "--out")
    with ProgressDisplay(quiet) as display:
        display.stage(f"reading {file}")
        take = Recording.load(file)
        if trim is not None:
            take = _apply_edit(
                take,
                "--trim",
                lambda recording: recording.trimmed(*_parse_trim(trim, recording.duration)),
            )
        if smooth is not None:
            take = _apply_edit(take, "--smooth", lambda recording: recording.smoothed(smooth))
        if stretch is not None:
            take = _apply_edit(take, "--stretch", lambda recording: recording.stretched(stretch))
        if loop is not None:
            take = _apply_edit(take, "--loop", lambda recording: recording.looped(loop))
        if out is not None:
            display.stage("simulating it again")
            take = take.with_output()
            with output_errors(out):
                take.save(out)
    run = take.trajectory
    if not quiet:
        print_table(
            "Recording",
            ("", ">"),
            [
                ("puppet", take.marionette.name),
                ("duration [s]", f"{take.duration:g}"),
                ("ticks", len(take)),
                ("tick [ms]", f"{1e3 * take.tick:.3g}"),
                ("events", len(run.events)),
                ("ended", take.end_reason or run.status.name.lower()),
            ],
        )
    if out is not None:
        if run.t[-1] < take.start.t + take.duration - 0.5 * take.tick:
            print_message(
                f"fantoccini: the recording ends after {run.duration:g} s: {run.status.message}"
            )
        if not quiet:
            print_output(out)


def _apply_edit(take: Recording, option: str, edit: Callable[[Recording], Recording]) -> Recording:
    try:
        return edit(take)
    except (StateError, ValueError) as error:
        fail(str(error), option)


def _parse_trim(text: str, duration: float) -> tuple[float, float]:
    """Start and end of A:B [s]."""
    begin, colon, end = text.partition(":")
    try:
        span = float(begin or 0.0), float(end or duration)
    except ValueError:
        span = 0.0, -1.0
    if not colon or not span[0] < span[1]:
        fail(f"found {text!r}; needed: A:B, seconds after its start, such as 1.5:8 or :8", "--trim")
    return span
