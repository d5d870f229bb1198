"""Checks of the files named on the command line, before they are read or written."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import typer

from fantoccini.app.cli_support.terminal import escape_unprintable
from fantoccini.base import (
    FantocciniError,
    InputError,
    Mistake,
    OnProgress,
    PuppetError,
    did_you_mean,
)
from fantoccini.dynamics.marionette import Marionette, StringModel, load
from fantoccini.model.puppet import bundled_files
from fantoccini.output.animation import SUFFIXES

DATA_SUFFIXES = (".npz", ".csv")
PICTURE_SUFFIXES = (".png", ".svg", ".pdf")
FILM_SUFFIXES = (".mp4", ".gif")
CAPTION_SUFFIXES = (".srt",)
ANIMATION_SUFFIXES = tuple(suffix for suffix in SUFFIXES if suffix not in DATA_SUFFIXES)


class OutputError(FantocciniError):
    """A file or folder could not be written."""


@contextmanager
def output_errors(path: Path) -> Iterator[None]:
    """Context in which an OSError becomes an OutputError with the path."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from None


def puppet_path(name: str) -> Path:
    """Path of a FILE argument: a path, or the name of a bundled puppet or scene.

    Raises:
        PuppetError: there is no such file or name, or the file is a saved motion (.npz).
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
    names = (*bundled_files.names(), *bundled_files.scenes())
    if name in names:
        return bundled_files.path(name)
    if missing and path.name == name and not path.suffix:
        from fantoccini.stand import stand_names

        if name in stand_names():
            message = f"found a bundled stand; needed: a puppet. `fantoccini stand check {name}`"
            raise PuppetError([Mistake(name, None, "", f"{message} is for stands")])
        hint = did_you_mean(name, names)
        message = f"no such file, and no bundled puppet or scene with this name{hint}"
        raise PuppetError([Mistake(name, None, "", message)])
    return path


def inputs_path(path: Path) -> Path:
    """Path of an ``--inputs`` option: a path, or the name of a bundled performance's inputs.

    Raises:
        InputError: there is no such file or name.
    """
    name = str(path)
    try:
        missing = not path.exists()
    except OSError:
        return path  # reading it reports the error
    if not missing or path.name != name or path.suffix:
        return path
    names = bundled_files.performances()
    if name in names:
        return bundled_files.performance(name)
    hint = did_you_mean(name, names) or f"; the names are {', '.join(names)}"
    message = f"no such file, and no bundled performance with this name{hint}"
    raise InputError([Mistake(name, None, "", message)])


def load_marionette(
    name: str, progress: OnProgress | None = None, string_model: StringModel = "constraint"
) -> Marionette:
    """Compiled puppet of a FILE argument, which takes a file or a bundled name."""
    return load(puppet_path(name), progress, string_model=string_model)


def check_output(path: Path, suffixes: Iterable[str], option: str) -> None:
    """Raises a usage error if no file can be written to a path.

    Args:
        path: path of the file.
        suffixes: supported suffixes.
        option: name of the option that gave the path, for the message.
    """
    suffixes = tuple(suffixes)
    if path.suffix.lower() not in suffixes:
        problem = f"ends in {path.suffix!r}" if path.suffix else "has no ending"
        fail(f"{path} {problem}; allowed: {', '.join(suffixes)}", option)
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
    """Raises a usage error unless files can be written into a folder, or it can be created."""
    try:
        if folder.exists() and not folder.is_dir():
            fail(f"{folder} is a file, not a folder", option)
    except OSError as error:
        fail(f"cannot read {folder}: {error.strerror}", option)
    ancestor = folder.absolute()
    while not ancestor.exists():
        ancestor = ancestor.parent
    check_folder(ancestor, option)


def fail(message: str, option: str) -> NoReturn:
    """Raises a usage error about an option: exit code 2."""
    raise typer.BadParameter(escape_unprintable(message), param_hint=option)
