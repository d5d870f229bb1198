"""``fantoccini identify``: identifies numbers of a puppet from a record of its motion.

A record is measurements of a puppet in motion under known inputs.
"""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

import typer

from fantoccini.app.cli_support import (
    FAILED,
    IdentifyArguments,
    ProgressDisplay,
    check_output,
    fail,
    output_errors,
    print_output,
    print_table,
)
from fantoccini.base import Progress, replacing
from fantoccini.lab.identification import (
    Candidate,
    IdentificationResult,
    doubts,
    identify,
    load_record,
    record_files,
    suggest_motion,
)

_MAX_LISTED = 10
"""Largest number of outliers and motions that are listed."""
_DEFAULT_DURATION = 10.0
"""Default duration of candidate motions [s]."""
_DEFAULT_AMPLITUDE = 0.05
"""Default amplitude of candidate motions [m]."""
_MIN_INFORMATION = 0.05
"""Information below which 0.0 is printed [bits]."""


def identify_record(arguments: IdentifyArguments) -> None:
    """Identifies, prints the results and writes the outputs.

    Exits with 1 if there are reasons to doubt the result: among others, the record does not
    determine every number, or the search did not converge.
    """
    file, out, report, suggest = (
        arguments.file,
        arguments.out,
        arguments.report,
        arguments.suggest,
    )
    duration, reach, seed = arguments.duration, arguments.reach, arguments.seed
    force, threads, quiet = arguments.force, arguments.threads, arguments.quiet
    for option, path, endings in (
        ("--out", out, (".yaml", ".yml")),
        ("--report", report, (".json", ".html")),
        ("--suggest", suggest, (".csv",)),
    ):
        if path is not None:
            check_output(path, endings, option)
    for option, value in (("--duration", duration), ("--reach", reach), ("--seed", seed)):
        if value is not None and suggest is None:
            fail("applies to --suggest PATH", option)
    for option, path in (("--out", out), ("--report", report), ("--suggest", suggest)):
        if path is not None and os.path.exists(path):
            if any(path.samefile(file_of_record) for file_of_record in record_files(file)):
                fail(f"{path} is a file of the record; write to another one", option)
            if option == "--out" and not force:
                fail(f"{path} exists already; use --force to replace it", option)
    if force and out is None:
        fail("applies to --out PATH; other files are replaced in any case", "--force")
    with ProgressDisplay(quiet) as display:
        record = load_record(file, progress=display.update)
        if out is not None:
            record.check_folder(out.parent)
        result = identify(
            record,
            threads=threads,
            progress=lambda progress: display.stage(_progress_text(progress)),
        )
    if not quiet:
        _print_result(result)
    if out is not None:
        with output_errors(out):
            result.save_puppet(out)
    if report is not None:
        with output_errors(report):
            _save_report(result, report, quiet)
    if suggest is not None:
        with ProgressDisplay(quiet) as display:
            motions = suggest_motion(
                record,
                duration=_DEFAULT_DURATION if duration is None else duration,
                reach=_DEFAULT_AMPLITUDE if reach is None else reach,
                seed=seed or 0,
                threads=threads,
                progress=lambda progress: display.stage(f"evaluating the motion {progress.what}"),
            )
            with output_errors(suggest):
                motions[0].save(suggest)
        if not quiet:
            print_motions(motions)
    if doubts(result):
        raise typer.Exit(FAILED)


def _progress_text(progress: Progress) -> str:
    return progress.what if progress.best is None else f"{progress.what}: {progress.best:.6g}"


def _print_result(result: IdentificationResult) -> None:
    rows = []
    for name, value, deviation in zip(result.names, result.values, result.deviations, strict=True):
        if math.isfinite(deviation):
            low, high = result.interval(name)
            rows.append((name, f"{value:.6g}", f"{deviation:.2g}", f"{low:.6g} to {high:.6g}"))
        else:
            rows.append((name, "undetermined", "", ""))
    print_table("Identified", ("", "value>", "standard deviation>", "95 % interval>"), rows)
    if result.combinations:
        print_output("Combinations that the record does not determine:")
        for combination in result.combinations:
            print_output(f"  {combination}")
    print_table(
        "Residuals (m, rad or N)",
        ("", "root mean square>", "noise>"),
        [(name, f"{rms:.3g}", f"{result.noise[name]:.3g}") for name, rms in result.rms().items()],
    )
    for outlier in result.outliers[:_MAX_LISTED]:
        print_output(
            f"outlier: {outlier.column} at {outlier.t:.4g} s, {outlier.residual:+.1f} deviations"
        )
    if len(result.outliers) > _MAX_LISTED:
        print_output(f"and {len(result.outliers) - _MAX_LISTED} more outliers")
    if result.record.constant_inputs:
        print_output(f"the inputs do not move {', '.join(result.record.constant_inputs)}")
    if result.rejected:
        times = [f"{t + result.delay:.4g} s" for t in result.rejected[:_MAX_LISTED]]
        n_more = len(result.rejected) - len(times)
        print_output(
            "rejected segments, from: "
            + ", ".join(times)
            + (f" and {n_more} more" if n_more else "")
        )
    for doubt in doubts(result):
        print_output(f"doubt: {doubt}")
    print_output(f"chi2 {result.chi2:.3f}, drift {result.drift:.2g}, {result.seconds:.1f} s")


def print_motions(motions: tuple[Candidate, ...]) -> None:
    """Prints motions, the most informative first, or that none is informative."""
    print_table(
        "Motions",
        ("", "information [bits]>", "worst deviation>", "undetermined>"),
        [
            (
                motion.name,
                f"{motion.gain:.1f}",
                f"{100 * motion.worst:.2g} %",
                len(motion.combinations),
            )
            for motion in motions[:_MAX_LISTED]
            if not motion.failure
        ],
    )
    if motions[0].gain < _MIN_INFORMATION:
        print_output(
            "no motion gives information about these numbers; a larger --reach, or other columns, "
            "may help"
        )


def _save_report(result: IdentificationResult, path: Path, quiet: bool) -> None:
    """Writes a page or, by the ending of the path, all numbers as JSON."""
    if path.suffix.lower() == ".html":
        from fantoccini.output import reports

        with ProgressDisplay(quiet) as display:
            display.stage(f"drawing {path}")
            reports.identified_report(result, path)
    else:
        _save_numbers(result, path)


def _save_numbers(result: IdentificationResult, path: Path) -> None:
    def finite_or_none(x: float) -> float | None:
        return float(x) if math.isfinite(x) else None

    data: dict[str, Any] = {
        "record": result.record.name,
        "puppet": result.record.marionette.name,
        "numbers": {
            name: {
                "value": finite_or_none(x),
                "standard_deviation": finite_or_none(d),
                "interval": [finite_or_none(end) for end in result.interval(name)],
            }
            for name, x, d in zip(result.names, result.values, result.deviations, strict=True)
        },
        "correlation": result.correlation.tolist(),
        "not_told_apart": [
            {"parts": item.parts, "relative_deviation": finite_or_none(item.deviation)}
            for item in result.combinations
        ],
        "residuals": {name: finite_or_none(x) for name, x in result.rms().items()},
        "noise": result.noise,
        "chi2": finite_or_none(result.chi2),
        "drift": finite_or_none(result.drift),
        "converged": result.converged,
        "doubts": list(doubts(result)),
        "left": finite_or_none(result.remaining_move),
        "lost": list(result.rejected),
        "outliers": [vars(item) for item in result.outliers],
        "seconds": result.seconds,
    }
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
