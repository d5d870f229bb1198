"""Graph of places between which puppets walk straight, with the number of steps to the goal.

    V(i, j) = min over k of  turns(i, j, k) + n(j, k) + V(j, k),   V(i, goal) = last turns

V(i, j) is the number of steps from j on, for a puppet that came from i; n(j, k) that of a leg,
infinite if an obstacle blocks it. Metres and turns cost so little that they only decide between
ways of equally many steps.
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
"""Indices of the way's ends among the points."""
TURN = np.radians(22.5)
"""Largest turn of a step [rad]."""
METRE, CORNER = 1e-3, 1e-6
"""Costs of a metre and of a turn, relative to a step."""
BESIDE = 1e-4
"""Distance of the corners of ways from obstacles, in addition to the clearance [m]."""
EDGE = 1e-9
"""Tolerance of clearances [m]."""
_MIN_TURN = 1e-10
"""Turns smaller than this take no step [rad]."""
_LATTICE = 48
"""Number of places spread over the stage, where a puppet can make way."""
_MERGE_DISTANCE = 0.01
"""Places nearer to each other than this are merged [m]."""
_COSINES = np.cos(TURN * np.arange(1, round(np.pi / TURN))) - 1e-9


def turns(first: Complex, then: Complex) -> Array:
    """(...) number of steps to turn between headings, given as unit numbers (...)."""
    both = np.conj(first) * then
    cosine = both.real
    steps = ((np.abs(both.imag) > _MIN_TURN) | (cosine < 0.0)).astype(float)
    for limit in _COSINES:
        steps = steps + (cosine < limit)
    return np.asarray(steps)


def lattice(space: Rectangle) -> Complex:
    """(n,) places spread over a rectangle, including its sides."""
    size = np.subtract(space.high, space.low)
    pitch = float(np.sqrt(np.prod(size) / _LATTICE)) or 1.0
    x, y = (
        np.linspace(low, high, 1 + max(1, round((high - low) / pitch)))
        for low, high in zip(space.low, space.high, strict=True)
    )
    return (x[:, None] + 1j * y).ravel()


@dataclass(frozen=True, eq=False)
class Roadmap:
    """Points, unobstructed legs between them, and numbers of steps to the goal.

    Attributes:
        points: (P,) start, goal and places between them.
        heading: heading of the puppet at the goal, a unit number.
        standing: obstacles that stand on the stage.
        radius: radius of the puppet [m].
        longest_step: longest step [m].
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
        """Roadmap of the free places among those given."""
        corners = [region.corners(radius + BESIDE) for region in standing]
        all_places = np.concatenate([places, *corners])
        all_places = all_places[space.holds(all_places)]
        for region in standing:
            all_places = all_places[region.distance(all_places) >= radius - EDGE]
        points = ends
        for place in all_places:
            if np.min(np.abs(points - place)) > _MERGE_DISTANCE:
                points = np.append(points, place)
        return cls(points, heading, standing, radius, longest_step)

    @cached_property
    def open(self) -> list[Mask]:
        """(P, P) for each obstacle, whether legs keep clear of it."""
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
        """(P, P) steps of legs; infinite where an obstacle blocks them."""
        size = np.abs(self._way)
        n = np.maximum(np.ceil(size / self.longest_step - 1e-9), 1.0)
        free = np.logical_and.reduce([size > EDGE, *self.open])
        return np.where(free, n, np.inf)

    @cached_property
    def costs(self) -> Array:
        """(P, P) costs of legs: steps, and a little for each metre."""
        return self.steps + METRE * np.abs(self._way)

    @cached_property
    def rest(self) -> Array:
        """(P, P) V(i, j): costs from j to the goal, for a puppet that came from i."""
        p = len(self.points)
        rest = np.full((p, p), np.inf)
        last = turns(self.units[:, GOAL], np.array(self.heading))
        last = last + CORNER * (last > 0.0)
        rest[:, GOAL] = np.where(np.isfinite(self.steps[:, GOAL]), last, np.inf)
        near = np.argsort(np.abs(self._way[GOAL]), kind="stable")
        comes = [np.flatnonzero(np.isfinite(self.steps[:, j])) for j in range(p)]
        # A step that turns or stands parts two legs in a row, so that no leg is counted in both.
        corner = [
            np.maximum(turns(self.units[comes[j], j][:, None], self.units[j, comes[j]]), 1.0)
            + CORNER
            for j in range(p)
        ]
        changed = np.ones(p, dtype=bool)
        while np.any(changed):
            now = np.zeros(p, dtype=bool)
            for j in near:
                sources = comes[j]
                if j == GOAL or not np.any(changed[sources] | now[sources]):
                    continue
                best = np.min(
                    corner[j] + self.costs[j, sources] + rest[j, sources], axis=1, initial=np.inf
                )
                if np.any(best < rest[sources, j]):
                    rest[sources, j], now[j] = best, True
            changed = now
        return rest

    def reached(self, opened: Sequence[Mask]) -> Mask:
        """(P,) whether points are reached from the start by legs that are free in all masks."""
        free = np.logical_and.reduce([np.ones(self._way.shape, dtype=bool), *opened])
        is_reached = np.zeros(len(self.points), dtype=bool)
        is_reached[START] = True
        while True:
            more = is_reached | np.any(free[is_reached], axis=0)
            if np.array_equal(more, is_reached):
                return is_reached
            is_reached = more
