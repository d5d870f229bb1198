"""``fantoccini play``: compiles and verifies a play; writes its report, numbers and film.

A cue is a line of a play, a verb with its player and time; a mark is a named time of its gesture.
In names, D stands for dynamic coordinates, which move by the equations of motion, and K for driven
ones: ends and lengths of strings, driven joints.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from fantoccini.app.cli_support import (
    FAILED,
    PlayArguments,
    ProgressDisplay,
    check_captions,
    check_output,
    check_outputs,
    check_time_range,
    film_options,
    print_message,
    print_output,
    print_table,
    report_score,
    write_outputs,
)
from fantoccini.theatre.plays import check_play, load_play, verify_play

if TYPE_CHECKING:
    from fantoccini.theatre.plays import Verification


def play_file(arguments: PlayArguments) -> None:
    """Compiles and verifies a play, prints its cue times and the verdict, and writes the outputs.

    Exits with 1 if a cue that is not optional cannot be done as written, or if the verification has
    faults.
    """
    out, report = arguments.out or [], arguments.report
    check_outputs(out, None, captions=True)
    arguments.output_options.check(out)
    if report is not None:
        check_output(report, (".html",), "--report")
    with ProgressDisplay(arguments.quiet) as display:
        start_time = time.perf_counter()
        play = load_play(
            arguments.file, progress=display.update, within=arguments.within, on_disk=True
        )
        compile_end = time.perf_counter()
        check_captions(out, play.score.captions)
        check_time_range(arguments.begin, arguments.end, 0.0, play.duration)
        display.stage(f"simulating and measuring {play.duration:.1f} s")
        within = arguments.within
        remaining = None if within is None else max(within - (compile_end - start_time), 0.0)
        verification = verify_play(play, within=remaining)
        verify_end = time.perf_counter()
    # Printed first, because the outputs may take longer than everything else.
    if not arguments.quiet:
        _print_acts(verification)
        report_score(play.score, out)
        _print_summary(verification, compile_end - start_time, verify_end - compile_end)
    for change in play.changes:
        print_message(str(change))
    for fault in verification.faults:
        print_message(f"{arguments.file}: {fault}")
    _write_outputs(arguments, verification, out)
    if play.deviations or not verification:
        raise typer.Exit(FAILED)


def _write_outputs(arguments: PlayArguments, verification: Verification, out: list[Path]) -> None:
    """Writes the report and the outputs."""
    play, output_options = verification.play, arguments.output_options
    with ProgressDisplay(arguments.quiet) as display:
        if arguments.report is not None:
            from fantoccini.output import reports

            report_progress = display.bar(f"drawing {arguments.report}")
            reports.play_report(verification, arguments.report, progress=report_progress)
        if out:
            from fantoccini.output.view import AUDIENCE

            film_arguments = {**film_options(play.score), "follow": False}
            if output_options.view is None:
                output_options = replace(output_options, view=AUDIENCE)
                film_arguments["shots"] = play.shots
            run = verification.run
            write_outputs(
                play.marionette,
                run,
                out,
                None,
                display,
                output_options=output_options,
                film_options=film_arguments,
            )


def play_counts_text(path: Path) -> str:
    """Line with the numbers of players, acts and cues of a play.

    Raises:
        FileError: the play has mistakes; lists all of them.
    """
    file = check_play(path)
    cues = sum(len(act.cues) for act in file.acts)
    return ", ".join(
        _count_text(n, noun)
        for n, noun in ((len(file.cast), "player"), (len(file.acts), "act"), (cues, "cue"))
    )


def _print_acts(verification: Verification) -> None:
    """Prints the cues of every act with their planned and observed times."""
    play = verification.play
    cells_by_cue: dict[int, list[tuple[str, ...]]] = {}
    for observation in verification.cues:
        cells_by_cue.setdefault(observation.cue.number, []).append(
            (
                observation.who,
                f"{observation.wanted:.2f}",
                f"{observation.observed:.2f}",
                f"{1e3 * observation.lateness:+.0f}",
            )
        )
    for name, start in play.acts.items():
        rows = []
        for cue in play.cues:
            if cue.act != name:
                continue
            action = f"{cue.action} ({cue.mark})" if cue.mark else cue.action
            action += f", {cue.passes}" if cue.passes else ""
            planned = f"{cue.wanted:.2f}"
            refusal = "left out" if cue.optional else "cannot be done"
            refused_cells = [(", ".join(cue.who), planned, refusal, "")] if cue.refused else []
            for cells in refused_cells or cells_by_cue.get(cue.number, []):
                rows.append((cue.number, cue.line, action, *cells))
        header = (
            "cue>",
            "line>",
            "action",
            "players",
            "planned [s]>",
            "observed [s]>",
            "late [ms]>",
        )
        print_table(f"{name}, from {start:.2f} s", header, rows)


def _print_summary(verification: Verification, compiling: float, verifying: float) -> None:
    play = verification.play
    marionette = play.marionette
    print_output(
        f"{play.duration:.1f} s, {_count_text(len(play.cast.players), 'player')}, "
        f"{marionette.coordinates.n_vD} degrees of freedom, "
        f"{_count_text(len(marionette.tree.strings), 'string')}, {marionette.coordinates.n_vK} "
        f"driven coordinates; compiled in {compiling:.1f} s, {_count_text(play.rounds, 'round')}, "
        f"verified in {verifying:.1f} s"
    )
    worst_text = f"no cue is off by more than {1e3 * verification.max_lateness:.0f} ms"
    n_faults = len(verification.faults)
    verdict = _count_text(n_faults, "fault") if n_faults else "the run meets every requirement"
    print_output(f"{play.counts}; {worst_text}; {verdict}")
    if verification.feet:
        slide = max(walk.feet.max_slide for walk in verification.feet)
        print_output(f"feet on the floor slide by at most {1e3 * slide:.1f} mm in a step")
    for reason in dict.fromkeys(verification.stepping_reasons):
        print_output(f"time steps of 0.25 ms were taken during contacts: {reason}")


def _count_text(n: int, noun: str) -> str:
    return f"{n} {noun}{'' if n == 1 else 's'}"
