"""``fantoccini export``: writes a puppet's equations as C99, or a saved motion in other formats.

C99 is a version of the language C. A marionette is a puppet with its compiled equations;
`marionette.puppet` is the description in its file.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

from fantoccini.app.cli_support import (
    ExportArguments,
    OutputOptions,
    ProgressDisplay,
    check_folder,
    check_outputs,
    fail,
    load_marionette,
    output_errors,
    print_message,
    print_output,
    write_outputs,
)
from fantoccini.base import Status
from fantoccini.dynamics.compiled import check_mass_matrix
from fantoccini.kernel import codegen

_OUT_ARGUMENT = "OUT"
"""Name of the argument for the output file or folder, in messages."""


def export_file(arguments: ExportArguments) -> None:
    """Writes a saved motion, or the equations of a puppet."""
    if arguments.file.lower().endswith(".npz"):
        _export_motion(arguments)
    else:
        _export_c99(arguments)


def _export_motion(arguments: ExportArguments) -> None:
    """Writes a saved motion; the suffix of ``out`` selects the format."""
    if arguments.force:
        fail("applies to puppets; a file is replaced in any case", "--force")
    output_options = OutputOptions.parse(
        None, None, None, None, arguments.fps, bodies=arguments.bodies
    ).for_part(arguments.begin, arguments.end)
    out = [arguments.out]
    check_outputs(out, None, _OUT_ARGUMENT)
    output_options.check(out)
    from fantoccini.app.web import subject_of

    with ProgressDisplay(arguments.quiet) as display:
        subject = subject_of(arguments.file, arguments.problem, display.update)
        assert subject.run is not None
        output_options.part(subject.run)  # reports wrong times before anything is written
        write_outputs(
            subject.marionette, subject.run, out, None, display, output_options=output_options
        )
    run = subject.run
    if run.status is not Status.DONE and not arguments.quiet:
        print_message(f"fantoccini: the run ended at t = {run.t[-1]:g} s: {run.status.message}")


def _export_c99(arguments: ExportArguments) -> None:
    """Writes the C99 files; they are put in place when all are complete."""
    for option, value in (
        ("--fps", arguments.fps),
        ("--bodies", arguments.bodies),
        ("--problem", arguments.problem),
        ("--from", arguments.begin),
        ("--to", arguments.end),
    ):
        if value is not None:
            fail("applies to motions (.npz)", option)
    folder = arguments.out
    _check_folder(folder, arguments.force)
    marionette = load_marionette(arguments.file)
    with ProgressDisplay(arguments.quiet) as display:
        display.stage("deriving the equations of motion")
        check_mass_matrix(marionette.puppet, marionette.tree)
        files = codegen.c99_files(marionette.equations)
    with output_errors(folder):
        _write_files(files, folder)
    if not arguments.quiet:
        for name in files:
            print_output(folder / name)


def _check_folder(folder: Path, force: bool) -> None:
    """Raises a usage error if the files cannot be written, or the folder is not empty."""
    try:
        exists = folder.exists()
        has_files = folder.is_dir() and any(folder.iterdir())
    except OSError as error:
        fail(f"cannot read {folder}: {error.strerror}", _OUT_ARGUMENT)
    if exists and not folder.is_dir():
        fail(f"{folder} is a file, not a folder", _OUT_ARGUMENT)
    if has_files and not force:
        fail(f"{folder} is not empty; use --force to write into it", _OUT_ARGUMENT)
    check_folder(folder if exists else folder.absolute().parent, _OUT_ARGUMENT)


def _write_files(files: dict[str, str], folder: Path) -> None:
    """Writes into a temporary folder, then renames the folder or moves the files."""
    existing = folder if folder.exists() else folder.absolute().parent
    temporary = Path(tempfile.mkdtemp(prefix=".fantoccini-", dir=existing))
    try:
        for name, text in files.items():
            (temporary / name).write_text(text, encoding="utf-8")
        if folder.exists():
            for name in files:
                os.replace(temporary / name, folder / name)
        else:
            temporary.chmod(0o777 & ~_umask())
            temporary.rename(folder)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _umask() -> int:
    """Permission bits that new files lack; they can only be read by setting them."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
