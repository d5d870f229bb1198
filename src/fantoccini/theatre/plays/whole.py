"""Whole play as one score: the motion of all hands, captions, sounds and waits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fantoccini.base import did_you_mean
from fantoccini.theatre.cast import Cast, in_scene, lane_name
from fantoccini.theatre.gestures import (
    Caption,
    Gesture,
    Placed,
    Played,
    Score,
    Sound,
    Wait,
    read_sounds,
)
from fantoccini.theatre.script import PlayCue, PlayFile, PropCue, ScriptLog, Spot, Time


def whole_score(
    cast: Cast,
    motions: Mapping[str, Gesture],
    lanes: Mapping[str, Mapping[str, Gesture]],
    cues: Sequence[Placed[PlayCue]],
    log: ScriptLog,
) -> Score:
    """Score of the whole stage, with the motions of all players.

    Args:
        cast: cast of the play.
        motions: player -> motion of its hands.
        lanes: player -> lane -> motion of the lane.
        cues: placed cues in the file's order.
        log: collects mistakes; has the length of a beat.
    """
    file = cast.file
    table = cast.whole.coordinates
    lane_motions = {
        label: in_scene(table, cast.member(name), gesture)
        for name, player_lanes in lanes.items()
        for label, gesture in player_lanes.items()
    }
    whole, *others = (
        in_scene(table, cast.member(name), motion) for name, motion in motions.items()
    )
    for other in others:
        whole += other
    played, captions, waits = [], [], []
    for number, placed in enumerate(cues, 1):
        cue = placed.cue
        for part in placed.parts:
            name = cue.name if len(cue.who) == 1 else f"{cue.name} {part.who}"
            lane = lane_name(part.who, part.lane)
            played.append(Played(lane, cue.name, part.start, part.end, part.marks, name))
        if not placed.parts:
            continue
        start = min(part.start for part in placed.parts)
        if cue.given.says is not None:
            end = max(part.end for part in placed.parts)
            # Only the player that handles the prop speaks.
            who = cue.given.who if isinstance(cue.given, PropCue) else cue.who
            speaker = " and ".join(who)
            captions.append(Caption(start, max(end, start + 1.0), cue.given.says, speaker))
        if cue.given.go:
            waits.append(Wait(f"cue {number}", min(start, placed.wanted)))
    sounds = sounds_of(file, log)
    marks = {name: beat * log.beat for name, beat in file.times.items()}
    return Score(
        cast.whole,
        whole.called(file.play),
        tuple(played),
        marks,
        tuple(sorted(captions, key=lambda caption: caption.start)),
        log.beat,
        (),
        file.play,
        file.stage.speed,
        file.stage.acceleration,
        tuple(sorted(waits, key=lambda wait: wait.t)),
        sounds,
        lane_motions,
        file.tempo,
    )


def sounds_of(file: PlayFile, log: ScriptLog) -> tuple[Sound, ...]:
    """Sounds of a play; records missing files and invalid times."""

    def time(given: Time, spot: Spot) -> float:
        if not isinstance(given, str):
            return given * log.beat
        if given not in file.times:
            text = f"found {given!r}; needed: a beat, or a name of `times`"
            log.mistakes.add(spot, text + did_you_mean(given, file.times))
        return file.times.get(given, 0.0) * log.beat

    return read_sounds(file.sound, time, log)
