"""Early stops of a play's runs, and the errors that cause them."""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.base import FileError, SimulationError, StateError

ERRORS = (FileError, SimulationError, ValueError, ArithmeticError)
"""Errors of the simulator that refuse a cue: of states, inputs, runs and numbers."""


@dataclass(frozen=True)
class Stop:
    """The early stop of a company's run, or a run that cannot begin.

    Attributes:
        players: of the company.
        t: time of the stop [s].
        why: the reason.
    """

    players: tuple[str, ...]
    t: float
    why: str

    def told(self, when: str) -> str:
        """A sentence on the stop; ``when`` is its time in words."""
        return f"{' and '.join(self.players)}'s run stops {when}: {self.why}"


class CannotBegin(StateError):
    """The first part of a player's run cannot be simulated.

    Attributes:
        stop: whose, and why.
    """

    def __init__(self, stop: Stop):
        self.stop = stop
        super().__init__(stop.told("at the start"))
