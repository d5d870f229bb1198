"""``fantoccini identify``: numbers of a puppet from a record of its motion."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

import typer

from fantoccini.app.console import FAILED, Steps, check_output, fail, table, write, writing
from fantoccini.base import Progress, replacing
from fantoccini.lab.identification import (
    Candidate,
    Identified,
    doubts,
    identify,
    load_record,
    record_files,
    suggest_motion,
)

_MOST = 10
"""Outliers and motions that are listed."""
_DURATION, _REACH = 10.0, 0.05
"""Of the motions that are tried [s], [m]."""
_LITTLE = 0.05
"""Bits that are printed as 0."""


def identify_record(
    file: Path,
    out: Path | None,
    report: Path | None,
    suggest: Path | None,
    duration: float | None,
    reach: float | None,
    seed: int | None,
    force: bool,
    threads: int | None,
    quiet: bool,
) -> None:
    """Identifies, prints what was found, and writes the outputs.

    Exit code 1 where the record leaves something untold or the search was cut short.
    """
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
            if any(path.samefile(one) for one in record_files(file)):
                fail(f"{path} is a file of the record; write to another one", option)
            if option == "--out" and not force:
                fail(f"{path} exists already; use --force to replace it", option)
    if force and out is None:
        fail("applies to --out PATH; other files are replaced in any case", "--force")
    with Steps(quiet) as steps:
        record = load_record(file, progress=steps.named)
        if out is not None:
            record.check_folder(out.parent)
        found = identify(record, threads=threads, progress=lambda at: steps.step(_doing(at)))
    if not quiet:
        _print(found)
    if out is not None:
        with writing(out):
            found.save_puppet(out)
    if report is not None:
        with writing(report):
            _save_report(found, report, quiet)
    if suggest is not None:
        with Steps(quiet) as steps:
            best = suggest_motion(
                record,
                duration=_DURATION if duration is None else duration,
                reach=_REACH if reach is None else reach,
                seed=seed or 0,
                threads=threads,
                progress=lambda at: steps.step(f"looking at the motion {at.what}"),
            )
            with writing(suggest):
                best[0].save(suggest)
        if not quiet:
            print_motions(best)
    if found.combinations or not found.converged:
        raise typer.Exit(FAILED)


def _doing(at: Progress) -> str:
    return at.what if at.best is None else f"{at.what}: {at.best:.6g}"


def _print(found: Identified) -> None:
    rows = []
    for name, value, deviation in zip(found.names, found.values, found.deviations, strict=True):
        if math.isfinite(deviation):
            low, high = found.interval(name)
            rows.append((name, f"{value:.6g}", f"{deviation:.2g}", f"{low:.6g} to {high:.6g}"))
        else:
            rows.append((name, "not told", "", ""))
    table("Identified", ("", "value>", "standard deviation>", "95 % interval>"), rows)
    if found.combinations:
        write("The record cannot tell apart:")
        for combination in found.combinations:
            write(f"  {combination}")
    table(
        "Residuals (m, rad or N)",
        ("", "root mean square>", "noise>"),
        [(name, f"{rms:.3g}", f"{found.noise[name]:.3g}") for name, rms in found.rms().items()],
    )
    for outlier in found.outliers[:_MOST]:
        write(f"outlier: {outlier.column} at {outlier.t:.4g} s, {outlier.residual:+.1f} deviations")
    if len(found.outliers) > _MOST:
        write(f"and {len(found.outliers) - _MOST} more outliers")
    if found.record.still:
        write(f"the inputs do not move {', '.join(found.record.still)}")
    if found.lost:
        times = [f"{t + found.delay:.4g} s" for t in found.lost[:_MOST]]
        more = len(found.lost) - len(times)
        write(
            "segments that do not count, from: "
            + ", ".join(times)
            + (f" and {more} more" if more else "")
        )
    for doubt in doubts(found):
        write(f"doubt: {doubt}")
    write(f"chi2 {found.chi2:.3f}, drift {found.drift:.2g}, {found.seconds:.1f} s")


def print_motions(best: tuple[Candidate, ...]) -> None:
    """Prints motions, best first, and whether they tell anything."""
    table(
        "Motions",
        ("", "tells [bits]>", "worst deviation>", "untold>"),
        [
            (one.name, f"{one.gain:.1f}", f"{100 * one.worst:.2g} %", len(one.combinations))
            for one in best[:_MOST]
            if not one.refused
        ],
    )
    if best[0].gain < _LITTLE:
        write("no motion tells anything of these numbers; more --reach, or other columns, may")


def _save_report(found: Identified, path: Path, quiet: bool) -> None:
    """By the ending of the path: a page, or all numbers."""
    if path.suffix.lower() == ".html":
        from fantoccini.output import reports

        with Steps(quiet) as steps:
            steps.step(f"drawing {path}")
            reports.identified_report(found, path)
    else:
        _save_numbers(found, path)


def _save_numbers(found: Identified, path: Path) -> None:
    def number(x: float) -> float | None:
        return float(x) if math.isfinite(x) else None

    data: dict[str, Any] = {
        "record": found.record.name,
        "puppet": found.record.marionette.name,
        "numbers": {
            name: {
                "value": number(x),
                "standard_deviation": number(d),
                "interval": [number(end) for end in found.interval(name)],
            }
            for name, x, d in zip(found.names, found.values, found.deviations, strict=True)
        },
        "correlation": found.correlation.tolist(),
        "not_told_apart": [
            {"parts": one.parts, "relative_deviation": number(one.deviation)}
            for one in found.combinations
        ],
        "residuals": {name: number(x) for name, x in found.rms().items()},
        "noise": found.noise,
        "chi2": number(found.chi2),
        "drift": number(found.drift),
        "converged": found.converged,
        "doubts": list(doubts(found)),
        "left": number(found.left),
        "lost": list(found.lost),
        "outliers": [vars(one) for one in found.outliers],
        "seconds": found.seconds,
    }
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
