"""``fantoccini play``: a play compiled and verified; its cue times, report, numbers and film."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from fantoccini.app.console import (
    FAILED,
    PlayRequest,
    Steps,
    check_output,
    check_outputs,
    films_of,
    report_score,
    say,
    table,
    write,
    write_outputs,
)
from fantoccini.theatre.plays import check_play, load_play, verify_play

if TYPE_CHECKING:
    from fantoccini.theatre.plays import Verification


def play_file(request: PlayRequest) -> None:
    """Compiles and verifies a play, prints its cue times and the verdict, and writes the outputs.

    The exit code is 1 if a cue that is not optional cannot be done as written, or if the
    verification has faults.
    """
    out, report = request.out or [], request.report
    check_outputs(out, None)
    request.look.check(out)
    if report is not None:
        check_output(report, (".html",), "--report")
    with Steps(request.quiet) as steps:
        began = time.perf_counter()
        play = load_play(request.file, progress=steps.named, within=request.within)
        compiled = time.perf_counter()
        steps.step(f"simulating and measuring {play.duration:.1f} s")
        within = request.within
        left = None if within is None else max(within - (compiled - began), 0.0)
        verification = verify_play(play, within=left)
        verified = time.perf_counter()
    # Printed first, because the outputs may take longer than everything before.
    if not request.quiet:
        _print(verification)
        report_score(play.score, out)
        _summary(verification, compiled - began, verified - compiled)
    for change in play.changes:
        say(str(change))
    for fault in verification.faults:
        say(f"{request.file}: {fault}")
    _write(request, verification, out)
    if play.lacking or not verification:
        raise typer.Exit(FAILED)


def _write(request: PlayRequest, verification: Verification, out: list[Path]) -> None:
    """Writes the report and the outputs."""
    play, look = verification.play, request.look
    with Steps(request.quiet) as steps:
        if request.report is not None:
            from fantoccini.output import reports

            drawing = steps.bar(f"drawing {request.report}")
            reports.play_report(verification, request.report, progress=drawing)
        if out:
            from fantoccini.output.view import AUDIENCE

            films = {**films_of(play.score), "follow": False}
            look = look if look.view is not None else replace(look, view=AUDIENCE)
            run = verification.run
            write_outputs(play.marionette, run, out, None, steps, look=look, films=films)


def checked_play(path: Path) -> str:
    """What a play without mistakes has, in a line.

    Raises:
        FileError: with every mistake found.
    """
    file = check_play(path)
    cues = sum(len(act.cues) for act in file.acts)
    return ", ".join(
        _count(n, what)
        for n, what in ((len(file.cast), "player"), (len(file.acts), "act"), (cues, "cue"))
    )


def _print(verification: Verification) -> None:
    """Prints the cues of every act with their times."""
    play = verification.play
    seen: dict[int, list[tuple[str, ...]]] = {}
    for one in verification.cues:
        seen.setdefault(one.cue.number, []).append(
            (one.who, f"{one.wanted:.2f}", f"{one.seen:.2f}", f"{1e3 * one.late:+.0f}")
        )
    for name, start in play.acts.items():
        lines = []
        for cue in play.cues:
            if cue.act != name:
                continue
            what = f"{cue.words} ({cue.mark})" if cue.mark else cue.words
            wanted = f"{cue.wanted:.2f}"
            left = "left out" if cue.optional else "cannot be done"
            refused = [(", ".join(cue.who), wanted, left, "")] if cue.refused else []
            for times in refused or seen.get(cue.number, []):
                lines.append((cue.number, cue.line, what, *times))
        header = ("cue>", "line>", "what", "who", "wanted [s]>", "seen [s]>", "late [ms]>")
        table(f"{name}, from {start:.2f} s", header, lines)


def _summary(verification: Verification, compiling: float, verifying: float) -> None:
    play = verification.play
    whole = play.marionette
    write(
        f"{play.duration:.1f} s, {_count(len(play.cast.players), 'player')}, "
        f"{whole.coordinates.n_vD} degrees of freedom, "
        f"{_count(len(whole.tree.strings), 'string')}, {whole.coordinates.n_vK} driven "
        f"coordinates; compiled in {compiling:.1f} s, {_count(play.rounds, 'round')}, "
        f"verified in {verifying:.1f} s"
    )
    worst = f"no cue more than {1e3 * verification.worst:.0f} ms off"
    broken = len(verification.faults)
    holds = _count(broken, "fault") if broken else "the run holds"
    write(f"{play.counts}; {worst}; {holds}")
    for why in dict.fromkeys(verification.stepped):
        write(f"where something touches, time steps of 0.25 ms were taken: {why}")


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"
