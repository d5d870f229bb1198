"""Recordings that go to disk, each under a name of its own."""

from __future__ import annotations

import re
import tempfile
import threading
from collections.abc import Collection
from datetime import datetime
from pathlib import Path

from fantoccini.errors import FantocciniError
from fantoccini.perform import Performance, Recording


class Take:
    """The recording that goes on, and where the last one went.

    Attributes:
        said: what became of the last one; empty at first.

    Args:
        performance: what is recorded.
        folder: where recordings go.
    """

    def __init__(self, performance: Performance, folder: Path):
        self._performance, self._folder = performance, folder
        self._name = ""
        self._writers: list[threading.Thread] = []
        self._given: set[Path] = set()
        self.running = False
        self.began = 0.0
        self.said = ""

    def begin(self) -> None:
        """Records from now on."""
        self._name = self._performance.marionette.name
        self._performance.record()
        self.running, self.began = True, self._performance.t

    def look(self) -> None:
        """Writes a recording that has ended by itself."""
        if self.running and not self._performance.recording:
            self.end()

    def end(self) -> None:
        """Ends the recording; it is written beside everything else."""
        ended = self._ended()
        if ended is None:
            return
        writer = threading.Thread(target=self._write, args=ended, name="write")
        try:
            writer.start()
        except RuntimeError:  # Python ends, and starts no threads any more
            self._write(*ended)
        else:
            self._writers.append(writer)

    def finish(self) -> None:
        """Ends the recording, and waits until everything is on disk."""
        self.end()
        for writer in self._writers:
            writer.join()
        self._writers.clear()

    def _ended(self) -> tuple[Recording, Path] | None:
        """The recording that was going on and the path it gets; None where there is none."""
        if not self.running:
            return None
        self.running = False
        try:
            recording = self._performance.stop()
        except FantocciniError as error:
            self.said = str(error)
            return None
        path = free_path(self._folder, self._name, datetime.now(), self._given)
        self._given.add(path)
        self.said = f"writing {path.name}"
        return recording, path

    def _write(self, recording: Recording, path: Path) -> None:
        """Writes a recording; where its folder takes none any more, among temporary files."""
        failed = ""
        for place in (path, Path(tempfile.gettempdir()) / path.name):
            try:
                recording.save(place)
            except Exception as error:  # whatever it is, nobody else would tell
                reason = str(getattr(error, "strerror", None) or error)
                told = f"{place} cannot be written"
                failed += (reason if reason.startswith(told) else f"{told}: {reason}") + "; "
                continue
            why = f"; {recording.ended}" if recording.ended else ""
            self.said = f"{failed}wrote {place} ({recording.duration:.1f} s{why})"
            return
        self.said = f"{failed}the recording is lost"


def free_path(
    folder: Path, name: str, now: datetime, given: Collection[Path] = frozenset()
) -> Path:
    """A path that no file has: ``NAME-YYYYmmdd-HHMMSS.npz`` in the folder.

    Args:
        folder: where.
        name: of the puppet; what is no letter, digit, - or _ in it becomes one.
        now: date and time.
        given: paths that are about to be written.
    """
    plain = re.sub(r"[^A-Za-z0-9_-]", "_", name)[:64] or "puppet"
    stem = f"{plain}-{now:%Y%m%d-%H%M%S}"
    path, n = folder / f"{stem}.npz", 1
    while path in given or path.exists():
        n += 1
        path = folder / f"{stem}-{n}.npz"
    return path
