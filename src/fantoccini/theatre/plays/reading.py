"""Play files read: the cast, what it can do and when it is to do it; nothing is simulated."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fantoccini.base import FileError, Mistake, nearest
from fantoccini.base.documents import read_file, validate
from fantoccini.model.puppet import WORDS
from fantoccini.theatre.cast import (
    WALKS,
    Cast,
    CueFile,
    Places,
    PlayFile,
    Timeline,
    read_cast,
    said,
)
from fantoccini.theatre.gestures import Notes, Spot
from fantoccini.theatre.plays.acting import Repertory
from fantoccini.theatre.plays.walks import Walks
from fantoccini.theatre.plays.whole import sounds_of

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


def read_script(path: str | os.PathLike[str]) -> Script:
    """A play as it is written.

    Args:
        path: of the file, or the name of a bundled play.

    Raises:
        FileError: with every mistake found and its location.
    """
    name = os.fspath(path)
    if not os.path.exists(name):
        if name not in play_names():
            text = "found nothing here, and no bundled play of this name"
            raise FileError([Mistake(name, None, "", text + nearest(name, play_names()))])
        path = _REPERTORY / f"{name}.yaml"
    located = read_file(path)
    data = located.data if isinstance(located.data, dict) else {}
    other = next((kind for kind in _OTHERS if kind in data and "play" not in data), None)
    if other is not None:
        text = f"this is a {other} file; a play has the keys `play`, `cast` and `acts`"
        raise located.error([((), text)], FileError)
    file = validate(PlayFile, located, words=WORDS)
    notes = Notes(located, file.tempo)
    places = Places(file, notes)
    _check_names(file, places, notes)
    cast = read_cast(file, places, notes)
    repertory = Repertory(cast, notes)
    timeline = Timeline(file, repertory.marks, notes)
    sounds_of(file, notes)
    notes.refuse()
    return Script(cast, timeline, repertory, places, notes)


def _check_names(file: PlayFile, places: Places, notes: Notes) -> None:
    """Notes names of acts that are not their own, and places that are none."""
    names: set[str] = set()
    for a, act in enumerate(file.acts):
        if act.act in names:
            notes.mistake(("acts", a, "act"), f"another act is called {act.act!r}")
        names.add(act.act)
        for i, cue in enumerate(act.cues):
            spot = "acts", a, "cues", i
            for verb in (*WALKS, "looks_at", "points_at"):
                where = getattr(cue, verb)
                if where is None:
                    continue
                if verb == "turns_to":
                    places.direction(where, (*spot, said(verb)))
                else:
                    places.check(where, (*spot, said(verb)))
            _check_props(file, cue, spot, notes)
            for k, where in enumerate(cue.past):
                places.check(where, (*spot, "past", k))
            if cue.facing is not None:
                places.direction(cue.facing, (*spot, "facing"))


def _check_props(file: PlayFile, cue: CueFile, spot: Spot, notes: Notes) -> None:
    """Notes names of props, and of what they are given, put and sat on, that are none."""
    obstacles = [one.name for one in file.stage.obstacles]
    seats = [*file.props, *obstacles]
    kinds: dict[str, tuple[Sequence[str], str]] = {
        "gives": (list(file.props), "prop"),
        "puts_down": (list(file.props), "prop"),
        "picks_up": (list(file.props), "prop"),
        "sits_on": (seats, "prop or obstacle"),
        "stands_up_from": (seats, "prop or obstacle"),
        "onto": (obstacles, "obstacle"),
        "to": (list(file.cast), "player"),
    }
    for key, (known, what) in kinds.items():
        name = getattr(cue, key)
        if name is not None and name not in known:
            text = f"no {what} is called {name!r}{nearest(name, known)}"
            notes.mistake((*spot, said(key)), text)
    if cue.to is not None and cue.to in cue.who:
        notes.mistake((*spot, "to"), f"{cue.to} gives it to itself; needed: another player")


def check_play(path: str | os.PathLike[str]) -> PlayFile:
    """Reads a play, its cast, its gestures and its times, and simulates nothing.

    A cue that its players can never do is a mistake, unless it is optional. When the play is
    compiled, such a cue is left out and reported.

    Args:
        path: of the file.

    Raises:
        FileError: with every mistake found and its location.
    """
    script = read_script(path)
    _check_abilities(script)
    script.notes.refuse()
    return script.cast.file


def _check_abilities(script: Script) -> None:
    """Notes cues whose players lack the strings or bodies, and walks to unreachable places."""
    cast, notes, walks = script.cast, script.notes, Walks(script.cast, script.notes)
    for cue in script.timeline.cues:
        given, spot = cue.given, (*cue.spot, said(cue.given.verb))
        if given.optional:
            continue
        places: list[tuple[Spot, object]] = []
        if cue.walks and given.turns_to is None and not given.near:
            places = [((*cue.spot, "past", k), where) for k, where in enumerate(given.past)]
            places.append((spot, getattr(given, given.verb)))
        for player in (cast.players[who] for who in cue.who):
            why = script.repertory.reason_unable(player, given)
            if why:
                notes.mistake(spot, why)
                continue
            for place_spot, where in places:
                there = script.places.fixed(where)
                why = "" if there is None else walks.obstruction(player, there)
                if why:
                    notes.mistake(place_spot, f"{player.name} cannot get there: {why}")
