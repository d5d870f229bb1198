"""Gesture files beside a script, by their names with or without ending."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from fantoccini.base import StateError
from fantoccini.base.documents import Located
from fantoccini.theatre.gestures.gesture_file import is_gesture

_TAKE = ".npz"
_ENDINGS = (".yaml", ".yml", _TAKE)
"""Endings that may be left out."""


def gesture_beside(
    located: Located, name: str, bundled: Collection[str], endings: Collection[str] = ()
) -> Path | None:
    """File beside a script that a gesture's name means, with or without its ending.

    Args:
        located: the script.
        name: name of a gesture in the script.
        bundled: names of bundled gestures.
        endings: endings of further files that may be left out.

    Returns:
        The file; None if there is none, so that the name may be that of a bundled gesture.

    Raises:
        StateError: the name without ending has several meanings.
    """
    if (exact := located.beside(name)) is not None:
        return exact
    files: dict[str, Path] = {}
    for ending in (*_ENDINGS, *endings):
        path = located.beside(name + ending)
        if path is not None and (ending in (_TAKE, *endings) or is_gesture(path)):
            files[path.name] = path
    if not files:
        return None
    meanings = [*files, *(["a bundled gesture"] if name in bundled else [])]
    if len(meanings) > 1:
        text = f"{name!r} is {' and '.join(meanings)}; write {' or '.join(files)} for the file"
        raise StateError(text + ", or rename it for the bundled gesture" * (name in bundled))
    (path,) = files.values()
    return path
