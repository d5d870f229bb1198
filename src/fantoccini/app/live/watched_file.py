"""File of a puppet or a score that is loaded again whenever it changes.

A score times gestures of a puppet.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from fantoccini.base import FantocciniError
from fantoccini.dynamics.marionette import Marionette, load

Content = TypeVar("Content")

CHECK_INTERVAL = 0.3
"""Interval of checks of the file [s]."""


@dataclass(frozen=True, eq=False)
class Reload(Generic[Content]):
    """Result of loading the file again.

    Attributes:
        content: content of the file, or None if it has errors.
        mistakes: lines with the errors and their places.
    """

    content: Content | None
    mistakes: tuple[str, ...] = ()


def load_compiled(path: Path) -> Marionette:
    """Loads and compiles the puppet of a file."""
    content = load(path)
    content.compile()
    return content


class WatchedFile(Generic[Content]):
    """Watcher of a file.

    Args:
        path: path of the file.
        load: function that reads the file.
    """

    def __init__(self, path: Path, load: Callable[[Path], Content]):
        self._path, self._load = path, load
        self._stamp = self._read_stamp()
        self._next_check = 0.0
        self._reader: threading.Thread | None = None
        self._result: Reload[Content] | None = None

    def poll(self, now: float) -> Reload[Content] | None:
        """Result of loading a changed file, once; otherwise None. ``now`` is a time [s].

        Another thread loads the file.
        """
        if self._reader is not None:
            if self._reader.is_alive():
                return None
            result, self._result, self._reader = self._result, None, None
            return result
        if now < self._next_check:
            return None
        self._next_check = now + CHECK_INTERVAL
        stamp = self._read_stamp()
        if stamp is None or stamp == self._stamp:
            return None
        self._stamp = stamp
        self._reader = threading.Thread(target=self._read, name="read", daemon=True)
        self._reader.start()
        return None

    def force_reload(self) -> None:
        """Loads the file again at the next poll, even if it is unchanged."""
        self._stamp = None

    def _read(self) -> None:
        try:
            self._result = Reload(self._load(self._path))
        except (FantocciniError, OSError) as error:
            self._result = Reload(None, tuple(str(error).splitlines()))
        except Exception as error:
            message = f"internal error: {type(error).__name__}: {error}"
            self._result = Reload(None, tuple(message.splitlines()))

    def _read_stamp(self) -> tuple[int, int, int] | None:
        """Time, size and inode of the file, which show changes; None if there is no file."""
        try:
            status = self._path.stat()
        except OSError:
            return None
        return status.st_mtime_ns, status.st_size, status.st_ino
