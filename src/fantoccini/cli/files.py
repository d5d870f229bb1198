"""Files that are named on the command line: found before they are read, safe when written."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path

import typer

from fantoccini import puppets
from fantoccini.cli.terminal import plain
from fantoccini.errors import Problem, PuppetError, nearest
from fantoccini.marionette import Marionette, load

NUMBERS = (".npz", ".csv")
PICTURES = (".png", ".svg", ".pdf")
FILMS = (".mp4", ".gif")


def puppet_path(name: str) -> Path:
    """The file of a FILE argument: a path, or the name of a bundled puppet.

    Raises:
        PuppetError: there is neither.
    """
    path = Path(name)
    try:
        if path.is_file():
            return path
        missing = not path.exists()
    except OSError:
        return path  # reading it says why
    if name in puppets.names():
        return puppets.path(name)
    if missing and path.name == name and not path.suffix:
        hint = nearest(name, puppets.names())
        message = f"there is no such file, and no bundled puppet has this name{hint}"
        raise PuppetError([Problem(name, None, "", message)])
    return path


def marionette(
    name: str, progress: Callable[[str], None] | None = None, string_model: str = "constraint"
) -> Marionette:
    """The marionette of a FILE argument."""
    return load(puppet_path(name), progress, string_model=string_model)


def check_output(path: Path, endings: Iterable[str], option: str) -> None:
    """Raises a usage error when a file cannot be written under this name.

    Args:
        path: where it is to go.
        endings: those that are known.
        option: that named it, for the message.
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
        fail(f"{path} cannot be written: {error.strerror}", option)


def check_folder(folder: Path, option: str) -> None:
    """Raises a usage error when no file can be written into a folder."""
    try:
        if not folder.is_dir():
            fail(f"there is no folder {folder}", option)
    except OSError as error:
        fail(f"{folder} cannot be read: {error.strerror}", option)
    if not os.access(folder, os.W_OK | os.X_OK):
        fail(f"the folder {folder} cannot be written", option)


def fail(message: str, option: str) -> None:
    """Ends in a usage error: exit code 2."""
    raise typer.BadParameter(plain(message), param_hint=option)
