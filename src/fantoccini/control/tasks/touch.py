"""Touches: places to pass at times that the search finds.

Such a touch is not a contact: a point of a body passes a place in space.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, StateError


@dataclass(frozen=True, eq=False)
class Touch:
    """min |place(t) - target| over t in the window is 0: a point of a body passes a place.

    Attributes:
        body: name of the body.
        place: (3,) the place in the world [m].
        at: (3,) the point in the body's frame [m].
        between: the window, first and last time [s]; the whole motion by default.
        in_turn: whether it comes no earlier than the previous touch in the list.
    """

    body: str
    place: Sequence[float] | Array
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    between: tuple[float, float] = (-math.inf, math.inf)
    in_turn: bool = False

    def __post_init__(self) -> None:
        place = np.asarray(self.place, dtype=float)
        for label, vector in (("place", place), ("point", np.asarray(self.at, dtype=float))):
            if vector.shape != (3,) or not np.all(np.isfinite(vector)):
                raise StateError(
                    f"the {label} of a touch of {self.body} is {vector.tolist()}; needed: 3 finite "
                    "numbers"
                )
        if np.shape(self.between) != (2,) or not self.between[0] < self.between[1]:
            raise StateError(
                f"{self.body} touches between {self.between!r}; needed: a time and a later one"
            )

    def __str__(self) -> str:
        return f"{self.body} touches ({', '.join(f'{x:.4g}' for x in self.place)})"


@dataclass(frozen=True, eq=False)
class ClosestApproach:
    """The closest approach of a motion to a place.

    Attributes:
        touch: the required touch.
        t: time of the closest approach [s].
        distance: distance at that time [m].
    """

    touch: Touch
    t: float
    distance: float

    def __str__(self) -> str:
        return f"{self.touch} at {self.t:.4f} s within {self.distance:.2g} m"


def check_windows(touches: Sequence[Touch], start: float, end: float) -> None:
    """Raises StateError if the window of a touch misses the motion, or ends before its turn."""
    earliest = -math.inf
    for touch in touches:
        if touch.between[1] <= start or touch.between[0] >= end:
            raise StateError(
                f"{touch} between {touch.between[0]:g} s and {touch.between[1]:g} s; the motion "
                f"is from {start:g} s to {end:g} s"
            )
        earliest = max(earliest if touch.in_turn else -math.inf, touch.between[0])
        if touch.between[1] <= earliest:
            raise StateError(
                f"{touch} in turn, and by {touch.between[1]:g} s; those before it come at "
                f"{earliest:g} s at the earliest"
            )
