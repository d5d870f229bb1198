"""``fantoccini export``: a puppet's equations as C99 files."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

from fantoccini import codegen
from fantoccini.cli.files import check_folder, fail, marionette
from fantoccini.cli.terminal import Steps, write
from fantoccini.errors import FantocciniError
from fantoccini.marionette import check_mass_matrix

_OPTION = "DIR"


class ExportError(FantocciniError):
    """The files could not be written."""


def export_c99(file: str, folder: Path, force: bool, quiet: bool) -> None:
    """Writes the files; they appear whole.

    Args:
        file: FILE argument.
        folder: where they go; made when it is not there.
        force: write into a folder that is not empty, over files of the same name.
        quiet: do not list them.
    """
    _check(folder, force)
    made = marionette(file)
    with Steps(quiet) as steps:
        steps.step("deriving the equations of motion")
        check_mass_matrix(made.world, made.tree)
        files = codegen.c99_files(made.equations)
    try:
        _write(files, folder)
    except OSError as error:
        raise ExportError(f"{folder} cannot be written: {error.strerror or error}") from None
    if not quiet:
        for name in files:
            write(folder / name)


def _check(folder: Path, force: bool) -> None:
    try:
        there = folder.exists()
        full = folder.is_dir() and any(folder.iterdir())
    except OSError as error:
        fail(f"{folder} cannot be read: {error.strerror}", _OPTION)
    if there and not folder.is_dir():
        fail(f"{folder} is a file; a folder is needed", _OPTION)
    if full and not force:
        fail(f"{folder} is not empty; --force writes into it", _OPTION)
    check_folder(folder if there else folder.absolute().parent, _OPTION)


def _write(files: dict[str, str], folder: Path) -> None:
    """Writes into a temporary folder, and then renames it or moves the files one by one."""
    place = folder if folder.exists() else folder.absolute().parent
    temporary = Path(tempfile.mkdtemp(prefix=".fantoccini-", dir=place))
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
    """The rights that new files do not get; asking for them sets them."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
