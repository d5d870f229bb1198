"""Stage around a puppet that walks: obstacles and other players.

A leg is a straight part of a path. Every player is a disk, seen from above. The heading is the
angle of the forward direction, seen from above.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fantoccini.base import Mask
from fantoccini.theatre.cast import Footing, Walk
from fantoccini.theatre.gestures import Complex, Step
from fantoccini.theatre.pathfinding.regions import Disk, Rectangle, Region
from fantoccini.theatre.pathfinding.roadmap import (
    CLEARANCE_TOLERANCE,
    Roadmap,
    spread_places,
    turn_steps,
)
from fantoccini.theatre.pathfinding.search import Leg, Search
from fantoccini.theatre.pathfinding.traffic import MAX_SAMPLE_INTERVAL, OtherPlayer, Traffic

HORIZON = 120
"""Largest number of steps for which a puppet waits, at its start and on its walk."""
MAX_INTRUSION = 1e-5
"""Largest shortfall of the distance of two passing players, between samples [m]."""
_N_PATH_POINTS = 8
"""Number of points of another player's path with places at both sides, to step aside for it."""
_MOVING_MARGIN = 2e-3
"""Distance of turning points from moving players, in addition to the clearance [m]; more than the
margin of the clearance for the time between samples."""
_PASS_FACTOR = 1.1
"""Distance of those places from the path, relative to that at which two players pass."""


class NearObstruction(NamedTuple):
    """Obstacle or player that is too near to a place.

    Attributes:
        name: its name.
        distance: distance of the place from its border, below 0 inside [m].
        needed: least distance [m].
    """

    name: str
    distance: float
    needed: float


