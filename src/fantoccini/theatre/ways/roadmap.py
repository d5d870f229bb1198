"""Places between which puppets walk straight, and how many steps the rest of a way takes.

    V(i, j) = min over k of  turns(i, j, k) + n(j, k) + V(j, k),   V(i, goal) = last turns

V(i, j) are steps from j on, for who came there from i; n(j, k) steps of a leg, infinite where
something stands in it. Metres and turns count by so little that they only decide between ways
of equally many steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fantoccini.base import Array, Mask
from fantoccini.theatre.gestures import Complex
from fantoccini.theatre.ways.regions import Rectangle, Region

START, GOAL = 0, 1
"""Places of the way's ends among the points."""
TURN = np.radians(22.5)
"""Most that a step turns [rad]."""
METRE, CORNER = 1e-3, 1e-6
"""Costs of a metre and of a turn, over that of a step."""
BESIDE = 1e-4
"""Distance of the corners of ways from obstacles, beside the clearance [m]."""
EDGE = 1e-9
"""Clearances are kept up to this [m]."""
_STRAIGHT = 1e-10
"""Below this no step is spent on turning [rad]."""
_LATTICE = 48
"""Places spread over the stage, to make way to."""
_SAME = 0.01
"""Places nearer to each other than this count once [m]."""
_COSINES = np.cos(TURN * np.arange(1, round(np.pi / TURN))) - 1e-9


def turns(first: Complex, then: Complex) -> Array:
    """(...) steps of turning from one heading to another: unit numbers (...)."""
    both = np.conj(first) * then
    cosine = both.real
    found = ((np.abs(both.imag) > _STRAIGHT) | (cosine < 0.0)).astype(float)
    for most in _COSINES:
        found = found + (cosine < most)
    return np.asarray(found)


def lattice(space: Rectangle) -> Complex:
    """(n,) places spread over a rectangle, its sides included."""
    size = np.subtract(space.high, space.low)
    pitch = float(np.sqrt(np.prod(size) / _LATTICE)) or 1.0
    x, y = (
        np.linspace(low, high, 1 + max(1, round((high - low) / pitch)))
        for low, high in zip(space.low, space.high, strict=True)
    )
    return (x[:, None] + 1j * y).ravel()


@dataclass(frozen=True, eq=False)
class Roadmap:
    """Points, legs between them that nothing standing blocks, and steps to the goal.

    Attributes:
        points: (P,) start, goal and places between.
        heading: of the puppet at the goal: a unit number.
        standing: what stands on the stage.
        radius: of the puppet [m].
        longest_step: [m].
    """

    points: Complex
    heading: complex
    standing: Sequence[Region]
    radius: float
    longest_step: float

    @classmethod
    def over(
        cls,
        ends: Complex,
        heading: complex,
        places: Complex,
        standing: Sequence[Region],
        space: Rectangle,
        radius: float,
        longest_step: float,
    ) -> Roadmap:
        """The roadmap of those of some places that are free."""
        corners = [region.corners(radius + BESIDE) for region in standing]
        all_places = np.concatenate([places, *corners])
        all_places = all_places[space.holds(all_places)]
        for one in standing:
            all_places = all_places[one.distance(all_places) >= radius - EDGE]
        points = ends
        for place in all_places:
            if np.min(np.abs(points - place)) > _SAME:
                points = np.append(points, place)
        return cls(points, heading, standing, radius, longest_step)

    @cached_property
    def open(self) -> list[Mask]:
        """(P, P) which legs keep clear of each thing that stands."""
        first, last = np.broadcast_arrays(self.points[:, None], self.points)
        return [
            region.distance_of_legs(first, last) >= self.radius - EDGE for region in self.standing
        ]

    @cached_property
    def _way(self) -> Complex:
        return self.points - self.points[:, None]

    @cached_property
    def units(self) -> Complex:
        """(P, P) headings of legs."""
        size = np.abs(self._way)
        return self._way / np.where(size > 0.0, size, 1.0)

    @cached_property
    def steps(self) -> Array:
        """(P, P) steps of legs; infinite where something is in them."""
        size = np.abs(self._way)
        n = np.maximum(np.ceil(size / self.longest_step - 1e-9), 1.0)
        free = np.logical_and.reduce([size > EDGE, *self.open])
        return np.where(free, n, np.inf)

    @cached_property
    def costs(self) -> Array:
        """(P, P) of legs: steps, and metres for a little."""
        return self.steps + METRE * np.abs(self._way)

    @cached_property
    def rest(self) -> Array:
        """(P, P) V(i, j): costs from j on, when coming from i."""
        p = len(self.points)
        rest = np.full((p, p), np.inf)
        last = turns(self.units[:, GOAL], np.array(self.heading))
        last = last + CORNER * (last > 0.0)
        rest[:, GOAL] = np.where(np.isfinite(self.steps[:, GOAL]), last, np.inf)
        near = np.argsort(np.abs(self._way[GOAL]), kind="stable")
        comes = [np.flatnonzero(np.isfinite(self.steps[:, j])) for j in range(p)]
        # Two legs in a row are parted by a step that turns or stands: no leg of theirs is both.
        corner = [
            np.maximum(turns(self.units[comes[j], j][:, None], self.units[j, comes[j]]), 1.0)
            + CORNER
            for j in range(p)
        ]
        changed = np.ones(p, dtype=bool)
        while np.any(changed):
            now = np.zeros(p, dtype=bool)
            for j in near:
                own = comes[j]
                if j == GOAL or not np.any(changed[own] | now[own]):
                    continue
                best = np.min(corner[j] + self.costs[j, own] + rest[j, own], axis=1, initial=np.inf)
                if np.any(best < rest[own, j]):
                    rest[own, j], now[j] = best, True
            changed = now
        return rest

    def reached(self, opened: Sequence[Mask]) -> Mask:
        """(P,) which points are reached from the start, by legs that are free in all of these."""
        free = np.logical_and.reduce([np.ones(self._way.shape, dtype=bool), *opened])
        found = np.zeros(len(self.points), dtype=bool)
        found[START] = True
        while True:
            more = found | np.any(free[found], axis=0)
            if np.array_equal(more, found):
                return found
            found = more
