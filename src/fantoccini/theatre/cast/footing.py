"""Places of puppets on the stage, the ways that they walk, and the reasons why there is none."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np

from fantoccini.base import Array, Times
from fantoccini.theatre.gestures import Step, Track


@dataclass(frozen=True)
class Footing:
    """Place and heading of a puppet: of the middle between the shoulders' strings' ends.

    Attributes:
        x, y: in the scene's frame [m].
        heading: of its forward from x, to the left [rad].
    """

    x: float
    y: float
    heading: float = 0.0

    @property
    def place(self) -> complex:
        """x + i y [m]."""
        return complex(self.x, self.y)

    def seen(self, place: complex) -> complex:
        """A place of the scene as it is seen from here: ahead + i (to the left) [m]."""
        return complex(np.exp(-1j * self.heading) * (place - self.place))

    def towards(self, place: complex) -> float:
        """The heading in which a place lies [rad]."""
        return float(np.angle(place - self.place))

    def facing(self, heading: float) -> Footing:
        """The same place with another heading [rad]."""
        return replace(self, heading=heading)


@dataclass(frozen=True)
class Way:
    """Steps from one footing to another, free of others and obstacles.

    The body sways about it by ``fantoccini.theatre.gestures.walking.SWAY`` to each side.

    Attributes:
        start: the footing until it begins.
        begin: [s].
        steps: in order; none where the puppet is there already.
        step_time: of each [s].
    """

    start: Footing
    begin: float
    steps: tuple[Step, ...]
    step_time: float

    @property
    def end(self) -> float:
        """Time of arrival [s]."""
        return self.begin + len(self.steps) * self.step_time

    @property
    def length(self) -> float:
        """Length of all steps [m]."""
        return sum(abs(step.length) for step in self.steps)

    def footing(self, t: Times) -> tuple[Array, Array]:
        """(T, 2) places [m] and (T,) headings [rad] at times [s], by the gesture's formulas.

        Headings go on beyond half a turn, from that of the start on.
        """
        path, heading = self._track.at(np.asarray(t, dtype=float) - self.begin)
        z = self.start.place + np.exp(1j * self.start.heading) * path[0]
        return np.stack([z.real, z.imag], axis=-1), self.start.heading + heading[0]

    @cached_property
    def _track(self) -> Track:
        return Track(self.steps, self.step_time)


class Hindrance(Enum):
    """Why there is no way."""

    START_BLOCKED = "start blocked"
    GOAL_BLOCKED = "goal blocked"
    GOAL_OUTSIDE = "goal outside"
    GOAL_OCCUPIED = "goal occupied"
    NO_WAY_ROUND = "no way round"
    OTHERS_IN_THE_WAY = "others in the way"


@dataclass(frozen=True)
class NoWay:
    """Why a puppet cannot go where it should, and what it could do. False, as a condition.

    Attributes:
        kind: which of the reasons.
        reason: in words, as the end of a sentence.
        names: of what is in the way.
        nearest: a footing to which it can go, about the nearest one to the goal.
        earliest: when it can be at the goal, where that is only too late [s].
    """

    kind: Hindrance
    reason: str
    names: tuple[str, ...] = ()
    nearest: Footing | None = None
    earliest: float | None = None

    def __bool__(self) -> bool:
        return False
