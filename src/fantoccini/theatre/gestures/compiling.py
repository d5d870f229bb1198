"""Compiler of score files: lanes become one motion; captions, waits and sounds get times.

A lane is a list of gestures in order; the offsets of all lanes add up. A mark is a named time. In
names, K stands for driven coordinates: ends and lengths of strings, driven joints. A spot is the
list of keys that leads to an entry of the file. Mistakes of the file are recorded in a log.
"""

from __future__ import annotations

import os
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from fantoccini.base import Array, FileError, InputError, UnknownNameError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import pieces
from fantoccini.theatre.gestures.checking import (
    moving_cues,
    report_exceeded_bounds,
    report_motion_at_waits,
)
from fantoccini.theatre.gestures.placing import PlacedLanes, place_lanes
from fantoccini.theatre.gestures.score import Caption, Score, Wait
from fantoccini.theatre.gestures.score_gestures import ScoreGestures
from fantoccini.theatre.gestures.sounding import read_sounds, spot_of_sound
from fantoccini.theatre.gestures.transitions import motion_bounds
from fantoccini.theatre.gestures.turns import TurnError
from fantoccini.theatre.script import LATENESS_TOLERANCE, ScoreFile, ScriptLog, Spot, read_script

_TRIAL_BOUNDS = {"speed": 1.0, "acceleration": 1.0}
"""Valid bounds, with which single bounds of a file are checked."""


def load_score(marionette: Marionette, path: str | os.PathLike[str]) -> Score:
    """Score of a file.

    A gesture begins late if the transition to its start takes longer within the bounds.
    :attr:`Score.changes` reports this, and where lanes together or single gestures exceed a bound.

    Args:
        marionette: puppet that performs it.
        path: path of the file.

    Raises:
        FileError: the file has mistakes; all of them are listed, with their lines.
    """
    file, log = read_script(ScoreFile, path)
    return _Compiler(marionette, file, log).score()


