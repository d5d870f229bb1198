"""Player of gestures for buttons and keys, with a beat.

A gesture is a short motion of strings, relative to their position.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from fantoccini.app.live.recorder import is_take_name
from fantoccini.base import FantocciniError
from fantoccini.theatre.gestures import Gesture, Style, gesture_names, is_gesture, load_gesture
from fantoccini.theatre.perform import Performance, Tempo

HOME_GESTURE = "hang"
"""Bundled gesture that the button Home replaces."""
_MAX_FILES = 60
"""Largest number of files in the folders that are tried as gestures."""


@dataclass
class GestureOptions:
    """Options of the gestures that are played next.

    Attributes:
        mirrored: whether left and right are exchanged.
        size, speed: factors on the gesture's size and speed.
        repeat: whether they repeat until their button is pressed again.
        on_beat: whether they begin on the next beat.
    """

    mirrored: bool = False
    size: float = 1.0
    speed: float = 1.0
    repeat: bool = False
    on_beat: bool = False


class GesturePlayer:
    """Player of gestures for buttons and keys.

    Attributes:
        gestures: name -> gesture, for all that this puppet can do.
        problems: messages about gesture files that cannot be used.
        options: options of the next gestures.
        tempo: tempo of the beat.
        metronome: whether the metronome sounds.

    Args:
        performance: performance that plays the gestures.
        folders: folders with gesture files and takes.
    """

    def __init__(self, performance: Performance, folders: tuple[Path, ...]):
        self._performance, self._folders = performance, folders
        self.options, self.tempo, self.metronome = GestureOptions(), Tempo(), False
        self.gestures: dict[str, Gesture] = {}
        self.problems: tuple[str, ...] = ()
        self._repeating: dict[str, str] = {}
        self.load()

    def load(self) -> None:
        """Loads the gestures that the puppet can do: bundled ones and those in the folders."""
        marionette = self._performance.marionette
        self.gestures = {}
        for name in gesture_names():
            try:
                if name != HOME_GESTURE:
                    self.gestures[name] = load_gesture(marionette, name)
            except FantocciniError:
                continue  # it needs other strings
        problems = []
        for path in self._files():
            try:
                gesture = load_gesture(marionette, path)
            except FantocciniError as error:
                if path.suffix != ".npz":
                    problems.append(_short_message(error))
                continue
            self.add(gesture)
        self.problems = tuple(problems)

    def add(self, gesture: Gesture) -> None:
        """Adds a gesture, or replaces the one with its name."""
        self.gestures[gesture.name] = gesture

    def press(self, name: str) -> None:
        """Plays a gesture with the current options, or ends its repetition.

        Raises:
            FantocciniError: its mirror image is unknown, or a controller moves the hands.
        """
        if repeating_names := [
            gesture_name
            for gesture_name, button in self._repeating_names().items()
            if button == name
        ]:
            for gesture_name in repeating_names:
                del self._repeating[gesture_name]
                self._performance.stop_repeating(gesture_name)
            return
        options, gesture = self.options, self.gestures[name]
        style = Style(options.size, options.speed, options.mirrored)
        gesture, _ = style.apply(gesture, self._performance.marionette)
        if options.mirrored:
            gesture = gesture.called(f"{name}, mirrored")
        t = self._performance.t
        delay = self.tempo.next_beat_time(t) - t if options.on_beat else None
        self._performance.play(gesture, after=delay, repeat=options.repeat)
        if options.repeat:
            self._repeating[gesture.name] = name

    def go_home(self) -> None:
        """Ends all gestures and moves the hands home."""
        self._repeating.clear()
        self._performance.go_home()

    @property
    def playing(self) -> tuple[str, ...]:
        """Names of the gestures that are played."""
        return tuple(name for name in self._performance.playing if name != "rest")

    @property
    def beat(self) -> int:
        """Number of the current beat."""
        return int(self.tempo.beat_number(self._performance.t) // 1)

    def tap(self) -> None:
        """Sets the beat by a tap at the current time."""
        self.tempo.tap(self._performance.t, time.monotonic())

    def set_tempo(self, bpm: float) -> None:
        """Sets the tempo in beats per minute."""
        self.tempo.set(bpm, self._performance.t)

    def _repeating_names(self) -> dict[str, str]:
        """Name of a repeating gesture -> button that started it."""
        playing = self._performance.playing
        self._repeating = {
            name: button for name, button in self._repeating.items() if name in playing
        }
        return self._repeating

    def _files(self) -> list[Path]:
        """Files in the folders that may be gestures: YAML, and takes that a user has named."""
        gesture_files = []
        for folder in dict.fromkeys(folder.resolve() for folder in self._folders):
            files = sorted(path for path in folder.glob("*") if path.is_file())
            takes = [
                path for path in files if path.suffix == ".npz" and not is_take_name(path.stem)
            ]
            gesture_files += [path for path in files if is_gesture(path)] + takes
        return gesture_files[:_MAX_FILES]


def _short_message(error: FantocciniError) -> str:
    """The first line of an error, and the number of the others."""
    first_line, *other_lines = str(error).splitlines()
    return f"{first_line} (and {len(other_lines)} more)" if other_lines else first_line
