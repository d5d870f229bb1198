"""Bundled puppets, scenes and performances, and lookup of the file behind a ``puppet`` key."""

from __future__ import annotations

import os
from pathlib import Path

from fantoccini.base import FileError, UnknownNameError, nearest
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
    """The file of a bundled puppet or scene, or None."""
    files = [*_FOLDER.glob("*.yaml"), *(_FOLDER / "scenes").glob("*.yaml")]
    return {path.stem: path for path in files}.get(name)


def path(name: str) -> Path:
    """The file of a bundled puppet or scene.

    Args:
        name: one of ``names()`` or ``scenes()``.

    Raises:
        UnknownNameError: there is none.
    """
    found = bundled(name)
    if found is None:
        raise UnknownNameError("bundled puppet or scene", name, (*names(), *scenes()))
    return found


def performances() -> tuple[str, ...]:
    """Names of the bundled performances."""
    return tuple(sorted(p.stem for p in _PERFORMANCES.glob("*.yaml")))


def performance(name: str) -> Path:
    """The inputs file of a bundled performance.

    Args:
        name: one of ``performances()``.

    Raises:
        UnknownNameError: there is none.
    """
    if name not in performances():
        raise UnknownNameError("bundled performance", name, performances())
    return _PERFORMANCES / f"{name}.yaml"


def named_file(name: str, located: Located) -> Path:
    """The puppet or scene file that the key ``puppet`` of another file refers to.

    Args:
        name: value of the key: a bundled name, or a file in the folder of the referring file.
        located: the referring file.

    Raises:
        FileError: no such file or bundled name.
    """
    known = (*names(), *scenes())
    if name in known and not os.path.exists(located.folder / name):
        return path(name)
    file = located.beside(name)
    if file is not None:
        return file
    hint = nearest(name, known)
    message = f"found {shown(name)}: no file in this one's folder and no bundled puppet{hint}"
    raise located.error([(("puppet",), message)], FileError)
