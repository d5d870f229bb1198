"""The file of a puppet, read again whenever it is saved."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from pathlib import Path

from fantoccini.errors import FantocciniError
from fantoccini.marionette import Marionette, load

_EVERY = 0.3
"""Looks at the file so often [s]."""


@dataclass(frozen=True, eq=False)
class News:
    """What came of reading the file again.

    Attributes:
        marionette: the puppet, or None when the file holds mistakes.
        mistakes: lines, each with its place.
    """

    marionette: Marionette | None
    mistakes: tuple[str, ...] = ()


class Source:
    """A puppet's file that may change.

    Args:
        path: of the file.
    """

    def __init__(self, path: Path):
        self._path = path
        self._stamp = self._look()
        self._due = 0.0
        self._reader: threading.Thread | None = None
        self._news: News | None = None

    def news(self, now: float) -> News | None:
        """What came of reading the file, once; None when nothing has changed.

        The file is read, and the puppet compiled, beside everything else.

        Args:
            now: a time [s].
        """
        if self._reader is not None:
            if self._reader.is_alive():
                return None
            news, self._news, self._reader = self._news, None, None
            return news
        if now < self._due:
            return None
        self._due = now + _EVERY
        stamp = self._look()
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
            self._news = News(marionette)
        except (FantocciniError, OSError) as error:
            self._news = News(None, tuple(str(error).splitlines()))
        except Exception as error:
            what = f"a fault of fantoccini itself: {type(error).__name__}: {error}"
            self._news = News(None, tuple(what.splitlines()))

    def _look(self) -> tuple[int, int, int] | None:
        """What changes with the file; None while it is not there."""
        try:
            about = self._path.stat()
        except OSError:
            return None
        return about.st_mtime_ns, about.st_size, about.st_ino
