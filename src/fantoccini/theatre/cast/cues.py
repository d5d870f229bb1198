"""Cues of a play with their players, and the times at which they begin.

A cue is a line of a play: a verb with its players and its time. A lane is a list of cues or
gestures in order, and a shot is a time of the film with its camera. A spot is the list of keys that
leads to an entry of the file. Mistakes of the file are recorded in a log.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import replace

from fantoccini.base import did_you_mean
from fantoccini.base.documents import NAME
from fantoccini.theatre.script import (
    END,
    START,
    VERBS,
    Cue,
    EntersToCue,
    ExitsToCue,
    GivesCue,
    PlayCue,
    PlayFile,
    ScriptLog,
    Spot,
    Time,
    Timeline,
    TimeReference,
    is_walk,
    make_timeline,
)

_MAX_ACT_DURATION = 1800.0
"""Longest duration of an act [s]."""
_PLAYER_TIME = re.compile(rf"({NAME}) +(arrives|is done)(?: *([-+]) *(\d+\.?\d*|\.\d+))?", re.ASCII)
"""Time such as ``pierrot arrives + 2`` [beats]."""


def act_time_in_words(t: float, start: float, beat: float) -> str:
    """Time in words: ``on beat 4.0 of the act (12.40 s)``."""
    return f"on beat {(t - start) / beat:.1f} of the act ({t:.2f} s)"


def lane_name(who: str, lane: int) -> str:
    """Name of a lane: the player's, followed by a number from the second lane on."""
    return who if lane == 0 else f"{who} {lane + 1}"


def play_timeline(
    file: PlayFile, marks: Callable[[PlayCue, Spot], Iterable[str]], log: ScriptLog
) -> Timeline[PlayCue]:
    """Cues of a play, with references for their times.

    Args:
        file: the play.
        marks: returns the marks of a cue's action, () after a mistake.
        log: collects mistakes.
    """
    acts: list[list[Cue[PlayCue]]] = []
    last_cue: dict[str, Cue[PlayCue]] = {}
    cues: list[Cue[PlayCue]] = []
    for act_index, act in enumerate(file.acts):
        acts.append([])
        for cue_index, entry in enumerate(act.cues):
            spot: Spot = ("acts", act_index, "cues", cue_index)
            who = _who(file, entry, spot, log)
            if isinstance(entry, GivesCue) and entry.to in file.cast and entry.to not in who:
                who = (*who, entry.to)
            name = entry.name or VERBS[entry.verb].default_name or str(entry.verb_value)
            name = name.rsplit("/", 1)[-1].rsplit(".", 1)[0]
            moments = (*marks(entry, spot), START, END)
            previous_cues = tuple(last_cue[player] for player in who if player in last_cue)
            cue = Cue(spot, len(cues), act_index, entry, who, name, moments, previous_cues)
            last_cue.update(dict.fromkeys(who, cue))
            acts[-1].append(cue)
            cues.append(cue)

    def player_time_before(n_before: int, spot: Spot, given: Time) -> TimeReference | float | None:
        match = _PLAYER_TIME.fullmatch(given.strip()) if isinstance(given, str) else None
        if match is None or match[1] not in file.cast:
            return None
        offset = float(match[4] or 0.0) * (-1.0 if match[3] == "-" else 1.0)
        walk = match[2] == "arrives"
        for earlier in reversed(cues[:n_before]):
            if match[1] in earlier.who and (is_walk(earlier.entry) or not walk):
                # An act begins after everything in the acts before it.
                return TimeReference(earlier.spot, END, offset, in_act=True)
        log.mistakes.add(spot, f"{match[1]} has no {'walk' if walk else 'cue'} before this one")
        return 0.0

    def player_time(cue: Cue[PlayCue], spot: Spot, given: Time) -> TimeReference | float | None:
        return player_time_before(cue.index, spot, given)

    times: dict[Spot, Time] = {("times", name): float(beat) for name, beat in file.times.items()}
    timeline = make_timeline(acts, times, log, player_time)
    references = dict(timeline.refs)
    for act_index, act in enumerate(file.acts):
        for cue_index, shot in enumerate(act.camera):
            spot = shot_time_keys(act_index, cue_index)
            player_reference = player_time_before(
                timeline.act_bounds[act_index + 1], spot, shot.when
            )
            references[spot] = (
                timeline.time_resolver.read(shot.when, spot)
                if player_reference is None
                else player_reference
            )
    timeline = replace(timeline, refs=references)
    _check_order(file, timeline, log)
    _check_entrances(file, timeline, log)
    return timeline


def shot_time_keys(act: int, index: int) -> Spot:
    """Keys of the time of a shot of an act."""
    return "acts", act, "camera", index, "when"


def _check_order(file: PlayFile, timeline: Timeline[PlayCue], log: ScriptLog) -> None:
    """Records cues and shots that wait for cues of a later act, and shots after the longest act."""
    cue_at = {cue.spot: cue for cue in timeline.cues}
    cue_times = [(cue.act, spot) for cue in timeline.cues for spot, _ in cue.times]
    shot_times = [
        (act_index, shot_time_keys(act_index, shot_index))
        for act_index, act in enumerate(file.acts)
        for shot_index in range(len(act.camera))
    ]
    for act, spot in (*cue_times, *shot_times):
        reference = timeline.refs[spot]
        awaited_cue = cue_at.get(reference.spot) if isinstance(reference, TimeReference) else None
        if awaited_cue is not None and awaited_cue.act > act:
            line = log.located.line(awaited_cue.spot)
            text = f"waits for {awaited_cue.name} on line {line}, a cue of a later act"
            log.mistakes.add(spot, text)
    for _, spot in shot_times:
        _check_length(timeline.refs[spot], spot, log)


def _check_length(beats: object, spot: Spot, log: ScriptLog) -> None:
    """Records a number of beats that is longer than the longest act."""
    if isinstance(beats, float) and beats * log.beat > _MAX_ACT_DURATION:
        text = f"found beat {beats:g}; an act lasts {_MAX_ACT_DURATION / 60:g} minutes at most"
        log.mistakes.add(spot, text)


def _check_entrances(file: PlayFile, timeline: Timeline[PlayCue], log: ScriptLog) -> None:
    """Records entrances of players on the stage, and times beyond the longest act."""
    is_off_stage: dict[str, bool] = dict.fromkeys(file.cast, True)
    for cue in timeline.cues:
        for who in cue.who:
            if isinstance(cue.entry, EntersToCue) and not is_off_stage[who]:
                text = f"{who} is on the stage already; needed: `walks to`"
                log.mistakes.add((*cue.spot, "enters to"), text)
            is_off_stage[who] = isinstance(cue.entry, ExitsToCue)
        for spot, start in cue.times:
            _check_length(start, spot, log)


def _who(file: PlayFile, cue: PlayCue, spot: Spot, log: ScriptLog) -> tuple[str, ...]:
    """Players of a cue; unknown names are recorded."""
    all_players, names = list(file.cast), list[str]()
    for name in cue.who:
        if name == "all":
            names += all_players
        elif name not in all_players:
            log.mistakes.add(
                (*spot, "who"), f"no player is called {name!r}{did_you_mean(name, all_players)}"
            )
        else:
            names.append(name)
    return tuple(dict.fromkeys(names))
