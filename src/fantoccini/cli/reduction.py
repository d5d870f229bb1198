"""``fantoccini validate-reduction``: what of Sec. VI of the paper holds for a puppet."""

from __future__ import annotations

from pathlib import Path

from fantoccini.cli.files import check_folder, fail, marionette
from fantoccini.cli.terminal import Steps, table, write
from fantoccini.errors import FantocciniError
from fantoccini.motion import Input
from fantoccini.reduction import validate_reduction
from fantoccini.reduction.page import tables, verdict


class ReportError(FantocciniError):
    """The report could not be written."""


def validate_file(file: str, inputs: Path | None, folder: Path, quiet: bool) -> None:
    """Measures, prints a verdict and tables, and writes the report.

    Args:
        file: FILE argument.
        inputs: a file with the motion to compare, or None.
        folder: where the report goes; made when it is not there.
        quiet: neither progress nor tables.
    """
    _check(folder)
    with Steps(quiet) as steps:
        made = marionette(file, steps.step)
        given = None if inputs is None else Input.load(made, inputs)
        report = validate_reduction(made, given, steps.step)
        steps.step(f"writing {folder}")
        try:
            folder.mkdir(parents=True, exist_ok=True)
            left = report.write(folder)
        except OSError as error:
            raise ReportError(f"{folder} cannot be written: {error.strerror or error}") from None
    if quiet:
        return
    for made in tables(report):
        table(made.title, made.header, made.rows)
    for paragraph in report.meaning:
        write(paragraph + "\n")
    for line in verdict(report):
        write(line)
    write("left " + ", ".join(map(str, left)))


def _check(folder: Path) -> None:
    """Ends in a usage error where the report cannot go, before anything long begins."""
    try:
        there = folder.exists()
        if there and not folder.is_dir():
            fail(f"{folder} is a file; a folder is needed", "--out")
    except OSError as error:
        fail(f"{folder} cannot be read: {error.strerror}", "--out")
    above = folder.absolute()
    while not above.exists():
        above = above.parent
    check_folder(above, "--out")
