"""Puppets that other files name: bundled ones, and files beside them."""

from __future__ import annotations

import os
from collections.abc import Callable

from fantoccini import puppets
from fantoccini.errors import FileError, nearest
from fantoccini.marionette import Marionette, load
from fantoccini.puppet.located import Located, shown


def puppet_of(
    name: str, located: Located, progress: Callable[[str], None] | None = None
) -> Marionette:
    """The puppet or scene that a file names under ``puppet``.

    Args:
        name: of a bundled one, or of a file in the folder of the other.
        located: the file that names it.
        progress: called with a description of each slow step.

    Raises:
        FileError: there is none.
    """
    known = (*puppets.names(), *puppets.scenes())
    if name in known and not os.path.exists(located.folder / name):
        return load(puppets.path(name), progress)
    file = located.beside(name)
    if file is not None:
        return load(file, progress)
    hint = nearest(name, known)
    message = f"found {shown(name)}: no file in this one's folder and no bundled puppet{hint}"
    raise located.error([(("puppet",), message)], FileError)
