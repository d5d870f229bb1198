"""``fantoccini export``: writes a puppet's equations as C99, or a saved motion in other formats."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

from fantoccini.app.cli_support import (
    ExportArguments,
    OutputOptions,
    Steps,
    check_folder,
    check_outputs,
    fail,
    marionette,
    say,
    write,
    write_outputs,
    writing,
)
from fantoccini.base import Status
from fantoccini.dynamics.compiled import check_mass_matrix
from fantoccini.kernel import codegen

_OPTION = "OUT"


def export_file(arguments: ExportArguments) -> None:
    """Writes a saved motion, or the equations of a puppet."""
    if arguments.file.lower().endswith(".npz"):
        _export_motion(arguments)
    else:
        _export_c99(arguments)


def _export_motion(arguments: ExportArguments) -> None:
    """Writes a saved motion; the ending of ``out`` selects the format."""
    if arguments.force:
        fail("applies to puppets; a file is replaced in any case", "--force")
    output_options = OutputOptions.of(
        None, None, None, None, arguments.fps, bodies=arguments.bodies
    ).of_part(arguments.begin, arguments.end)
    out = [arguments.out]
    check_outputs(out, None, _OPTION)
    output_options.check(out)
    from fantoccini.app.web import subject_of

    with Steps(arguments.quiet) as steps:
        subject = subject_of(arguments.file, arguments.problem, steps.named)
        assert subject.run is not None
        output_options.part(subject.run)  # a mistake in the times before anything is written
        write_outputs(
            subject.marionette, subject.run, out, None, steps, output_options=output_options
        )
    run = subject.run
    if run.status is not Status.DONE and not arguments.quiet:
        say(f"fantoccini: the run ended at t = {run.t[-1]:g} s: {run.status.message}")


def _export_c99(arguments: ExportArguments) -> None:
    """Writes the C99 files; each appears only when complete."""
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
    _check(folder, arguments.force)
    puppet = marionette(arguments.file)
    with Steps(arguments.quiet) as steps:
        steps.step("deriving the equations of motion")
        check_mass_matrix(puppet.puppet, puppet.tree)
        files = codegen.c99_files(puppet.equations)
    with writing(folder):
        _write(files, folder)
    if not arguments.quiet:
        for name in files:
            write(folder / name)


def _check(folder: Path, force: bool) -> None:
    try:
        exists = folder.exists()
        full = folder.is_dir() and any(folder.iterdir())
    except OSError as error:
        fail(f"cannot read {folder}: {error.strerror}", _OPTION)
    if exists and not folder.is_dir():
        fail(f"{folder} is a file, not a folder", _OPTION)
    if full and not force:
        fail(f"{folder} is not empty; use --force to write into it", _OPTION)
    check_folder(folder if exists else folder.absolute().parent, _OPTION)


def _write(files: dict[str, str], folder: Path) -> None:
    """Writes into a temporary folder, then renames the folder or moves the files."""
    parent = folder if folder.exists() else folder.absolute().parent
    temporary = Path(tempfile.mkdtemp(prefix=".fantoccini-", dir=parent))
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
    """Permissions that new files lack; reading them requires setting them."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