class WalkProblem:
    """Stage around a puppet that walks.

    Attributes:
        start, begin, step_time, longest_step, radius, blocked, pauses: see ``plan_walk``.
        standing: obstacles, and players that do not move after the beginning.
        movers: players that move.
        space: bounds of the puppet's middle.
    """

    def __init__(
        self,
        start: Footing,
        begin: float,
        step_time: float,
        longest_step: float,
        radius: float,
        blocked: Sequence[Region],
        others: Sequence[OtherPlayer],
        space: Rectangle | None,
        pauses: tuple[int, int],
    ):
        self.start, self.begin, self.step_time = start, begin, step_time
        self.longest_step, self.radius, self.blocked = longest_step, radius, blocked
        self.pauses = pauses
        standing_players = [other.at_rest() for other in others if other.last_motion() <= begin]
        self.standing: list[Region] = [*blocked, *standing_players]
        self.movers = [other for other in others if other.last_motion() > begin]
        self.space = Rectangle((-np.inf, -np.inf), (np.inf, np.inf)) if space is None else space

    # -- checks ------------------------------------------------------------------------------

    def too_near(self, place: complex, t: float) -> NearObstruction | None:
        """Obstacle or player too near to a place at a time [s]; None if the place is free."""
        for region in self.standing:
            distance = float(region.distance(np.array(place)))
            if distance < self.radius - CLEARANCE_TOLERANCE:
                return NearObstruction(region.name, distance, self.radius)
        for other in self.movers:
            distance = float(abs(other.at(np.array(t)) - place)) - other.radius
            if distance < self.radius - MAX_INTRUSION:
                return NearObstruction(other.name, distance, self.radius)
        return None

    def is_free(self, places: Complex) -> Mask:
        """(n,) bool, whether places are free once all players stand."""
        is_free = self.space.holds(places)
        for region in self.final_regions:
            is_free &= region.distance(places) >= self.radius - CLEARANCE_TOLERANCE
        return is_free

    @property
    def final_regions(self) -> list[Region]:
        """Obstacles and players once all players stand."""
        return [*self.standing, *(mover.at_rest() for mover in self.movers)]

    def are_legs_clear(self, standing: Sequence[Region], starts: Complex, ends: Complex) -> Mask:
        """(...) whether straight legs (...) keep clear of standing obstacles."""
        is_clear = np.ones(starts.shape, dtype=bool)
        for region in standing:
            is_clear &= region.distance_of_legs(starts, ends) >= self.radius - CLEARANCE_TOLERANCE
        return is_clear

    def is_clear(self, walk: Walk) -> bool:
        """Whether a walk keeps clear of everything until all other players stand."""
        end = max([walk.end, *(mover.last_motion() for mover in self.movers)])
        n = int(np.ceil((end - self.begin) / MAX_SAMPLE_INTERVAL)) + 1
        t = np.linspace(self.begin, max(end, self.begin + MAX_SAMPLE_INTERVAL), n + 1)
        xy, _ = walk.footing(t)
        places = xy[:, 0] + 1j * xy[:, 1]
        margins = [region.distance(places) - self.radius for region in self.standing]
        margins += [
            np.abs(mover.at(t) - places) - self.radius - mover.radius for mover in self.movers
        ]
        return bool(np.all(self.space.holds(places))) and all(
            np.min(x) >= -MAX_INTRUSION for x in margins
        )

    def n_waiting_steps(self, walk: Walk) -> int:
        """Number of steps for which the puppet waits before a walk and during it."""
        n_delay = round((walk.begin - self.begin) / self.step_time)
        n_paused = sum(self.pauses) * len(walk.straight_parts)
        return n_delay + sum(step.stands for step in walk.steps) - n_paused

    # -- ways --------------------------------------------------------------------------------

    def roadmap(self, goal: Footing) -> Roadmap:
        """Places between the start and a goal."""
        heading = complex(np.exp(1j * goal.heading))
        ends = np.array([self.start.place, goal.place])
        return Roadmap.build(
            ends,
            heading,
            self._places(ends),
            self.standing,
            self.space,
            self.radius,
            self.longest_step,
            self.pauses,
        )

    def find_walk(self, goal: Footing, latest_begin: float) -> Walk | None:
        """Walk with the earliest arrival, with waits of any length; None if there is none."""
        roadmap = self.roadmap(goal)
        ends = (self.start.place, goal.place)
        traffic = Traffic(self.movers, self.begin, self.step_time, self.radius, ends, self.pauses)
        legs = Search(roadmap, traffic).run(complex(np.exp(1j * self.start.heading)))
        if legs is None:
            return None
        walk = self._walk_along(goal, roadmap, legs, latest_begin)
        return walk if self.is_clear(walk) else None

    def _places(self, ends: Complex) -> Complex:
        """Turning points of walks: next to players and their paths, and spread over the stage."""
        groups = [ends]
        for other in self.movers:
            pass_distance = self.radius + other.radius
            t = np.linspace(self.begin, other.last_motion(), _N_PATH_POINTS)
            path = other.at(t)
            tangent = np.gradient(path)
            normal = 1j * tangent / np.maximum(np.abs(tangent), np.finfo(float).tiny)
            groups += [path + side * _PASS_FACTOR * pass_distance * normal for side in (-1.0, 1.0)]
            for place in (path[0], path[-1]):
                disk = Disk(other.name, (place.real, place.imag), other.radius)
                groups.append(disk.corners(self.radius + _MOVING_MARGIN))
        places = np.concatenate(groups)
        corners = [region.corners(self.radius) for region in self.standing]
        outline = np.concatenate([places, *corners])
        margin = 2.0 * self.radius
        lower = np.array([outline.real.min() - margin, outline.imag.min() - margin])
        upper = np.array([outline.real.max() + margin, outline.imag.max() + margin])
        lower, upper = np.maximum(lower, self.space.lower), np.minimum(upper, self.space.upper)
        area = Rectangle((lower[0], lower[1]), (upper[0], upper[1]))
        return np.concatenate([places, spread_places(area)])

    def _walk_along(
        self, goal: Footing, roadmap: Roadmap, legs: list[Leg], latest_begin: float
    ) -> Walk:
        """Walk along legs; steps at its start that only stand become a later beginning."""
        steps: list[Step] = []
        before, after = self.pauses
        place, heading, step_index = self.start.place, self.start.heading, 0
        for leg in legs:
            end = complex(roadmap.points[leg.end_point])
            steps += [Step()] * (leg.departure_step - leg.n_turn_steps - step_index)
            turn_steps_of_leg = _turn_steps(heading, float(np.angle(end - place)), leg.n_turn_steps)
            n_steps = leg.n_steps - before - after
            steps += turn_steps_of_leg + [Step()] * before
            steps += [Step(abs(end - place) / n_steps)] * n_steps + [Step()] * after
            heading += sum(step.turn for step in turn_steps_of_leg)
            place, step_index = end, leg.departure_step + leg.n_steps
        headings: Complex = np.exp(1j * np.array([heading, goal.heading]))
        n_last_steps = int(turn_steps(headings[:1], headings[1:], self.pauses)[0])
        steps += _turn_steps(heading, goal.heading, n_last_steps)
        max_delay = int(np.floor((latest_begin - self.begin) / self.step_time + 1e-9))
        n_waiting = legs[0].departure_step - legs[0].n_turn_steps if legs else 0
        n_delay = min(max_delay, n_waiting)
        begin = self.begin + n_delay * self.step_time
        return Walk(self.start, begin, tuple(steps[n_delay:]), self.step_time, self.pauses)


def _turn_steps(heading: float, new_heading: float, n: int) -> list[Step]:
    """n equal steps of a turn between two headings [rad], in the shorter direction."""
    angle = float(np.angle(np.exp(1j * (new_heading - heading))))
    return [Step(0.0, angle / n)] * n if n else []
