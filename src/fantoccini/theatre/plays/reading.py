"""Reader of play files: cast, gestures and times of cues; nothing is simulated.

A cue is a line of a play: a verb with its player and time. A spot is the list of keys that leads to
an entry of the file. Mistakes of the file are recorded in a log.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from fantoccini.base import FileError, Mistake, did_you_mean
from fantoccini.theatre.cast import Cast, Places, ResultCache, play_timeline, read_cast
from fantoccini.theatre.plays.player_gestures import PlayerGestures
from fantoccini.theatre.plays.shots import check_shots
from fantoccini.theatre.plays.stage_score import sounds_of
from fantoccini.theatre.plays.walk_planner import WalkPlanner
from fantoccini.theatre.script import (
    VERBS,
    GivesCue,
    PlayCue,
    PlayFile,
    ScriptLog,
    Spot,
    Timeline,
    WalkCue,
    file_key,
    read_script,
)

_REPERTORY = Path(__file__).parent / "repertory"
"""Folder of the bundled plays."""


def play_names() -> tuple[str, ...]:
    """Names of the bundled plays."""
    return tuple(sorted(path.stem for path in _REPERTORY.glob("*.yaml")))


@dataclass(frozen=True, eq=False)
class Script:
    """Play as its file describes it.

    Attributes:
        cast: players at the start.
        timeline: cues with their times.
        gestures: gestures of the players.
        places: places by name.
        log: collects mistakes; has the file and the tempo.
    """

    cast: Cast
    timeline: Timeline[PlayCue]
    gestures: PlayerGestures
    places: Places
    log: ScriptLog


def play_path(path: str | os.PathLike[str]) -> Path:
    """Path of a play: an existing path, or that of a bundled play with this name.

    Raises:
        FileError: there is no such file or name.
    """
    name = os.fspath(path)
    if os.path.exists(name):
        return Path(name)
    if name not in play_names():
        text = "found nothing here, and no bundled play of this name"
        raise FileError([Mistake(name, None, "", text + did_you_mean(name, play_names()))])
    return _REPERTORY / f"{name}.yaml"


def read_play(path: str | os.PathLike[str], cache: ResultCache) -> Script:
    """Script of a play file.

    Args:
        path: path of the file.
        cache: results of earlier versions of the play.

    Raises:
        FileError: the file has mistakes; all of them are listed, with their lines.
    """
    file, log = read_script(PlayFile, path)
    places = Places(file, log)
    _check_names(file, places, log)
    check_shots(file, log)
    cast = read_cast(file, places, log)
    gestures = PlayerGestures(cast, log, cache)
    timeline = play_timeline(file, gestures.marks, log)
    sounds_of(file, log)
    log.mistakes.raise_if_any()
    return Script(cast, timeline, gestures, places, log)


def _check_names(file: PlayFile, places: Places, log: ScriptLog) -> None:
    """Records repeated names of acts, and unknown places."""
    names: set[str] = set()
    for act_index, act in enumerate(file.acts):
        if act.act in names:
            log.mistakes.add(("acts", act_index, "act"), f"another act is called {act.act!r}")
        names.add(act.act)
        for cue_index, cue in enumerate(act.cues):
            spot = "acts", act_index, "cues", cue_index
            _check_cue_names(file, cue, spot, places, log)


def _check_cue_names(
    file: PlayFile, cue: PlayCue, spot: Spot, places: Places, log: ScriptLog
) -> None:
    """Records unknown names of places, players, props, seats and tables."""
    obstacles = [obstacle.name for obstacle in file.stage.obstacles]
    known_names = {
        "player": ("player", [*file.cast]),
        "prop": ("prop", [*file.props]),
        "seat": ("prop or obstacle", [*file.props, *obstacles]),
        "table": ("obstacle", obstacles),
    }
    for key, kind in VERBS[cue.verb].name_kinds.items():
        name, key_path = getattr(cue, key), (*spot, file_key(key))
        if kind == "direction" and name is not None:
            places.direction(name, key_path)
        elif key == "past":
            for index, passed_place in enumerate(name):
                places.check(passed_place, (*key_path, index))
        elif kind == "place":
            places.check(name, key_path)
        elif kind in known_names and name not in known_names[kind][1]:
            kind_in_words, names = known_names[kind]
            text = f"no {kind_in_words} is called {name!r}{did_you_mean(name, names)}"
            log.mistakes.add(key_path, text)
    if isinstance(cue, GivesCue) and cue.to in cue.who:
        log.mistakes.add((*spot, "to"), f"{cue.to} gives it to itself; needed: another player")


def check_play(path: str | os.PathLike[str]) -> PlayFile:
    """Play file whose cast, gestures and times are checked; nothing is simulated.

    A cue that its players can never do is a mistake, unless it is optional. In a compiled play such
    a cue is left out and reported.

    Args:
        path: path of the file, or the name of a bundled play.

    Raises:
        FileError: the file has mistakes; all of them are listed, with their lines.
    """
    script = read_play(play_path(path), ResultCache())
    _check_abilities(script)
    script.log.mistakes.raise_if_any()
    return script.cast.file


def _check_abilities(script: Script) -> None:
    """Records cues whose players lack strings or bodies, and walks to unreachable places."""
    cast, log, planner = script.cast, script.log, WalkPlanner(script.cast, script.log)
    for cue in script.timeline.cues:
        entry, spot = cue.entry, (*cue.spot, file_key(cue.entry.verb))
        if entry.optional:
            continue
        places: list[tuple[Spot, object]] = []
        if isinstance(entry, WalkCue) and not entry.near:
            places = [((*cue.spot, "past", k), place) for k, place in enumerate(entry.past)]
            places.append((spot, entry.verb_value))
        for player in (cast.players[who] for who in cue.who):
            reason = script.gestures.reason_unable(player, entry)
            if reason:
                log.mistakes.add(spot, reason)
                continue
            for key_path, place in places:
                fixed_place = script.places.fixed_place(place)
                reason = "" if fixed_place is None else planner.obstruction(player, fixed_place)
                if reason:
                    log.mistakes.add(key_path, f"{player.name} cannot get there: {reason}")
