"""Gestures of a score's cues: from files, or phrases of the score itself.

A cue is a line of a score. A phrase is a part of a score that cues play like a gesture. In names, K
stands for driven coordinates: ends and lengths of strings, driven joints. A spot is the list of
keys that leads to an entry of the file. Mistakes of the file are recorded in a log.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from fantoccini.base import Array, FileError, InputError, StateError, UnknownNameError, did_you_mean
from fantoccini.base.documents import Located
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State
from fantoccini.theatre.gestures.gesture import Gesture, numbered_mark
from fantoccini.theatre.gestures.gesture_file import (
    bundled_gesture_path,
    gesture_names,
    is_gesture,
    load_gesture,
)
from fantoccini.theatre.gestures.parameters import Parameters, computed_gesture, member_prefix
from fantoccini.theatre.gestures.placing import place_lanes
from fantoccini.theatre.gestures.styling import Style, StyleError
from fantoccini.theatre.script import GestureCue, PhraseCue, PlayedCue, ScoreFile, ScriptLog, Spot

_TAKE_SUFFIX = ".npz"
_SUFFIXES = (".yaml", ".yml", _TAKE_SUFFIX)
"""Suffixes that a gesture's name may omit."""
_MAX_DEPTH = 30
"""Largest depth of phrases within phrases."""


