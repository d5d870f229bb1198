"""Play files read: the cast, what it can do and when it is to do it; nothing is simulated."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from fantoccini.errors import FileError, Mistake, nearest
from fantoccini.gestures.notes import Notes
from fantoccini.plays.acting import Repertory
from fantoccini.plays.casting import Cast, Places, read_cast
from fantoccini.plays.cues import Timeline
from fantoccini.plays.play import Play
from fantoccini.plays.play_file import PlayFile
from fantoccini.puppet.located import read_file, validate

_OTHERS = ("puppet", "scene", "score", "gesture")
"""Keys of files of other kinds."""


_REPERTORY = Path(__file__).parent / "repertory"


def play_names() -> tuple[str, ...]:
    """Names of the bundled plays."""
    return tuple(sorted(path.stem for path in _REPERTORY.glob("*.yaml")))


@dataclass(frozen=True, eq=False)
class Script:
    """A play as it is written.

    Attributes:
        cast: its players, where they hang at the start.
        timeline: its cues.
        repertory: what its players can do.
        places: what names of places mean.
        notes: take mistakes; they know the file and the beat.
    """

    cast: Cast
    timeline: Timeline
    repertory: Repertory
    places: Places
    notes: Notes


def read_script(path: str | os.PathLike[str], before: Play | None = None) -> Script:
    """A play as it is written.

    Args:
        path: of the file, or the name of a bundled play.
        before: an earlier version of the play, whose cast is used where it has not changed.

    Raises:
        FileError: with every mistake found and its location.
    """
    name = os.fspath(path)
    if not Path(name).exists():
        if name not in play_names():
            text = f"found no file, and no bundled play of this name{nearest(name, play_names())}"
            raise FileError([Mistake(name, None, "", text)])
        path = _REPERTORY / f"{name}.yaml"
    located = read_file(path)
    data = located.data if isinstance(located.data, dict) else {}
    other = next((kind for kind in _OTHERS if kind in data and "play" not in data), None)
    if other is not None:
        text = f"this is a {other} file; a play has the keys `play`, `cast` and `acts`"
        raise located.error([((), text)], FileError)
    file = validate(PlayFile, located)
    notes = Notes(located, file.tempo)
    places = Places(file, notes)
    if before is not None and (before.cast.file.cast, before.cast.file.stage, file.play) == (
        file.cast, file.stage, before.cast.file.play,
    ):  # fmt: skip
        cast = Cast(before.cast.players, before.cast.whole, before.cast.x0, file)
    else:
        cast = read_cast(file, places, notes)
    repertory = Repertory(cast, notes)
    timeline = Timeline(file, repertory.marks, notes)
    notes.refuse()
    return Script(cast, timeline, repertory, places, notes)


def check_play(path: str | os.PathLike[str]) -> PlayFile:
    """Reads a play, its cast, its gestures and its times, and simulates nothing.

    Args:
        path: of the file.

    Raises:
        FileError: with every mistake found and its location.
    """
    return read_script(path).cast.file
