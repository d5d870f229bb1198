"""Mistakes of scores and plays, and what is not as it was written."""

from __future__ import annotations

from fantoccini.base import FileError, Mistake
from fantoccini.base.documents import Located
from fantoccini.theatre.script.values import Spot

LATE = 1e-6
"""Lateness that is reported [s]."""


class Notes:
    """Mistakes and changes of a score or a play.

    Attributes:
        located: the file.
        beat: duration of a beat [s].
        found: places and mistakes.
        changes: what is not as it was written.

    Args:
        located: the file.
        tempo: beats in a minute; None where times are in seconds.
    """

    def __init__(self, located: Located, tempo: float | None):
        self.located, self._tempo = located, tempo
        self.beat = 1.0 if tempo is None else 60.0 / tempo
        self.found: list[tuple[Spot, str]] = []
        self.changes: list[Mistake] = []

    def mistake(self, spot: Spot, text: str) -> None:
        """Notes a mistake."""
        self.found.append((spot, text))

    def change(self, spot: Spot, text: str) -> None:
        """Notes what is not as it was written."""
        self.changes.append(self.located.problem(spot, text))

    def refuse(self) -> None:
        """Raises a FileError if there are mistakes."""
        if self.found:
            raise self.located.error(self.found, FileError)

    def said(self, t: float, within: bool = False) -> str:
        """A time in words: ``on beat 4.00 (2.40 s)``; ``within`` a phrase it counts from there."""
        end = " of the phrase" if within else ""
        if self._tempo is None:
            return f"at {t:.2f} s{end}"
        return f"on beat {t / self.beat:.2f}{end} ({t:.2f} s)"
