"""Readers of score and play files that report the line of every mistake.

A score times gestures of one puppet; a play has several puppets on a stage.
"""

from __future__ import annotations

import os
from typing import Any, TypeVar

from fantoccini.base.documents import document_schema, has_key, read_document
from fantoccini.theatre.script.log import ScriptLog
from fantoccini.theatre.script.play_file import PlayFile
from fantoccini.theatre.script.score_file import ScoreFile

FileT = TypeVar("FileT", ScoreFile, PlayFile)


def read_script(kind: type[FileT], path: str | os.PathLike[str]) -> tuple[FileT, ScriptLog]:
    """Script of a file, and its log, which has the file and the beat.

    Args:
        kind: class of the script.
        path: path of the file.

    Raises:
        FileError: the file has mistakes; all of them are listed, with their lines.
    """
    file = read_document(path, kind)
    return file, ScriptLog(file.located, file.tempo)


def is_score(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a score: YAML with the key `score`."""
    return has_key(path, "score")


def is_play(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a play: YAML with the key `play`."""
    return has_key(path, "play")


def score_schema() -> dict[str, Any]:
    """JSON Schema of a score file, for editors."""
    return document_schema(ScoreFile)


def play_schema() -> dict[str, Any]:
    """JSON Schema of a play file, for editors."""
    return document_schema(PlayFile)
