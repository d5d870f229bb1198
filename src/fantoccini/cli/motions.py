"""What `--inputs` may name: inputs files, recordings and scores."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from fantoccini.errors import Mistake
from fantoccini.gestures import is_score, load_score
from fantoccini.marionette import Marionette
from fantoccini.motion import Input


def motion(marionette: Marionette, path: Path) -> tuple[Input, Iterable[Mistake]]:
    """The inputs in a file, and the changes that compiling a score required.

    Raises:
        FileError: with every mistake in the file.
    """
    if is_score(path):
        score = load_score(marionette, path)
        return score.inputs(marionette.rest()), score.changes
    return Input.load(marionette, path), ()
