"""Where runs of a play stop before their end, and the errors by which they do."""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.errors import FileError, SimulationError, StateError

ERRORS = (FileError, SimulationError, ValueError, ArithmeticError)
"""Errors of the simulator that refuse a cue: of states, inputs, runs and numbers."""


@dataclass(frozen=True)
class Stop:
    """Where a company's run stops before its end, or cannot begin.

    Attributes:
        players: of the company.
        t: when [s].
        why: in words.
    """

    players: tuple[str, ...]
    t: float
    why: str

    def told(self, when: str) -> str:
        """In words, with a time in words."""
        return f"{' and '.join(self.players)}'s run stops {when}: {self.why}"


class CannotBegin(StateError):
    """The first part of a player's run cannot be simulated.

    Attributes:
        stop: whose, and why.
    """

    def __init__(self, stop: Stop):
        self.stop = stop
        super().__init__(stop.told("at the start"))
