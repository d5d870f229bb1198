"""Files named on the command line: found before reading, checked before writing."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import typer

from fantoccini.app.console.terminal import plain
from fantoccini.base import FantocciniError, InputError, Mistake, OnProgress, PuppetError, nearest
from fantoccini.dynamics.marionette import Marionette, StringModel, load
from fantoccini.model.puppet import bundled_files
from fantoccini.output.animation import ENDINGS

NUMBERS = (".npz", ".csv")
PICTURES = (".png", ".svg", ".pdf")
FILMS = (".mp4", ".gif")
ANIMATIONS = tuple(ending for ending in ENDINGS if ending not in NUMBERS)


class OutputError(FantocciniError):
    """A file or folder could not be written."""


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turns an OSError into an OutputError that names the path."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from None


def puppet_path(name: str) -> Path:
    """The file of a FILE argument: a path, or the name of a bundled puppet or scene.

    Raises:
        PuppetError: it is neither, or the file is a motion.
    """
    path = Path(name)
    try:
        if path.is_file():
            if path.suffix.lower() == ".npz":
                message = f"found a motion; needed: a puppet. `fantoccini show {name}` replays it"
                raise PuppetError([Mistake(name, None, "", message)])
            return path
        missing = not path.exists()
    except OSError:
        return path  # reading it reports the error
    known = (*bundled_files.names(), *bundled_files.scenes())
    if name in known:
        return bundled_files.path(name)
    if missing and path.name == name and not path.suffix:
        hint = nearest(name, known)
        message = f"no such file, and no bundled puppet or scene of this name{hint}"
        raise PuppetError([Mistake(name, None, "", message)])
    return path


def inputs_path(given: Path) -> Path:
    """The file of an ``--inputs`` option: a path, or the name of a bundled performance.

    Raises:
        InputError: it is neither.
    """
    name = str(given)
    try:
        missing = not given.exists()
    except OSError:
        return given  # reading it reports the error
    if not missing or given.name != name or given.suffix:
        return given
    known = bundled_files.performances()
    if name in known:
        return bundled_files.performance(name)
    message = f"no such file, and no bundled performance of this name{nearest(name, known)}"
    raise InputError([Mistake(name, None, "", message)])


def marionette(
    name: str, progress: OnProgress | None = None, string_model: StringModel = "constraint"
) -> Marionette:
    """The marionette of a FILE argument."""
    return load(puppet_path(name), progress, string_model=string_model)


def check_output(path: Path, endings: Iterable[str], option: str) -> None:
    """Raises a usage error if no file can be written to a path.

    Args:
        path: of the file.
        endings: supported ones.
        option: that the path was given for.
    """
    endings = tuple(endings)
    if path.suffix.lower() not in endings:
        found = f"ends in {path.suffix!r}" if path.suffix else "has no ending"
        fail(f"{path} {found}; allowed: {', '.join(endings)}", option)
    check_folder(path.parent, option)
    try:
        if path.is_dir():
            fail(f"{path} is a folder", option)
    except OSError as error:
        fail(f"cannot write {path}: {error.strerror}", option)


def check_folder(folder: Path, option: str) -> None:
    """Raises a usage error if no file can be written into a folder."""
    try:
        if not folder.is_dir():
            fail(f"there is no folder {folder}", option)
    except OSError as error:
        fail(f"cannot read {folder}: {error.strerror}", option)
    if not os.access(folder, os.W_OK | os.X_OK):
        fail(f"cannot write into the folder {folder}", option)


def check_new_folder(folder: Path, option: str) -> None:
    """Raises a usage error unless the folder can be written, or created with its parents."""
    try:
        if folder.exists() and not folder.is_dir():
            fail(f"{folder} is a file, not a folder", option)
    except OSError as error:
        fail(f"cannot read {folder}: {error.strerror}", option)
    above = folder.absolute()
    while not above.exists():
        above = above.parent
    check_folder(above, option)


def fail(message: str, option: str) -> NoReturn:
    """Ends in a usage error: exit code 2."""
    raise typer.BadParameter(plain(message), param_hint=option)
