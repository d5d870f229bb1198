"""``fantoccini validate-reduction``: which claims of the paper's Sec. VI hold for a puppet."""

from __future__ import annotations

from pathlib import Path

from fantoccini.cli.files import check_new_folder, marionette, writing
from fantoccini.cli.terminal import Steps, table, write
from fantoccini.motion import Input
from fantoccini.reduction import validate_reduction


def validate_file(file: str, inputs: Path | None, folder: Path, quiet: bool) -> None:
    """Measures, prints the verdicts and tables, and writes the report.

    Args:
        file: FILE argument.
        inputs: a file with the motion to compare, or None.
        folder: of the report; created if it does not exist.
        quiet: no progress and no tables.
    """
    check_new_folder(folder, "--out")
    with Steps(quiet) as steps:
        puppet = marionette(file, steps.step)
        given = None if inputs is None else Input.load(puppet, inputs)
        report = validate_reduction(puppet, given, steps.step)
        steps.step(f"writing {folder}")
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
            files = report.write(folder)
    if quiet:
        return
    for part in report.tables():
        table(part.title, part.header, part.lines)
    for paragraph in report.meaning:
        write(paragraph + "\n")
    for line in report.verdicts():
        write(line)
    write("wrote " + ", ".join(map(str, files)))
