"""A puppet file that is loaded again whenever it is saved."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from pathlib import Path

from fantoccini.errors import FantocciniError
from fantoccini.marionette import Marionette, load

INTERVAL = 0.3
"""Time between looks at the file [s]."""


@dataclass(frozen=True, eq=False)
class Reload:
    """Result of loading the file again.

    Attributes:
        marionette: the puppet, or None when the file has errors.
        mistakes: lines, each with its place.
    """

    marionette: Marionette | None
    mistakes: tuple[str, ...] = ()


class WatchedFile:
    """The puppet file at ``path``."""

    def __init__(self, path: Path):
        self._path = path
        self._stamp = self._read_stamp()
        self._due = 0.0
        self._reader: threading.Thread | None = None
        self._result: Reload | None = None

    def poll(self, now: float) -> Reload | None:
        """The result of loading a changed file, once; otherwise None. ``now`` is a time [s].

        A thread of its own reads the file and compiles the puppet.
        """
        if self._reader is not None:
            if self._reader.is_alive():
                return None
            result, self._result, self._reader = self._result, None, None
            return result
        if now < self._due:
            return None
        self._due = now + INTERVAL
        stamp = self._read_stamp()
        if stamp is None or stamp == self._stamp:
            return None
        self._stamp = stamp
        self._reader = threading.Thread(target=self._read, name="read", daemon=True)
        self._reader.start()
        return None

    def _read(self) -> None:
        try:
            marionette = load(self._path)
            marionette.compile()
            self._result = Reload(marionette)
        except (FantocciniError, OSError) as error:
            self._result = Reload(None, tuple(str(error).splitlines()))
        except Exception as error:
            message = f"internal error: {type(error).__name__}: {error}"
            self._result = Reload(None, tuple(message.splitlines()))

    def _read_stamp(self) -> tuple[int, int, int] | None:
        """Changes whenever the file does; None while there is no file."""
        try:
            about = self._path.stat()
        except OSError:
            return None
        return about.st_mtime_ns, about.st_size, about.st_ino
