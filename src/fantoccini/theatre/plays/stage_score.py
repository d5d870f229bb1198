"""Whole play as one score: the motion of all hands, captions, sounds and waits.

A cue is a line of the play, and a lane a list of gestures in order. A spot is the list of keys that
leads to an entry of the file. Mistakes of the file are recorded in a log.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fantoccini.base import did_you_mean
from fantoccini.theatre.cast import Cast, gesture_in_scene, lane_name
from fantoccini.theatre.gestures import (
    Caption,
    Gesture,
    PlacedCue,
    PlayedGesture,
    Score,
    Sound,
    Wait,
    read_sounds,
)
from fantoccini.theatre.script import PlayCue, PlayFile, PropCue, ScriptLog, Spot, Time


def stage_score(
    cast: Cast,
    motions: Mapping[str, Gesture],
    lanes: Mapping[str, Mapping[str, Gesture]],
    cues: Sequence[PlacedCue[PlayCue]],
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
    table = cast.marionette.coordinates
    lane_motions = {
        label: gesture_in_scene(table, cast.prefix(name), gesture)
        for name, player_lanes in lanes.items()
        for label, gesture in player_lanes.items()
    }
    motion, *other_motions = (
        gesture_in_scene(table, cast.prefix(name), motion) for name, motion in motions.items()
    )
    for other_motion in other_motions:
        motion += other_motion
    score_cues, captions, waits = [], [], []
    for cue_number, placed_cue in enumerate(cues, 1):
        cue = placed_cue.cue
        for part in placed_cue.parts:
            name = cue.name if len(cue.who) == 1 else f"{cue.name} {part.who}"
            lane = lane_name(part.who, part.lane)
            score_cues.append(PlayedGesture(lane, cue.name, part.start, part.end, part.marks, name))
        if not placed_cue.parts:
            continue
        start = min(part.start for part in placed_cue.parts)
        if cue.entry.says is not None:
            end = max(part.end for part in placed_cue.parts)
            # Only the player that handles the prop speaks.
            who = cue.entry.who if isinstance(cue.entry, PropCue) else cue.who
            speaker = " and ".join(who)
            captions.append(Caption(start, max(end, start + 1.0), cue.entry.says, speaker))
        if cue.entry.go:
            waits.append(Wait(f"cue {cue_number}", min(start, placed_cue.wanted_time)))
    sounds = sounds_of(file, log)
    marks = {name: beat * log.beat for name, beat in file.times.items()}
    return Score(
        cast.marionette,
        motion.called(file.play),
        tuple(score_cues),
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

    def time(written: Time, spot: Spot) -> float:
        if not isinstance(written, str):
            return written * log.beat
        if written not in file.times:
            text = f"found {written!r}; needed: a beat, or a name of `times`"
            log.mistakes.add(spot, text + did_you_mean(written, file.times))
        return file.times.get(written, 0.0) * log.beat

    return read_sounds(file.sound, time, log)
