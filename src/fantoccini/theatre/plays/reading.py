"""Play files read: the cast, what it can do and when it is to do it; nothing is simulated."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from fantoccini.base import FileError, Mistake, nearest
from fantoccini.theatre.cast import Cast, Kept, Places, play_timeline, read_cast
from fantoccini.theatre.plays.player_gestures import PlayerGestures
from fantoccini.theatre.plays.walks import Walks
from fantoccini.theatre.plays.whole import sounds_of
from fantoccini.theatre.script import (
    VERBS,
    GivesCue,
    PlayCue,
    PlayFile,
    ScriptLog,
    Spot,
    Timeline,
    WalkCue,
    read_script,
    spelled,
)

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
        gestures: what its players can do.
        places: what names of places mean.
        log: collects mistakes; knows the file and the beat.
    """

    cast: Cast
    timeline: Timeline[PlayCue]
    gestures: PlayerGestures
    places: Places
    log: ScriptLog


def read_play(path: str | os.PathLike[str], kept: Kept) -> Script:
    """A play as it is written.

    Args:
        path: of the file, or the name of a bundled play.
        kept: results of earlier versions of the play.

    Raises:
        FileError: with every mistake found and its location.
    """
    name = os.fspath(path)
    if not os.path.exists(name):
        if name not in play_names():
            text = "found nothing here, and no bundled play of this name"
            raise FileError([Mistake(name, None, "", text + nearest(name, play_names()))])
        path = _REPERTORY / f"{name}.yaml"
    file, log = read_script(PlayFile, path)
    places = Places(file, log)
    _check_names(file, places, log)
    cast = read_cast(file, places, log)
    gestures = PlayerGestures(cast, log, kept)
    timeline = play_timeline(file, gestures.marks, log)
    sounds_of(file, log)
    log.mistakes.refuse()
    return Script(cast, timeline, gestures, places, log)


def _check_names(file: PlayFile, places: Places, log: ScriptLog) -> None:
    """Records names of acts that are not their own, and places that are none."""
    names: set[str] = set()
    for a, act in enumerate(file.acts):
        if act.act in names:
            log.mistakes.add(("acts", a, "act"), f"another act is called {act.act!r}")
        names.add(act.act)
        for i, cue in enumerate(act.cues):
            spot = "acts", a, "cues", i
            _check_named(file, cue, spot, places, log)


def _check_named(file: PlayFile, cue: PlayCue, spot: Spot, places: Places, log: ScriptLog) -> None:
    """Records names of places, players, props, seats and tables that are none."""
    obstacles = [obstacle.name for obstacle in file.stage.obstacles]
    known = {
        "player": ("player", [*file.cast]),
        "prop": ("prop", [*file.props]),
        "seat": ("prop or obstacle", [*file.props, *obstacles]),
        "table": ("obstacle", obstacles),
    }
    for key, kind in VERBS[cue.verb].names.items():
        given, place = getattr(cue, key), (*spot, spelled(key))
        if kind == "direction" and given is not None:
            places.direction(given, place)
        elif key == "past":
            for k, where in enumerate(given):
                places.check(where, (*place, k))
        elif kind == "place":
            places.check(given, place)
        elif kind in known and given not in known[kind][1]:
            what, names = known[kind]
            log.mistakes.add(place, f"no {what} is called {given!r}{nearest(given, names)}")
    if isinstance(cue, GivesCue) and cue.to in cue.who:
        log.mistakes.add((*spot, "to"), f"{cue.to} gives it to itself; needed: another player")


def check_play(path: str | os.PathLike[str]) -> PlayFile:
    """Reads a play, its cast, its gestures and its times, and simulates nothing.

    A cue that its players can never do is a mistake, unless it is optional. When the play is
    compiled, such a cue is left out and reported.

    Args:
        path: of the file.

    Raises:
        FileError: with every mistake found and its location.
    """
    script = read_play(path, Kept())
    _check_abilities(script)
    script.log.mistakes.refuse()
    return script.cast.file


def _check_abilities(script: Script) -> None:
    """Records cues whose players lack the strings or bodies, and walks to unreachable places."""
    cast, log, walks = script.cast, script.log, Walks(script.cast, script.log)
    for cue in script.timeline.cues:
        given, spot = cue.given, (*cue.spot, spelled(cue.given.verb))
        if given.optional:
            continue
        places: list[tuple[Spot, object]] = []
        if isinstance(given, WalkCue) and not given.near:
            places = [((*cue.spot, "past", k), where) for k, where in enumerate(given.past)]
            places.append((spot, given.verb_value))
        for player in (cast.players[who] for who in cue.who):
            why = script.gestures.reason_unable(player, given)
            if why:
                log.mistakes.add(spot, why)
                continue
            for place_spot, where in places:
                there = script.places.fixed(where)
                why = "" if there is None else walks.obstruction(player, there)
                if why:
                    log.mistakes.add(place_spot, f"{player.name} cannot get there: {why}")
