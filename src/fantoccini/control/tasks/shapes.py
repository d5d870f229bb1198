"""Paths with simple shapes.

    p(t) = c + r (e_1 cos phi + e_2 sin phi),   phi = 2 pi turns (10 s^3 - 15 s^4 + 6 s^5)

with s from 0 to 1: a circle that begins and ends at rest (minimum jerk).

c is the centre and r the radius; e_1 and e_2 are orthogonal unit vectors in the plane of the
circle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, StateError, polynomial

_MIN_RADIUS = 1e-6
"""Distance from the axis below which a place has no direction from it [m]."""


@dataclass(frozen=True, eq=False)
class Circle:
    """A circle as a function of time, starting at its point nearest to a given place.

    Attributes:
        centre, e_1, e_2: (3,) centre, and unit vectors of the plane's axes [m, 1, 1].
        radius: radius [m].
        turns: number of turns about the normal, by the right hand; negative for the opposite sense.
        start, end: times at which it begins and ends [s]; it rests before and after.
    """

    centre: Array
    e_1: Array
    e_2: Array
    radius: float
    turns: float
    start: float
    end: float

    @classmethod
    def near(
        cls,
        place: Array,
        centre: Array,
        normal: Array,
        radius: float | None,
        turns: float,
        start: float,
        end: float,
    ) -> Circle:
        """The circle about an axis, starting at its point nearest to a place.

        Args:
            place, centre, normal: (3,) in the world; the normal is a unit vector [m, m, 1].
            radius: radius [m]; by default the distance of the place from the axis.
            turns, start, end: see :class:`Circle`.

        Raises:
            StateError: place on the axis, so that there is no nearest point.
        """
        offset = place - centre
        offset = offset - normal * (normal @ offset)
        distance = float(np.linalg.norm(offset))
        if distance < _MIN_RADIUS:
            raise StateError(
                "the point starts on the circle's axis; needed: a centre beside it, in the "
                "circle's plane"
            )
        e_1 = offset / distance
        radius = distance if radius is None else radius
        return cls(centre, e_1, np.cross(normal, e_1), radius, turns, start, end)

    def __call__(self, t: float) -> Array:
        """(3,) the position at a time [m]."""
        s = np.clip((t - self.start) / (self.end - self.start), 0.0, 1.0)
        phi = 2.0 * np.pi * self.turns * polynomial.minimum_jerk(s)[0]
        direction = np.cos(phi) * self.e_1 + np.sin(phi) * self.e_2
        return np.asarray(self.centre + self.radius * direction)
