"""Files of bundled puppets, scenes and performances, and of ``puppet`` keys in other files.

A performance is a file of inputs, the motion of strings.
"""

from __future__ import annotations

import os
from pathlib import Path

from fantoccini.base import FileError, UnknownNameError, did_you_mean
from fantoccini.base.documents import Located, shown

_FOLDER = Path(__file__).parents[1] / "puppets"
_PERFORMANCES = _FOLDER / "performances"


def names() -> tuple[str, ...]:
    """Names of the bundled puppets."""
    return tuple(sorted(p.stem for p in _FOLDER.glob("*.yaml")))


def scenes() -> tuple[str, ...]:
    """Names of the bundled scenes."""
    return tuple(sorted(p.stem for p in (_FOLDER / "scenes").glob("*.yaml")))


def bundled(name: str) -> Path | None:
    """Path of a bundled puppet or scene; None if no such file is bundled."""
    files = [*_FOLDER.glob("*.yaml"), *(_FOLDER / "scenes").glob("*.yaml")]
    return {path.stem: path for path in files}.get(name)


def path(name: str) -> Path:
    """Path of a bundled puppet or scene.

    Args:
        name: one of ``names()`` or ``scenes()``.

    Raises:
        UnknownNameError: there is no bundled puppet or scene of this name.
    """
    file = bundled(name)
    if file is None:
        raise UnknownNameError("bundled puppet or scene", name, (*names(), *scenes()))
    return file


def performances() -> tuple[str, ...]:
    """Names of the bundled performances."""
    return tuple(sorted(p.stem for p in _PERFORMANCES.glob("*.yaml")))


def performance(name: str) -> Path:
    """Path of the inputs file of a bundled performance.

    Args:
        name: one of ``performances()``.

    Raises:
        UnknownNameError: there is no bundled performance of this name.
    """
    if name not in performances():
        raise UnknownNameError("bundled performance", name, performances())
    return _PERFORMANCES / f"{name}.yaml"


def named_file(name: str, located: Located) -> Path:
    """Path of the puppet or scene file in the key ``puppet`` of another file.

    Args:
        name: value of the key: a bundled name, or a file in the folder of the referring file.
        located: location of the referring file.

    Raises:
        FileError: there is no file and no bundled puppet or scene of this name.
    """
    bundled_names = (*names(), *scenes())
    if name in bundled_names and not os.path.exists(located.folder / name):
        return path(name)
    file = located.file_in_folder(name)
    if file is not None:
        return file
    hint = did_you_mean(name, bundled_names)
    message = f"found {shown(name)}: no file in this one's folder and no bundled puppet{hint}"
    raise located.error([(("puppet",), message)], FileError)
