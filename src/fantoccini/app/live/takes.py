"""Takes of a live performance: editing, playing, saving, and conversion to gestures and films.

A take is a recording of a performance for editing. In names, K stands for driven coordinates: ends
and lengths of strings, driven joints.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from fantoccini.app.live.recorder import unused_path
from fantoccini.app.live.worker import Worker
from fantoccini.base import StateError, npz
from fantoccini.base.documents import NAME
from fantoccini.motion import RECORDING_FORMATS
from fantoccini.theatre.gestures import Gesture, gesture_from_take, gesture_names
from fantoccini.theatre.perform import Performance, Recording

_MAX_FILES = 100
"""Largest number of files that are listed, newest first."""
_MIN_PART = 0.05
"""Shortest part of a take [s]."""


@dataclass(frozen=True)
class Edits:
    """Edits of a take, which itself stays unchanged.

    Attributes:
        start, end: start and end of the part to keep [s].
        smooth: time over which the hands' paths are averaged [s]; 0 for none.
        stretch: factor on its duration.
    """

    start: float
    end: float
    smooth: float = 0.0
    stretch: float = 1.0


class Takes:
    """Takes in a folder and of this performance.

    Attributes:
        chosen: name of the take that is edited and played; empty without takes.
        edits: edits of the chosen take.

    Args:
        performance: performance that plays the takes.
        folder: folder of the files.
        worker: thread that writes files and films.
    """

    def __init__(self, performance: Performance, folder: Path, worker: Worker):
        self._performance, self._folder, self._worker = performance, folder, worker
        self._recordings: dict[str, Recording] = {}
        self._names = _recording_names(folder)
        self._edited_cache: tuple[str, Edits, Recording] | None = None
        self._used_paths: set[Path] = set()
        self.chosen, self.edits = "", Edits(0.0, 0.0)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all takes, newest first."""
        return tuple(self._names)

    def add(self, take: Recording, path: Path) -> None:
        """Adds a new take and chooses it."""
        self._recordings[path.stem] = take
        self._names.insert(0, path.stem)
        self._choose(path.stem, take)

    def choose(self, name: str) -> None:
        """Chooses a take.

        Raises:
            FantocciniError: its file cannot be read, or it belongs to another puppet.
        """
        if name not in self._names:
            raise StateError(f"there is no take {name!r}")
        if name not in self._recordings:
            self._recordings[name] = Recording.load(self._folder / f"{name}.npz")
        take, coordinates = self._recordings[name], self._performance.marionette.coordinates
        if take.marionette.coordinates.q_K != coordinates.q_K:
            raise StateError(f"{name} is a take of {take.marionette.name}, with other hands")
        self._choose(name, take)

    @property
    def take(self) -> Recording | None:
        """The chosen take, without edits."""
        return self._recordings.get(self.chosen)

    def edited(self) -> Recording:
        """The chosen take, edited.

        Raises:
            StateError: no take is chosen, or the edits are not possible.
        """
        take, edits = self.take, self.edits
        if take is None:
            raise StateError("there is no take yet; record one first")
        if self._edited_cache is not None and self._edited_cache[:2] == (self.chosen, edits):
            return self._edited_cache[2]
        try:
            edited_take = _apply_edits(take, edits)
        except ValueError as error:
            raise StateError(str(error)) from None
        self._edited_cache = self.chosen, edits, edited_take
        return edited_take

    def play(self, *, armed: Collection[str] = (), repeat: bool = False) -> None:
        """Plays the edited take from its start.

        Args:
            armed: lanes that it leaves to the hands.
            repeat: repeat the take.
        """
        try:
            self._performance.play_take(self.edited(), armed=armed, repeat=repeat)
        except ValueError as error:
            raise StateError(str(error)) from None

    # -- files -------------------------------------------------------------------------------

    def save_as_new(self) -> None:
        """Writes the edited take as a new take, and chooses it."""
        take = self.edited()
        path = self._unused_path(f"{self.chosen}-edited", ".npz")
        self._save(take, path)
        self.add(take, path)

    def film(self, theme: str) -> None:
        """Makes a film of the edited take."""
        take, path = self.edited(), self._unused_path(self.chosen, ".mp4")
        description = f"filming {path.name}"

        def job() -> str:
            from fantoccini.output.view import film

            run = take.trajectory
            film(
                take.marionette,
                run,
                path,
                theme=theme,
                progress=lambda progress: self._worker.report_progress(description, progress.share),
            )
            return f"wrote {path} ({run.duration:.1f} s)"

        self._worker.submit(description, job)

    def make_gesture(self, name: str) -> Gesture:
        """Converts the edited take to a gesture, and writes it as ``NAME.npz``.

        Raises:
            FantocciniError: the name is invalid or used already, or the take cannot be a gesture.
        """
        if re.fullmatch(NAME, name, re.ASCII) is None:
            raise StateError(
                f"{name!r} is not a valid name; allowed: a letter, then letters, digits, _ and -"
            )
        path = self._folder / f"{name}.npz"
        if name in gesture_names() or path.exists() or path in self._used_paths:
            raise StateError(f"there is a gesture or a file {name} already; choose another name")
        take = self.edited()
        gesture = gesture_from_take(take.inputs, name)
        self._used_paths.add(path)
        self._save(take, path)
        return gesture

    # -- inside ------------------------------------------------------------------------------

    def _choose(self, name: str, take: Recording) -> None:
        self.chosen, self.edits, self._edited_cache = name, Edits(0.0, take.duration), None

    def _unused_path(self, stem: str, ending: str) -> Path:
        path = unused_path(self._folder, stem, ending, self._used_paths)
        self._used_paths.add(path)
        return path

    def _save(self, take: Recording, path: Path) -> None:
        def job() -> str:
            take.save(path)
            return f"wrote {path} ({take.duration:.1f} s)"

        self._worker.submit(f"writing {path.name}", job)


def _apply_edits(take: Recording, edits: Edits) -> Recording:
    end = min(edits.end, take.duration)
    if edits.start > 0.0 or end < take.duration - 0.5 * take.tick:
        end = max(end, min(_MIN_PART, take.duration))
        take = take.trimmed(min(edits.start, max(0.0, end - _MIN_PART)), end)
    if edits.smooth > 0.0:
        take = take.smoothed(edits.smooth)
    return take if edits.stretch == 1.0 else take.stretched(edits.stretch)


def _recording_names(folder: Path) -> list[str]:
    """Names of the recordings in a folder, newest first."""
    files = [(path.stat().st_mtime, path) for path in folder.glob("*.npz") if path.is_file()]
    newest = [path for _, path in sorted(files, reverse=True)[:_MAX_FILES]]
    return [path.stem for path in newest if _file_format(path) in RECORDING_FORMATS]


def _file_format(path: Path) -> str:
    try:
        return str(npz.about_of(npz.read(path, array_name=npz.ABOUT))["format"])
    except npz.UNREADABLE:
        return ""
