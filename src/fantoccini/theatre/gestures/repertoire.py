"""The gestures of a score's cues: from files, or phrases of the score itself."""

from __future__ import annotations

from fantoccini.base import Array, FileError, InputError, StateError, UnknownNameError, nearest
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State
from fantoccini.theatre.gestures.gesture import Gesture, numbered
from fantoccini.theatre.gestures.gesture_file import bundled, gesture_names, load_gesture
from fantoccini.theatre.gestures.parameters import Parameters, made_gesture, member_prefix
from fantoccini.theatre.gestures.placing import place_lanes
from fantoccini.theatre.script import GestureCue, Notes, PhraseCue, PlayedCue, ScoreFile, Spot

_DEEPEST = 30
"""Phrases within phrases."""
_MOST = 100_000
"""Pieces of a gesture that is repeated, at most, for memory."""


class Repertoire:
    """Gestures by cue, each file and phrase read once.

    Args:
        marionette: who performs them.
        file: the score.
        start: where the puppet hangs.
        most: (2, n_vK) bounds of speeds and accelerations.
        notes: take mistakes and changes.
    """

    def __init__(
        self, marionette: Marionette, file: ScoreFile, start: State, most: Array, notes: Notes
    ):
        self._marionette, self._file, self._start = marionette, file, start
        self._most, self._notes = most, notes
        self._files: dict[tuple[str, str, Parameters], Gesture | None] = {}
        self._wrong: dict[tuple[str, str, Parameters], list[tuple[Spot, str]]] = {}
        self._phrases: dict[str, Gesture | None] = {}
        self._open: list[str] = []

    def read_all(self) -> None:
        """Compiles the phrases that no cue plays, too, for their mistakes."""
        for name in self._file.phrases:
            self._phrase(name, ("phrases", name))

    def of(self, cue: PlayedCue, spot: Spot) -> tuple[Gesture, Gesture] | None:
        """The cue's gesture once, and as often as it is repeated; None after a mistake."""
        if isinstance(cue, PhraseCue):
            made = self._phrase(cue.phrase, (*spot, "phrase"))
        else:
            assert isinstance(cue, GestureCue)
            made = self._gesture(cue, spot)
        if made is None:
            return None
        try:
            made = made.mirrored() if cue.mirrored else made
        except (UnknownNameError, StateError) as error:
            self._notes.mistake((*spot, "mirrored"), str(error))
            return None
        if cue.heading is not None:
            try:
                made = made.turned(cue.heading)
            except StateError as error:
                self._notes.mistake((*spot, "heading"), str(error))
                return None
        pieces = cue.repeat * (len(made.breaks) - 1)
        if pieces > _MOST:
            text = f"found {cue.repeat}; {made.name} would have {pieces} pieces, of {_MOST} at most"
            self._notes.mistake((*spot, "repeat"), text)
            return None
        try:
            made = made.scaled(cue.larger).faster(cue.faster)
        except StateError as error:
            self._notes.mistake((*spot, "larger"), str(error))
            return None
        if cue.lasts is not None:
            made = made.lasting(cue.lasts * self._notes.beat)
        try:
            whole = made.repeated(
                cue.repeat, speed=self._file.speed, acceleration=self._file.acceleration
            )
        except StateError as error:
            self._notes.mistake(spot, str(error))
            return None
        return made, whole

    def _gesture(self, cue: GestureCue, spot: Spot) -> Gesture | None:
        name, of = cue.gesture, cue.of or ""
        given = Parameters(cue.steps, cue.step, cue.turn, cue.to)
        if (name, of, given) in self._files:
            for key, text in self._wrong.get((name, of, given), ()):
                self._notes.mistake((*spot, *key), text)
            return self._files[name, of, given]
        self._files[name, of, given] = None
        before = len(self._notes.found)
        path, is_bundled = self._notes.located.beside(name), False
        if path is None and name in gesture_names():
            path, is_bundled = bundled(name), True
        if path is None:
            text = "no gesture file in this one's folder, and no bundled gesture, is called "
            found = f"{text}{name!r}{nearest(name, gesture_names())}"
            self._notes.mistake((*spot, "gesture"), found)
            self._wrong[name, of, given] = [(("gesture",), found)]
            return None
        try:
            if is_bundled and given.makes(name):
                prefix = member_prefix(self._marionette.coordinates, of)
                made = made_gesture(self._marionette, name, given, prefix, self._start)
            else:
                given.refuse(name)
                made = load_gesture(self._marionette, path, self._start, of=of)
            self._files[name, of, given] = made
        except UnknownNameError as error:
            self._notes.mistake((*spot, "of" if of else "gesture"), str(error))
        except InputError as error:
            for one in error.mistakes:
                self._notes.mistake((*spot, one.key), one.message)
        except FileError as error:
            for one in error.mistakes:
                self._notes.mistake((*spot, "gesture"), str(one))
        self._wrong[name, of, given] = [
            (found[len(spot) :], text) for found, text in self._notes.found[before:]
        ]
        return self._files[name, of, given]

    def _phrase(self, name: str, spot: Spot) -> Gesture | None:
        """A phrase as one gesture: from where the puppet hangs, at rest at its end."""
        if name in self._open:
            way = " -> ".join([*self._open[self._open.index(name) :], name])
            self._notes.mistake(spot, f"a phrase is part of itself: {way}")
            return None
        if name not in self._file.phrases:
            text = f"no phrase is called {name!r}{nearest(name, self._file.phrases)}"
            self._notes.mistake(spot, text)
            return None
        if name in self._phrases:
            return self._phrases[name]
        if len(self._open) >= _DEEPEST:
            self._notes.mistake(spot, f"phrases are more than {_DEEPEST} deep; needed: fewer")
            return None
        self._open.append(name)
        self._phrases[name] = self._made(name)
        self._open.pop()
        return self._phrases[name]

    def _made(self, name: str) -> Gesture | None:
        lanes = {name: (("phrases", name), self._file.phrases[name])}
        placed = place_lanes(lanes, {}, self.of, self._most, self._notes, phrase=True)
        if placed is None or self._notes.found:
            return None
        marks: dict[str, float] = {}
        for _, one, _ in placed.played:
            for mark, t in one.marks.items():
                marks[numbered(mark, marks)] = t
        (line,) = placed.lines.values()
        return Gesture(self._marionette.coordinates, *line.motion, name, marks, placed.turns)
