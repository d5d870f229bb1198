"""Graph of places between which puppets walk straight, with the number of steps to the goal.

    V(i, j) = min over k of  turns(i, j, k) + n(j, k) + V(j, k),   V(i, goal) = last turns

V(i, j) is the number of steps from j to the goal, for a puppet that came from i; n(j, k) that of a
leg, infinite if an obstacle blocks it. Costs of metres and turns are so small that they only decide
between ways of equally many steps.
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
MAX_STEP_TURN = np.radians(22.5)
"""Largest turn of a step [rad]."""
METRE_COST, TURN_COST = 1e-3, 1e-6
"""Costs of a metre and of a turn, relative to a step."""
CORNER_MARGIN = 1e-4
"""Distance of turning points from obstacles, in addition to the clearance [m]."""
CLEARANCE_TOLERANCE = 1e-9
"""Tolerance of clearances [m]."""
_MIN_TURN = 1e-10
"""Least turn that takes a step [rad]."""
_N_SPREAD_PLACES = 48
"""Number of places spread over the stage, where a puppet can make way."""
_MERGE_DISTANCE = 0.01
"""Distance below which places are merged [m]."""
_TURN_COSINES = np.cos(MAX_STEP_TURN * np.arange(1, round(np.pi / MAX_STEP_TURN))) - 1e-9


def turn_steps(first: Complex, second: Complex) -> Array:
    """(...) numbers of steps to turn from first to second headings (...), complex of length 1."""
    turn = np.conj(first) * second
    cosine = turn.real
    steps = ((np.abs(turn.imag) > _MIN_TURN) | (cosine < 0.0)).astype(float)
    for limit in _TURN_COSINES:
        steps = steps + (cosine < limit)
    return np.asarray(steps)


def spread_places(space: Rectangle) -> Complex:
    """(n,) places spread over a rectangle, including its sides."""
    size = np.subtract(space.high, space.low)
    pitch = float(np.sqrt(np.prod(size) / _N_SPREAD_PLACES)) or 1.0
    x, y = (
        np.linspace(low, high, 1 + max(1, round((high - low) / pitch)))
        for low, high in zip(space.low, space.high, strict=True)
    )
    return (x[:, None] + 1j * y).ravel()


@dataclass(frozen=True, eq=False)
class Roadmap:
    """Points, straight legs between them, and numbers of steps to the goal.

    Attributes:
        points: (P,) start, goal and places between them.
        heading: heading of the puppet at the goal, complex of length 1.
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
    def build(
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
        corners = [region.corners(radius + CORNER_MARGIN) for region in standing]
        all_places = np.concatenate([places, *corners])
        all_places = all_places[space.holds(all_places)]
        for region in standing:
            all_places = all_places[region.distance(all_places) >= radius - CLEARANCE_TOLERANCE]
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
            region.distance_of_legs(first, last) >= self.radius - CLEARANCE_TOLERANCE
            for region in self.standing
        ]

    @cached_property
    def _legs(self) -> Complex:
        return self.points - self.points[:, None]

    @cached_property
    def directions(self) -> Complex:
        """(P, P) headings of legs."""
        size = np.abs(self._legs)
        return self._legs / np.where(size > 0.0, size, 1.0)

    @cached_property
    def steps(self) -> Array:
        """(P, P) steps of legs; infinite where an obstacle blocks them."""
        size = np.abs(self._legs)
        n = np.maximum(np.ceil(size / self.longest_step - 1e-9), 1.0)
        free = np.logical_and.reduce([size > CLEARANCE_TOLERANCE, *self.open])
        return np.where(free, n, np.inf)

    @cached_property
    def costs(self) -> Array:
        """(P, P) costs of legs: steps, and a little for each metre."""
        return self.steps + METRE_COST * np.abs(self._legs)

    @cached_property
    def cost_to_goal(self) -> Array:
        """(P, P) V(i, j): costs from j to the goal, for a puppet that came from i."""
        p = len(self.points)
        to_goal = np.full((p, p), np.inf)
        last = turn_steps(self.directions[:, GOAL], np.array(self.heading))
        last = last + TURN_COST * (last > 0.0)
        to_goal[:, GOAL] = np.where(np.isfinite(self.steps[:, GOAL]), last, np.inf)
        near = np.argsort(np.abs(self._legs[GOAL]), kind="stable")
        neighbours = [np.flatnonzero(np.isfinite(self.steps[:, j])) for j in range(p)]
        # A step that turns or stands separates two legs in a row, so that no leg is counted twice.
        corner_costs = [
            np.maximum(
                turn_steps(
                    self.directions[neighbours[j], j][:, None], self.directions[j, neighbours[j]]
                ),
                1.0,
            )
            + TURN_COST
            for j in range(p)
        ]
        changed = np.ones(p, dtype=bool)
        while np.any(changed):
            changed_now = np.zeros(p, dtype=bool)
            for j in near:
                sources = neighbours[j]
                if j == GOAL or not np.any(changed[sources] | changed_now[sources]):
                    continue
                costs = corner_costs[j] + self.costs[j, sources] + to_goal[j, sources]
                best = np.min(costs, axis=1, initial=np.inf)
                if np.any(best < to_goal[sources, j]):
                    to_goal[sources, j], changed_now[j] = best, True
            changed = changed_now
        return to_goal

    def reached(self, masks: Sequence[Mask]) -> Mask:
        """(P,) bool, points reached from the start by legs that are free in all masks (P, P)."""
        free = np.logical_and.reduce([np.ones(self._legs.shape, dtype=bool), *masks])
        is_reached = np.zeros(len(self.points), dtype=bool)
        is_reached[START] = True
        while True:
            more = is_reached | np.any(free[is_reached], axis=0)
            if np.array_equal(more, is_reached):
                return is_reached
            is_reached = more
