"""A file that is loaded again whenever it is saved: of a puppet, or of a score."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from fantoccini.base import FantocciniError
from fantoccini.dynamics.marionette import Marionette, load

Made = TypeVar("Made")

INTERVAL = 0.3
"""Time between looks at the file [s]."""


@dataclass(frozen=True, eq=False)
class Reload(Generic[Made]):
    """Result of loading the file again.

    Attributes:
        made: what the file describes, or None when it has errors.
        mistakes: lines, each with its place.
    """

    made: Made | None
    mistakes: tuple[str, ...] = ()


def compiled(path: Path) -> Marionette:
    """The puppet of a file, ready to be simulated."""
    made = load(path)
    made.compile()
    return made


class WatchedFile(Generic[Made]):
    """The file at ``path``.

    Args:
        path: of the file.
        load: makes of it what it describes.
    """

    def __init__(self, path: Path, load: Callable[[Path], Made]):
        self._path, self._load = path, load
        self._stamp = self._read_stamp()
        self._due = 0.0
        self._reader: threading.Thread | None = None
        self._result: Reload[Made] | None = None

    def poll(self, now: float) -> Reload[Made] | None:
        """The result of loading a changed file, once; otherwise None. ``now`` is a time [s].

        A thread of its own loads it.
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

    def again(self) -> None:
        """Lets the file be loaded again, though it is unchanged."""
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
        """Changes whenever the file does; None while there is no file."""
        try:
            about = self._path.stat()
        except OSError:
            return None
        return about.st_mtime_ns, about.st_size, about.st_ino
