"""Footings of puppets on the stage, their walks, and reasons why no walk exists.

A footing is the place of a puppet on the stage and its heading, the angle of its forward direction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from itertools import groupby, takewhile

import numpy as np

from fantoccini.base import Array, Times
from fantoccini.theatre.gestures import Step, StepPath


@dataclass(frozen=True)
class Footing:
    """Position and heading of a puppet: those of the midpoint of its shoulder strings' ends.

    Attributes:
        x, y: position in the scene's frame [m].
        heading: angle of its forward direction from x, to the left [rad].
    """

    x: float
    y: float
    heading: float = 0.0

    @property
    def place(self) -> complex:
        """x + i y [m]."""
        return complex(self.x, self.y)

    def seen(self, place: complex) -> complex:
        """Place of the scene in this footing's frame: distance ahead + i distance left [m]."""
        return complex(np.exp(-1j * self.heading) * (place - self.place))

    def towards(self, place: complex) -> float:
        """Heading towards a place [rad]."""
        return float(np.angle(place - self.place))

    def facing(self, heading: float) -> Footing:
        """Footing at the same place with another heading [rad]."""
        return replace(self, heading=heading)


@dataclass(frozen=True)
class Walk:
    """Steps from one footing to another, clear of others and obstacles.

    The body sways up to ``fantoccini.theatre.gestures.walking.SWAY`` to each side of the path.

    Attributes:
        start: footing before it begins.
        begin: time of the first step [s].
        steps: steps in order; empty if the puppet is at the goal already.
        step_time: duration of a step [s].
        pauses: numbers of steps that stand before and after each straight part, in which the puppet
            is lowered to the floor and raised; 0 if it walks above the floor.
    """

    start: Footing
    begin: float
    steps: tuple[Step, ...]
    step_time: float
    pauses: tuple[int, int] = (0, 0)

    @property
    def end(self) -> float:
        """Time of arrival [s]."""
        return self.begin + len(self.steps) * self.step_time

    @property
    def move_time(self) -> float:
        """Time at which it first turns, steps or is lowered to the floor [s]."""
        n = len(list(takewhile(lambda step: step.stands, self.steps)))
        is_straight = n < len(self.steps) and self.steps[n].length != 0.0
        return self.begin + (n - is_straight * self.pauses[0]) * self.step_time

    @property
    def straight_parts(self) -> list[tuple[int, int]]:
        """Index of the first step and number of steps, of each straight part."""
        parts, first = [], 0
        for step, equal_steps in groupby(self.steps):
            n = len(list(equal_steps))
            if step.length != 0.0:
                parts.append((first, n))
            first += n
        return parts

    @property
    def length(self) -> float:
        """Length of all steps [m]."""
        return sum(abs(step.length) for step in self.steps)

    def footing(self, t: Times) -> tuple[Array, Array]:
        """(T, 2) places [m] and (T,) headings [rad] at times [s], as in the gesture of the walk.

        Headings are continuous from the first one, also beyond half a turn.
        """
        track_path, heading = self._track.at(np.asarray(t, dtype=float) - self.begin)
        z = self.start.place + np.exp(1j * self.start.heading) * track_path[0]
        return np.stack([z.real, z.imag], axis=-1), self.start.heading + heading[0]

    @cached_property
    def _track(self) -> StepPath:
        return StepPath(self.steps, self.step_time)


class Hindrance(Enum):
    """Kind of obstruction of a walk."""

    START_BLOCKED = "start blocked"
    GOAL_BLOCKED = "goal blocked"
    GOAL_OUTSIDE = "goal outside"
    GOAL_OCCUPIED = "goal occupied"
    NO_WAY_ROUND = "no way round"
    OTHERS_IN_THE_WAY = "others in the way"


@dataclass(frozen=True)
class NoPath:
    """Reason why no walk exists, with an alternative. Its truth value is False.

    Attributes:
        kind: kind of obstruction.
        reason: reason in words, as the end of a sentence.
        names: names of the players or obstacles in the way.
        nearest: reachable footing that is about the nearest to the goal.
        earliest: earliest arrival at the goal, if the only obstacle is the latest time [s].
    """

    kind: Hindrance
    reason: str
    names: tuple[str, ...] = ()
    nearest: Footing | None = None
    earliest: float | None = None

    def __bool__(self) -> bool:
        return False
