"""Log of a script while it is compiled: mistakes, and changes.

A script is a score or a play. A change is a deviation of the compiled result from its text. A spot
is the list of keys that leads to an entry of the file.
"""

from __future__ import annotations

from fantoccini.base import Mistake
from fantoccini.base.documents import Located, Mistakes
from fantoccini.theatre.script.values import Spot

LATENESS_TOLERANCE = 1e-6
"""Lateness above which a cue is reported [s]."""


class ScriptLog:
    """Mistakes of a script, and deviations of the compiled result from its text.

    Attributes:
        located: lines of the file.
        beat: duration of a beat [s].
        mistakes: collector of mistakes.
        changes: deviations from the text.

    Args:
        located: lines of the file.
        tempo: beats in a minute; None if times are in seconds.
    """

    def __init__(self, located: Located, tempo: float | None):
        self.located, self._tempo = located, tempo
        self.beat = 1.0 if tempo is None else 60.0 / tempo
        self.mistakes = Mistakes(located)
        self.changes: list[Mistake] = []

    def change(self, spot: Spot, text: str) -> None:
        """Records a deviation from the text."""
        self.changes.append(self.located.problem(spot, text))

    def in_words(self, t: float, of_phrase: bool = False) -> str:
        """Time of the script or of a phrase in words: ``on beat 4.00 (2.40 s)``."""
        suffix = " of the phrase" if of_phrase else ""
        if self._tempo is None:
            return f"at {t:.2f} s{suffix}"
        return f"on beat {t / self.beat:.2f}{suffix} ({t:.2f} s)"

    def duration_in_words(self, seconds: float) -> str:
        """A duration in words: ``1.50 beats (0.90 s)``, or in seconds if times are in seconds."""
        if self._tempo is None:
            return f"{seconds:.2f} s"
        return f"{seconds / self.beat:.2f} beats ({seconds:.2f} s)"