class ScoreGestures:
    """Gestures by cue; each file and phrase is read once.

    Args:
        marionette: puppet that performs them.
        file: file of the score.
        start: state at rest.
        bounds: (2, n_vK) bounds of speeds and accelerations.
        log: collects mistakes and changes.
    """

    def __init__(
        self, marionette: Marionette, file: ScoreFile, start: State, bounds: Array, log: ScriptLog
    ):
        self._marionette, self._file, self._start = marionette, file, start
        self._bounds, self._log = bounds, log
        self._gestures: dict[tuple[str, str, Parameters], Gesture | None] = {}
        self._mistakes_of: dict[tuple[str, str, Parameters], list[tuple[Spot, str]]] = {}
        self._phrases: dict[str, Gesture | None] = {}
        self._open_phrases: list[str] = []

    def read_all(self) -> None:
        """Compiles all phrases, so that mistakes in those that no cue plays are found too."""
        for name in self._file.phrases:
            self._phrase(name, ("phrases", name))

    def for_cue(self, cue: PlayedCue, spot: Spot) -> tuple[Gesture, Gesture] | None:
        """Gesture of a cue, without and with its repetitions; None after a mistake."""
        if isinstance(cue, PhraseCue):
            gesture = self._phrase(cue.phrase, (*spot, "phrase"))
        else:
            assert isinstance(cue, GestureCue)
            gesture = self._load_cue_gesture(cue, spot)
        if gesture is None:
            return None
        style, file = Style.from_cue(cue, self._log.beat), self._file
        try:
            return style.apply(
                gesture,
                self._marionette,
                heading=cue.heading,
                speed=file.speed,
                acceleration=file.acceleration,
            )
        except StyleError as error:
            self._log.mistakes.add((*spot, error.key) if error.key else spot, str(error))
            return None

    def _load_cue_gesture(self, cue: GestureCue, spot: Spot) -> Gesture | None:
        name, member = cue.gesture, cue.of or ""
        parameters = Parameters(cue.steps, cue.step, cue.turn, cue.to)
        if (name, member, parameters) in self._gestures:
            for key, text in self._mistakes_of.get((name, member, parameters), ()):
                self._log.mistakes.add((*spot, *key), text)
            return self._gestures[name, member, parameters]
        self._gestures[name, member, parameters] = None
        n_before = len(self._log.mistakes)
        try:
            file_path, is_bundled = self._gesture_path(name)
            if is_bundled and parameters.computes(name):
                prefix = member_prefix(self._marionette.coordinates, member)
                gesture = computed_gesture(self._marionette, name, parameters, prefix, self._start)
            else:
                parameters.refuse(name)
                gesture = load_gesture(self._marionette, file_path, self._start, of=member)
            self._gestures[name, member, parameters] = gesture
        except UnknownNameError as error:
            self._log.mistakes.add((*spot, "of" if member else "gesture"), str(error))
        except StateError as error:
            self._log.mistakes.add((*spot, "gesture"), str(error))
        except InputError as error:
            for mistake in error.mistakes:
                self._log.mistakes.add((*spot, mistake.key), mistake.message)
        except FileError as error:
            for mistake in error.mistakes:
                self._log.mistakes.add((*spot, "gesture"), str(mistake))
        self._mistakes_of[name, member, parameters] = [
            (mistake_spot[len(spot) :], text)
            for mistake_spot, text in self._log.mistakes.findings[n_before:]
        ]
        return self._gestures[name, member, parameters]

    def _gesture_path(self, name: str) -> tuple[Path, bool]:
        """File of a gesture, and whether it is bundled.

        Raises:
            StateError: no gesture has this name, or several have it.
        """
        path = find_gesture_file(self._log.located, name, gesture_names())
        if path is not None:
            return path, False
        if name in gesture_names():
            return bundled_gesture_path(name), True
        text = "no gesture file in this one's folder, and no bundled gesture, is called "
        raise StateError(f"{text}{name!r}{did_you_mean(name, gesture_names())}")

    def _phrase(self, name: str, spot: Spot) -> Gesture | None:
        """A phrase as one gesture, from the puppet's rest; it ends at rest."""
        if name in self._open_phrases:
            cycle = " -> ".join([*self._open_phrases[self._open_phrases.index(name) :], name])
            self._log.mistakes.add(spot, f"a phrase is part of itself: {cycle}")
            return None
        if name not in self._file.phrases:
            text = f"no phrase is called {name!r}{did_you_mean(name, self._file.phrases)}"
            self._log.mistakes.add(spot, text)
            return None
        if name in self._phrases:
            return self._phrases[name]
        if len(self._open_phrases) >= _MAX_DEPTH:
            self._log.mistakes.add(spot, f"phrases are more than {_MAX_DEPTH} deep; needed: fewer")
            return None
        self._open_phrases.append(name)
        self._phrases[name] = self._phrase_gesture(name)
        self._open_phrases.pop()
        return self._phrases[name]

    def _phrase_gesture(self, name: str) -> Gesture | None:
        lanes = {name: (("phrases", name), self._file.phrases[name])}
        placed = place_lanes(lanes, {}, self.for_cue, self._bounds, self._log, is_phrase=True)
        if placed is None or self._log.mistakes:
            return None
        marks: dict[str, float] = {}
        for _, played, _ in placed.played:
            for mark, t in played.marks.items():
                marks[numbered_mark(mark, marks)] = t
        (sequence,) = placed.hands.lanes
        return Gesture(
            self._marionette.coordinates, *sequence.motion, name, marks, placed.changes_heading
        )


def find_gesture_file(
    located: Located, name: str, bundled: Collection[str], suffixes: Collection[str] = ()
) -> Path | None:
    """File in the script's folder with the name of a gesture, which may omit the ending.

    Args:
        located: the script.
        name: name of a gesture in the script.
        bundled: names of bundled gestures.
        suffixes: endings of further files that may be left out.

    Returns:
        The file; None if there is none, so that the name may be that of a bundled gesture.

    Raises:
        StateError: the name without ending has several meanings.
    """
    if (exact_path := located.file_in_folder(name)) is not None:
        return exact_path
    files: dict[str, Path] = {}
    for suffix in (*_SUFFIXES, *suffixes):
        path = located.file_in_folder(name + suffix)
        if path is not None and (suffix in (_TAKE_SUFFIX, *suffixes) or is_gesture(path)):
            files[path.name] = path
    if not files:
        return None
    meanings = [*files, *(["a bundled gesture"] if name in bundled else [])]
    if len(meanings) > 1:
        text = f"{name!r} is {' and '.join(meanings)}; write {' or '.join(files)} for the file"
        raise StateError(text + ", or rename it for the bundled gesture" * (name in bundled))
    (path,) = files.values()
    return path
