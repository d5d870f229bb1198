"""Recordings of a live performance, each written to its own file.

A recording has everything that repeats a performance to the last bit.
"""

from __future__ import annotations

import re
import tempfile
import threading
from collections.abc import Callable, Collection
from datetime import datetime
from pathlib import Path

from fantoccini.base import FantocciniError
from fantoccini.theatre.perform import Performance, Recording


class Recorder:
    """Recorder of a performance, which writes files into a folder.

    Attributes:
        running: whether it records.
        status: message about the last recording; empty at first.

    Args:
        performance: performance to record.
        folder: folder for the files.
        on_recording: callback with every recording and its path.
    """

    def __init__(
        self,
        performance: Performance,
        folder: Path,
        on_recording: Callable[[Recording, Path], None] = lambda recording, path: None,
    ):
        self._performance, self._folder, self._on_recording = performance, folder, on_recording
        self._name = ""
        self._writers: list[threading.Thread] = []
        self._used_paths: set[Path] = set()
        self._start_time = 0.0
        self.running = False
        self.status = ""

    @property
    def time(self) -> float:
        """Duration of the current recording [s]."""
        return self._performance.t - self._start_time

    def begin(self) -> None:
        """Starts a recording."""
        self._name = self._performance.marionette.name
        self._performance.record()
        self.running, self._start_time = True, self._performance.t

    def poll(self) -> None:
        """Writes a recording that the performance has ended."""
        if self.running and not self._performance.recording:
            self.end()

    def end(self) -> None:
        """Ends the recording; another thread writes it."""
        stopped_recording = self._stop()
        if stopped_recording is None:
            return
        writer = threading.Thread(target=self._write, args=stopped_recording, name="write")
        try:
            writer.start()
        except RuntimeError:  # Python shuts down and starts no more threads
            self._write(*stopped_recording)
        else:
            self._writers.append(writer)

    def finish(self) -> None:
        """Ends the recording, and waits until everything is written."""
        self.end()
        for writer in self._writers:
            writer.join()
        self._writers.clear()

    def _stop(self) -> tuple[Recording, Path] | None:
        """Ends the recording; returns it and its path, or None if there is none."""
        if not self.running:
            return None
        self.running = False
        try:
            recording = self._performance.stop()
        except FantocciniError as error:
            self.status = str(error)
            return None
        path = recording_path(self._folder, self._name, datetime.now(), self._used_paths)
        self._used_paths.add(path)
        self.status = f"writing {path.name}"
        self._on_recording(recording, path)
        return recording, path

    def _write(self, recording: Recording, path: Path) -> None:
        """Writes a recording to its path or, if that fails, to the folder of temporary files."""
        failure_text = ""
        for target in (path, Path(tempfile.gettempdir()) / path.name):
            try:
                recording.save(target)
            except Exception as error:  # otherwise nothing would report it
                reason = str(getattr(error, "strerror", None) or error)
                lead = f"{target} cannot be written"
                failure_text += (reason if reason.startswith(lead) else f"{lead}: {reason}") + "; "
                continue
            ending = f"; {recording.end_reason}" if recording.end_reason else ""
            self.status = f"{failure_text}wrote {target} ({recording.duration:.1f} s{ending})"
            return
        self.status = f"{failure_text}the recording is lost"


_TAKE_NAME = re.compile(r".*-\d{8}-\d{6}(-\d+)?(-edited(-\d+)?)?", re.ASCII)


def is_take_name(stem: str) -> bool:
    """Whether a file's name, without ending, is one that the recorder generated."""
    return _TAKE_NAME.fullmatch(stem) is not None


def unused_path(folder: Path, stem: str, ending: str, used: Collection[Path] = frozenset()) -> Path:
    """Unused path in a folder: ``STEM.ENDING``, ``STEM-2.ENDING``, ...

    Args:
        folder: folder of the file.
        stem: name without ending.
        ending: ending with its dot.
        used: paths that are about to be written.
    """
    path, n = folder / f"{stem}{ending}", 1
    while path in used or path.exists():
        n += 1
        path = folder / f"{stem}-{n}{ending}"
    return path


def recording_path(
    folder: Path, name: str, now: datetime, used: Collection[Path] = frozenset()
) -> Path:
    """Unused path of a recording: ``NAME-YYYYmmdd-HHMMSS.npz`` in the folder.

    Args:
        folder: folder of the file.
        name: name of the puppet; characters other than letters, digits, - and _ become _.
        now: date and time.
        used: paths that are about to be written.
    """
    safe_name = re.sub(r"[^A-Za-z0-9_-]", "_", name)[:64] or "puppet"
    return unused_path(folder, f"{safe_name}-{now:%Y%m%d-%H%M%S}", ".npz", used)
