"""Files of scores and plays read: text to a checked file, with the line of every mistake."""

from __future__ import annotations

import os
from typing import Any, TypeVar

from fantoccini.base import FileError
from fantoccini.base.documents import described_schema, has_key, read_file, validate
from fantoccini.model.puppet import WORDS
from fantoccini.theatre.script.notes import Notes
from fantoccini.theatre.script.play_file import PlayFile
from fantoccini.theatre.script.score_file import ScoreFile

FileT = TypeVar("FileT", ScoreFile, PlayFile)

_KEYS: dict[type, tuple[str, str]] = {
    ScoreFile: ("score", "a score has the keys `score` and `lanes`"),
    PlayFile: ("play", "a play has the keys `play`, `cast` and `acts`"),
}
"""Kind of file -> the key that it is known by, and those that it needs."""
_OTHERS = ("puppet", "scene", "score", "play", "gesture")
"""Keys that kinds of files are known by."""


def read_script(kind: type[FileT], path: str | os.PathLike[str]) -> tuple[FileT, Notes]:
    """A score or a play as it is written, and notes that know the file and the beat.

    Args:
        kind: of file.
        path: of the file.

    Raises:
        FileError: with every mistake found and its location.
    """
    located = read_file(path)
    data = located.data if isinstance(located.data, dict) else {}
    key, needed = _KEYS[kind]
    other = next((other for other in _OTHERS if other in data and key not in data), None)
    if other is not None:
        raise located.error([((), f"this is a {other} file; {needed}")], FileError)
    file = validate(kind, located, words=WORDS)
    return file, Notes(located, file.tempo)


def is_score(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a score: YAML with the key `score`."""
    return has_key(path, "score")


def is_play(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a play: YAML with the key `play`."""
    return has_key(path, "play")


def score_schema() -> dict[str, Any]:
    """JSON Schema of a score file, for editors."""
    return described_schema(ScoreFile, "fantoccini score")


def play_schema() -> dict[str, Any]:
    """JSON Schema of a play file, for editors."""
    return described_schema(PlayFile, "fantoccini play")