class _Compiler:
    """Compiler of one score file."""

    def __init__(self, marionette: Marionette, file: ScoreFile, log: ScriptLog):
        self._marionette, self._file, self._log = marionette, file, log
        self._table = marionette.coordinates

    def score(self) -> Score:
        """Compiled score.

        Raises:
            FileError: the file has mistakes.
        """
        file, log, start = self._file, self._log, self._marionette.rest()
        bounds = self._bounds()
        gestures = ScoreGestures(self._marionette, file, start, bounds, log)
        lane_cues: dict[str, Any] = {
            lane: (("lanes", lane), cues) for lane, cues in file.lanes.items()
        }
        placed_lanes = place_lanes(lane_cues, file.marks, gestures.for_cue, bounds, log)
        gestures.read_all()
        log.mistakes.raise_if_any()
        assert placed_lanes is not None  # otherwise there are mistakes
        captions = tuple(self._caption(placed_lanes, i) for i in range(len(file.captions)))
        waits = self._waits(placed_lanes)
        sounds = read_sounds(file.sound, partial(placed_lanes.time, log=log), log)
        log.mistakes.raise_if_any()
        end = max(
            placed_lanes.hands.end,
            *(wait.t for wait in waits),
            (file.duration or 0.0) * log.beat,
            log.beat,
        )
        try:
            gesture, lane_motions = placed_lanes.hands.motion(self._table, [*file.lanes], end)
        except TurnError as error:
            spot = self._moving_cue(placed_lanes, error.channel, error.t)
            raise log.located.error([(spot, str(error))], FileError) from None
        report_exceeded_bounds(gesture, bounds, placed_lanes.played, log)
        report_motion_at_waits(gesture, waits, placed_lanes.played, log)
        log.mistakes.raise_if_any()
        named_times: list[tuple[Spot, float]] = [
            (("marks", name), t) for name, t in placed_lanes.marks.items()
        ]
        named_times += [(("captions", i), caption.end) for i, caption in enumerate(captions)]
        named_times += [
            (spot_of_sound(i, self._log.located), sound.start) for i, sound in enumerate(sounds)
        ]
        for spot, t in named_times:
            if t > end + LATENESS_TOLERANCE:
                log.change(spot, f"comes {log.in_words(t)}; the score ends {log.in_words(end)}")
        score = Score(
            self._marionette,
            gesture.called(file.score),
            tuple(played for _, played, _ in placed_lanes.played),
            placed_lanes.marks,
            captions,
            log.beat,
            tuple(log.changes),
            file.score,
            file.speed,
            file.acceleration,
            waits,
            sounds,
            lane_motions,
            file.tempo,
        )
        try:
            score.inputs(start)
        except InputError as error:
            mistakes = [
                (self._moving_cue(placed_lanes, mistake.key), f"{mistake.key}: {mistake.message}")
                for mistake in error.mistakes
            ]
            raise self._log.located.error(mistakes, FileError) from None
        return score

    def _bounds(self) -> Array:
        """(2, n_vK) bounds of speeds and accelerations."""
        file, options = self._file, dict[str, Any]()
        for key in ("speed", "acceleration"):
            bound = getattr(file, key)
            for name, value in bound.items() if isinstance(bound, dict) else [("", bound)]:
                spot = (key, name) if name else (key,)
                trial_bounds = _TRIAL_BOUNDS | {key: {name: value} if name else value}
                try:
                    motion_bounds(self._table, **trial_bounds)
                except (UnknownNameError, ValueError) as error:
                    self._log.mistakes.add(spot, str(error))
            options[key] = bound
        self._log.mistakes.raise_if_any()
        return motion_bounds(self._table, **options)

    def _moving_cue(self, placed_lanes: PlacedLanes, channel: str, t: float | None = None) -> Spot:
        """Keys of the cue that moves a coordinate farthest, of those that move it at a time [s]."""
        channels = pieces.channel_names(self._table)
        if channel not in channels or not placed_lanes.played:
            return ("lanes",)
        v = channels[channel][1]
        cues = (
            range(len(placed_lanes.played))
            if t is None
            else moving_cues(placed_lanes.played, t, v.start)
        )
        largest_offsets = {i: np.max(np.abs(placed_lanes.played[i][2].coef[:, v, 0])) for i in cues}
        return (
            placed_lanes.played[max(largest_offsets, key=lambda i: largest_offsets[i])][0].spot
            if largest_offsets
            else ("lanes",)
        )

    def _caption(self, placed_lanes: PlacedLanes, i: int) -> Caption:
        """Caption i of the file, with its times."""
        caption, log = self._file.captions[i], self._log
        start = placed_lanes.time(caption.at, ("captions", i, "at"), log)
        end = placed_lanes.time(caption.until, ("captions", i, "until"), log)
        if not end > start and not log.mistakes:
            text = f"ends {log.in_words(end)} and begins {log.in_words(start)}"
            log.mistakes.add(("captions", i), text)
        return Caption(start, end, caption.text)

    def _waits(self, placed_lanes: PlacedLanes) -> tuple[Wait, ...]:
        """Waits in order of time."""
        log, waits = self._log, list[Wait]()
        for name, entry in self._file.waits.items():
            spot: Spot = ("waits", name)
            if name in self._file.marks:
                log.mistakes.add(spot, "a mark has this name; needed: a name of its own")
            t, loop_start = placed_lanes.time(entry.at, spot, log), None
            if entry.loop is not None:
                loop_start = placed_lanes.time(entry.loop, (*spot, "loop"), log)
                if not loop_start < t - LATENESS_TOLERANCE and not log.mistakes:
                    text = f"begins {log.in_words(loop_start)} and ends {log.in_words(t)}"
                    log.mistakes.add((*spot, "loop"), text)
            waits.append(Wait(name, t, loop_start))
        waits.sort(key=lambda wait: wait.t)
        for wait, next_wait in pairwise(waits):
            next_begin = next_wait.t if next_wait.loop_start is None else next_wait.loop_start
            if (
                wait.t > next_wait.t - LATENESS_TOLERANCE
                or wait.t > next_begin + LATENESS_TOLERANCE
            ):
                text = f"{wait.name} waits {log.in_words(wait.t)}, at the same time or within this "
                log.mistakes.add(
                    ("waits", next_wait.name), f"{text}loop; needed: one after the other"
                )
        return tuple(waits)
