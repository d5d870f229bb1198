"""Early stops of a play's runs, and the errors that cause them.

A company is a group of players and props that are simulated together.
"""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.base import FileError, SimulationError, StateError

SIMULATION_ERRORS = (FileError, SimulationError, ValueError, ArithmeticError)
"""Errors of the simulator about states, inputs, runs and numbers, for which a cue is refused."""


@dataclass(frozen=True)
class Stop:
    """Early stop of a company's run, or a run that cannot begin.

    Attributes:
        players: players of the company.
        t: time of the stop [s].
        reason: reason.
    """

    players: tuple[str, ...]
    t: float
    reason: str

    def sentence(self, when: str) -> str:
        """Sentence about the stop; ``when`` is its time in words."""
        return f"{' and '.join(self.players)}'s run stops {when}: {self.reason}"


class CannotBegin(StateError):
    """The first part of a player's run cannot be simulated.

    Attributes:
        stop: stop of the run, with its players and reason.
    """

    def __init__(self, stop: Stop):
        self.stop = stop
        super().__init__(stop.sentence("at the start"))
