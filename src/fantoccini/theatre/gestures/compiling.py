"""Score files compiled: lanes to one motion, captions, waits and sounds to times."""

from __future__ import annotations

import os
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from fantoccini.base import Array, FileError, InputError, UnknownNameError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import pieces
from fantoccini.theatre.gestures.bounding import note_passed
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.placing import PlacedLanes, place_lanes
from fantoccini.theatre.gestures.repertoire import Repertoire
from fantoccini.theatre.gestures.score import Caption, Score, Wait
from fantoccini.theatre.gestures.sounding import read_sounds, spot_of_sound
from fantoccini.theatre.gestures.transitions import limits
from fantoccini.theatre.gestures.waiting import note_moving
from fantoccini.theatre.script import LATE, Notes, ScoreFile, Spot, read_script

_NO_BOUNDS = {"speed": 1.0, "acceleration": 1.0}


def load_score(marionette: Marionette, path: str | os.PathLike[str]) -> Score:
    """Reads and compiles a score file.

    Where a gesture cannot begin in time, because the way to its start takes longer within the
    bounds, it begins late, and :attr:`Score.changes` says so. They also say where lanes together
    or gestures by themselves pass a bound.

    Args:
        marionette: who performs it.
        path: of the file.

    Raises:
        FileError: with every mistake found and its location.
    """
    file, notes = read_script(ScoreFile, path)
    return _Compiler(marionette, file, notes).score()


class _Compiler:
    """Compiles one score file."""

    def __init__(self, marionette: Marionette, file: ScoreFile, notes: Notes):
        self._marionette, self._file, self._notes = marionette, file, notes
        self._table = marionette.coordinates

    def score(self) -> Score:
        """The score.

        Raises:
            FileError: it has mistakes.
        """
        file, notes, start = self._file, self._notes, self._marionette.rest()
        most = self._bounds()
        gestures = Repertoire(self._marionette, file, start, most, notes)
        lanes: dict[str, Any] = {lane: (("lanes", lane), cues) for lane, cues in file.lanes.items()}
        placed = place_lanes(lanes, file.marks, gestures.of, most, notes)
        gestures.read_all()
        notes.refuse()
        assert placed is not None  # or there are mistakes
        captions = tuple(self._caption(placed, i) for i in range(len(file.captions)))
        waits = self._waits(placed)
        sounds = read_sounds(file.sound, partial(placed.time, notes=notes), notes)
        notes.refuse()
        end = max(
            *(line.end for line in placed.lines.values()),
            *(wait.t for wait in waits),
            (file.duration or 0.0) * notes.beat,
            notes.beat,
        )
        for line in placed.lines.values():
            line.hold(end)
        own = {
            lane: Gesture(self._table, *line.motion, lane) for lane, line in placed.lines.items()
        }
        whole, *others = own.values()
        for other in others:
            whole += other
        note_passed(whole, most, placed.played, notes)
        note_moving(whole, waits, placed.played, notes)
        notes.refuse()
        last: list[tuple[Spot, float]] = [(("marks", name), t) for name, t in placed.marks.items()]
        last += [(("captions", i), one.end) for i, one in enumerate(captions)]
        last += [(spot_of_sound(i, self._notes.located), one.start) for i, one in enumerate(sounds)]
        for spot, t in last:
            if t > end + LATE:
                notes.change(spot, f"comes {notes.said(t)}; the score ends {notes.said(end)}")
        made = Score(
            self._marionette,
            whole.called(file.score),
            tuple(one for _, one, _ in placed.played),
            placed.marks,
            captions,
            notes.beat,
            tuple(notes.changes),
            file.score,
            file.speed,
            file.acceleration,
            waits,
            sounds,
            own,
            file.tempo,
        )
        try:
            made.inputs(start)
        except InputError as error:
            found = [
                (self._mover(placed, one.key), f"{one.key}: {one.message}")
                for one in error.mistakes
            ]
            raise self._notes.located.error(found, FileError) from None
        return made

    def _bounds(self) -> Array:
        """(2, n_vK) bounds of speeds and accelerations."""
        file, given = self._file, dict[str, Any]()
        for key in ("speed", "acceleration"):
            bound = getattr(file, key)
            for name, one in bound.items() if isinstance(bound, dict) else [("", bound)]:
                spot = (key, name) if name else (key,)
                try:
                    limits(self._table, **(_NO_BOUNDS | {key: {name: one} if name else one}))
                except (UnknownNameError, ValueError) as error:
                    self._notes.mistake(spot, str(error))
            given[key] = bound
        self._notes.refuse()
        return limits(self._table, **given)

    def _mover(self, placed: PlacedLanes, channel: str) -> Spot:
        """The cue that moves a coordinate farthest."""
        places = pieces.channel_names(self._table)
        if channel not in places or not placed.played:
            return ("lanes",)
        v = places[channel][1]
        sizes = [np.max(np.abs(motion.coef[:, v, 0])) for _, _, motion in placed.played]
        return placed.played[int(np.argmax(sizes))][0].spot

    def _caption(self, placed: PlacedLanes, i: int) -> Caption:
        given, notes = self._file.captions[i], self._notes
        start = placed.time(given.at, ("captions", i, "at"), notes)
        end = placed.time(given.until, ("captions", i, "until"), notes)
        if not end > start and not notes.found:
            text = f"ends {notes.said(end)} and begins {notes.said(start)}"
            notes.mistake(("captions", i), text)
        return Caption(start, end, given.text)

    def _waits(self, placed: PlacedLanes) -> tuple[Wait, ...]:
        """The waits, in order of time."""
        notes, found = self._notes, list[Wait]()
        for name, given in self._file.waits.items():
            spot: Spot = ("waits", name)
            if name in self._file.marks:
                notes.mistake(spot, "a mark has this name; needed: a name of its own")
            t, loop = placed.time(given.at, spot, notes), None
            if given.loop is not None:
                loop = placed.time(given.loop, (*spot, "loop"), notes)
                if not loop < t - LATE and not notes.found:
                    text = f"begins {notes.said(loop)} and ends {notes.said(t)}"
                    notes.mistake((*spot, "loop"), text)
            found.append(Wait(name, t, loop))
        found.sort(key=lambda wait: wait.t)
        for one, after in pairwise(found):
            begins = after.t if after.loop_start is None else after.loop_start
            if one.t > after.t - LATE or one.t > begins + LATE:
                text = f"{one.name} waits {notes.said(one.t)}, at the same time or within this loop"
                notes.mistake(("waits", after.name), f"{text}; needed: one after the other")
        return tuple(found)
