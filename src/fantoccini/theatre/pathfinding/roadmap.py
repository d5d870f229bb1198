"""Graph of places between which puppets walk straight, with the number of steps to the goal.

    V(i, j) = min over k of  turns(i, j, k) + n(j, k) + V(j, k),   V(i, goal) = last turns

V(i, j) is the number of steps from j to the goal, for a puppet that came from i; n(j, k) that of a
leg, infinite if an obstacle blocks it. Costs of metres and turns are so small that they only decide
between ways of equally many steps.

A leg is a straight walk between two places. i, j and k are places: a puppet walks from i to j and
on to k. The heading is the angle of the forward direction, seen from above.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fantoccini.base import Array, Mask
from fantoccini.theatre.gestures import Complex
from fantoccini.theatre.pathfinding.regions import Rectangle, Region

START, GOAL = 0, 1
"""Indices of the start and the goal among the points."""
MAX_STEP_TURN = np.radians(22.5)
"""Largest turn of a step [rad]."""
METRE_COST, TURN_COST = 1e-3, 1e-6
"""Costs of a metre and of a turn, relative to a step."""
CORNER_MARGIN = 1e-4
"""Distance of turning points from obstacles, in addition to the clearance [m]."""
CLEARANCE_TOLERANCE = 1e-9
"""Tolerance of clearances [m]."""
_SLOW_TURN_STEPS = 3.0
"""Additional steps of a turn above the floor before or after a walk on it: a puppet that is lowered
must hardly swing about the vertical."""
_MIN_TURN = 1e-10
"""Least turn that takes a step [rad]."""
_N_SPREAD_PLACES = 48
"""Number of places spread over the stage, where a puppet can step aside."""
_MERGE_DISTANCE = 0.01
"""Distance below which places are merged [m]."""
_TURN_COSINES = np.cos(MAX_STEP_TURN * np.arange(1, round(np.pi / MAX_STEP_TURN))) - 1e-9


def turn_steps(first: Complex, second: Complex, pauses: tuple[int, int]) -> Array:
    """(...) numbers of steps to turn from first to second headings (...), complex of length 1.

    They are more if there are pauses, in which the puppet is lowered to the floor and raised.
    """
    turn = np.conj(first) * second
    cosine = turn.real
    steps = ((np.abs(turn.imag) > _MIN_TURN) | (cosine < 0.0)).astype(float)
    for limit in _TURN_COSINES:
        steps = steps + (cosine < limit)
    return np.asarray(steps + _SLOW_TURN_STEPS * (steps > 0.0) if any(pauses) else steps)


def spread_places(space: Rectangle) -> Complex:
    """(n,) places spread over a rectangle, including its sides."""
    size = np.subtract(space.upper, space.lower)
    pitch = float(np.sqrt(np.prod(size) / _N_SPREAD_PLACES)) or 1.0
    x, y = (
        np.linspace(lower, upper, 1 + max(1, round((upper - lower) / pitch)))
        for lower, upper in zip(space.lower, space.upper, strict=True)
    )
    return (x[:, None] + 1j * y).ravel()


@dataclass(frozen=True, eq=False)
class Roadmap:
    """Points, straight legs between them, and numbers of steps to the goal.

    Attributes:
        points: (P,) start, goal and places between them.
        heading: heading of the puppet at the goal, complex of length 1.
        obstacles: obstacles that stand on the stage.
        radius: radius of the puppet [m].
        longest_step: longest step [m].
        pauses: steps before and after each leg in which the puppet stands.
    """

    points: Complex
    heading: complex
    obstacles: Sequence[Region]
    radius: float
    longest_step: float
    pauses: tuple[int, int]

    @classmethod
    def build(
        cls,
        start_and_goal: Complex,
        heading: complex,
        places: Complex,
        obstacles: Sequence[Region],
        space: Rectangle,
        radius: float,
        longest_step: float,
        pauses: tuple[int, int],
    ) -> Roadmap:
        """Roadmap of the free places among those given."""
        corners = [region.corners(radius + CORNER_MARGIN) for region in obstacles]
        all_places = np.concatenate([places, *corners])
        all_places = all_places[space.holds(all_places)]
        for region in obstacles:
            all_places = all_places[region.distance(all_places) >= radius - CLEARANCE_TOLERANCE]
        points = start_and_goal
        for place in all_places:
            if np.min(np.abs(points - place)) > _MERGE_DISTANCE:
                points = np.append(points, place)
        return cls(points, heading, obstacles, radius, longest_step, pauses)

    @cached_property
    def clear_legs(self) -> list[Mask]:
        """(P, P) for each obstacle, whether legs keep clear of it."""
        starts, ends = np.broadcast_arrays(self.points[:, None], self.points)
        return [
            region.distance_of_legs(starts, ends) >= self.radius - CLEARANCE_TOLERANCE
            for region in self.obstacles
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
        """(P, P) steps of legs, with their pauses; infinite where an obstacle blocks them."""
        size = np.abs(self._legs)
        n_steps = np.maximum(np.ceil(size / self.longest_step - 1e-9), 1.0) + sum(self.pauses)
        is_clear = np.logical_and.reduce([size > CLEARANCE_TOLERANCE, *self.clear_legs])
        return np.where(is_clear, n_steps, np.inf)

    @cached_property
    def costs(self) -> Array:
        """(P, P) costs of legs: steps, and a little for each metre."""
        return self.steps + METRE_COST * np.abs(self._legs)

    @cached_property
    def cost_to_goal(self) -> Array:
        """(P, P) V(i, j): costs from j to the goal, for a puppet that came from i."""
        n_points = len(self.points)
        to_goal = np.full((n_points, n_points), np.inf)
        final_turn = turn_steps(self.directions[:, GOAL], np.array(self.heading), self.pauses)
        final_turn = final_turn + TURN_COST * (final_turn > 0.0)
        to_goal[:, GOAL] = np.where(np.isfinite(self.steps[:, GOAL]), final_turn, np.inf)
        by_distance = np.argsort(np.abs(self._legs[GOAL]), kind="stable")
        neighbours = [np.flatnonzero(np.isfinite(self.steps[:, j])) for j in range(n_points)]
        # A step that turns or stands separates two legs in a row, so that no leg is counted twice.
        corner_costs = [
            np.maximum(
                turn_steps(
                    self.directions[neighbours[j], j][:, None],
                    self.directions[j, neighbours[j]],
                    self.pauses,
                ),
                1.0,
            )
            + TURN_COST
            for j in range(n_points)
        ]
        is_changed = np.ones(n_points, dtype=bool)
        while np.any(is_changed):
            is_changed_now = np.zeros(n_points, dtype=bool)
            for j in by_distance:
                neighbours_of_point = neighbours[j]
                if j == GOAL or not np.any(
                    is_changed[neighbours_of_point] | is_changed_now[neighbours_of_point]
                ):
                    continue
                costs = (
                    corner_costs[j]
                    + self.costs[j, neighbours_of_point]
                    + to_goal[j, neighbours_of_point]
                )
                least_costs = np.min(costs, axis=1, initial=np.inf)
                if np.any(least_costs < to_goal[neighbours_of_point, j]):
                    to_goal[neighbours_of_point, j], is_changed_now[j] = least_costs, True
            is_changed = is_changed_now
        return to_goal

    def reached(self, leg_masks: Sequence[Mask]) -> Mask:
        """(P,) bool, points reached from the start by legs that are free in all masks (P, P)."""
        is_clear = np.logical_and.reduce([np.ones(self._legs.shape, dtype=bool), *leg_masks])
        is_reached = np.zeros(len(self.points), dtype=bool)
        is_reached[START] = True
        while True:
            extended = is_reached | np.any(is_clear[is_reached], axis=0)
            if np.array_equal(extended, is_reached):
                return is_reached
            is_reached = extended
