"""What a plan costs."""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.arrays import Array
from fantoccini.runtime import Segments


@dataclass(frozen=True)
class Objective:
    """What is to be little in plans that follow a first one::

        J = T + catch n_catches + effort integral |acc_K|^2 dt

    Attributes:
        catch: what a string or a limit that is caught counts [s].
        effort: weight of the driven accelerations [s^4/m^2].
    """

    catch: float = 0.0
    effort: float = 0.0

    def of_segments(self, made: Segments, interval: float) -> Array:
        """(n, segments) [s] of motions.

        Args:
            made: the motions.
            interval: between looks [s].
        """
        duration = interval * made.looks
        cost = duration + self.catch * made.catches
        if self.effort:
            there = made.looks > 0
            cost[there] += self.effort * duration[there] * (made.acc_K[there] ** 2).sum(axis=1)
        return cost


TIME = Objective()

OBJECTIVES = {
    "gentle": Objective(catch=1.0),
    "time": TIME,
    "effort": Objective(effort=1.0),
}
"""Objectives by name."""
