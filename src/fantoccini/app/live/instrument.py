"""The gestures of a live puppet, as buttons and keys play them, and the beat they keep."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from fantoccini.app.live.recorder import is_take_name
from fantoccini.base import FantocciniError
from fantoccini.theatre.gestures import Gesture, gesture_names, is_gesture, load_gesture
from fantoccini.theatre.perform import Performance, Tempo

HOME = "hang"
"""The bundled gesture that the way home stands for."""
_MOST_FILES = 60
"""Files of a folder that are tried as gestures."""


@dataclass
class Manner:
    """How gestures are played from now on.

    Attributes:
        mirrored: whether left and right change places.
        size, speed: factors.
        again: whether they begin again until they are played once more.
        on_beat: whether they begin on the next beat.
    """

    mirrored: bool = False
    size: float = 1.0
    speed: float = 1.0
    again: bool = False
    on_beat: bool = False


class Instrument:
    """What buttons and keys play.

    Attributes:
        gestures: name -> gesture, those that this puppet can do.
        problems: of gesture files of the folders that cannot be used.
        manner: how they are played.
        tempo: of the beat.
        metronome: whether it is heard.

    Args:
        performance: whose gestures they are.
        folders: with gesture files and takes.
    """

    def __init__(self, performance: Performance, folders: tuple[Path, ...]):
        self._performance, self._folders = performance, folders
        self.manner, self.tempo, self.metronome = Manner(), Tempo(), False
        self.gestures: dict[str, Gesture] = {}
        self.problems: tuple[str, ...] = ()
        self._again: dict[str, str] = {}
        self.load()

    def load(self) -> None:
        """Finds the gestures that the puppet can do: bundled ones and those of the folders."""
        marionette = self._performance.marionette
        self.gestures = {}
        for name in gesture_names():
            try:
                if name != HOME:
                    self.gestures[name] = load_gesture(marionette, name)
            except FantocciniError:
                continue  # it is for other strings
        problems = []
        for path in self._files():
            try:
                made = load_gesture(marionette, path)
            except FantocciniError as error:
                if path.suffix != ".npz":
                    problems.append(str(error))
                continue
            self.add(made)
        self.problems = tuple(problems)

    def add(self, gesture: Gesture) -> None:
        """Adds a gesture, or replaces the one of its name."""
        self.gestures[gesture.name] = gesture

    def press(self, name: str) -> None:
        """Plays a gesture as :attr:`manner` says, or ends it where it begins again and again.

        Raises:
            FantocciniError: its mirror image is not known, or a law moves the hands.
        """
        if names := [played for played, one in self._repeats().items() if one == name]:
            for played in names:
                del self._again[played]
                self._performance.play_once(played)
            return
        manner, gesture = self.manner, self.gestures[name]
        if manner.mirrored:
            gesture = gesture.mirrored().called(f"{name}, mirrored")
        gesture = gesture.scaled(manner.size).faster(manner.speed)
        t = self._performance.t
        after = self.tempo.next(t) - t if manner.on_beat else None
        self._performance.play(gesture, after=after, again=manner.again)
        if manner.again:
            self._again[gesture.name] = name

    def go_home(self) -> None:
        """Takes back all gestures."""
        self._again.clear()
        self._performance.go_home()

    @property
    def playing(self) -> tuple[str, ...]:
        """Names of what is played."""
        return tuple(name for name in self._performance.playing if name != "rest")

    @property
    def beat(self) -> int:
        """Number of the present beat."""
        return int(self.tempo.beats(self._performance.t) // 1)

    def tap(self) -> None:
        """A tap of the beat, now."""
        self.tempo.tap(self._performance.t, time.monotonic())

    def set_tempo(self, bpm: float) -> None:
        """Sets beats a minute."""
        self.tempo.set(bpm, self._performance.t)

    def _repeats(self) -> dict[str, str]:
        """Name of a gesture that begins again and again -> the button that began it."""
        found = self._performance.playing
        self._again = {name: one for name, one in self._again.items() if name in found}
        return self._again

    def _files(self) -> list[Path]:
        """Files of the folders that may be gestures: YAML, and takes that have a name."""
        found = []
        for folder in dict.fromkeys(folder.resolve() for folder in self._folders):
            files = sorted(path for path in folder.glob("*") if path.is_file())
            takes = [
                path for path in files if path.suffix == ".npz" and not is_take_name(path.stem)
            ]
            found += [path for path in files if is_gesture(path)] + takes
        return found[:_MOST_FILES]
