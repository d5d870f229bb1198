"""Stage around a puppet that walks: obstacles and other players."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fantoccini.base import Mask
from fantoccini.theatre.cast import Footing, Way
from fantoccini.theatre.gestures import Complex, Step
from fantoccini.theatre.ways.regions import Disk, Rectangle, Region
from fantoccini.theatre.ways.roadmap import CLEARANCE_TOLERANCE, Roadmap, spread_places, turn_steps
from fantoccini.theatre.ways.search import Leg, Search
from fantoccini.theatre.ways.traffic import SAMPLE, Other, Traffic

HORIZON = 120
"""Largest number of steps for which a puppet waits, at its start and on its way."""
MAX_INTRUSION = 1e-5
"""Largest shortfall of the distance of two passing players, between samples [m]."""
_N_PATH_POINTS = 8
"""Number of points of another player's path that have places at both sides, to make way for it."""
_MOVING_MARGIN = 2e-3
"""Distance of turning points from moving players, in addition to the clearance [m]; more than the
margin of the clearance for the time between samples."""
_PASS_FACTOR = 1.1
"""Distance of those places from the path, relative to that at which two players pass."""


class Near(NamedTuple):
    """Obstacle or player that is too near to a place.

    Attributes:
        name: its name.
        distance: distance of the place from its border, below 0 inside [m].
        needed: least distance [m].
    """

    name: str
    distance: float
    needed: float


class Stage:
    """Stage around a puppet that walks.

    Attributes:
        start, begin, step_time, longest_step, radius, blocked: see ``find_way``.
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
        others: Sequence[Other],
        space: Rectangle | None,
    ):
        self.start, self.begin, self.step_time = start, begin, step_time
        self.longest_step, self.radius, self.blocked = longest_step, radius, blocked
        still = [other.at_rest() for other in others if other.last_motion() <= begin]
        self.standing: list[Region] = [*blocked, *still]
        self.movers = [other for other in others if other.last_motion() > begin]
        self.space = Rectangle((-np.inf, -np.inf), (np.inf, np.inf)) if space is None else space

    # -- checks ------------------------------------------------------------------------------

    def too_near(self, place: complex, t: float) -> Near | None:
        """Obstacle or player too near to a place at a time [s]; None if the place is free."""
        for region in self.standing:
            distance = float(region.distance(np.array(place)))
            if distance < self.radius - CLEARANCE_TOLERANCE:
                return Near(region.name, distance, self.radius)
        for other in self.movers:
            distance = float(abs(other.at(np.array(t)) - place)) - other.radius
            if distance < self.radius - MAX_INTRUSION:
                return Near(other.name, distance, self.radius)
        return None

    def is_free(self, places: Complex) -> Mask:
        """(n,) bool, whether places are free once all players stand."""
        free = self.space.holds(places)
        for mover in self.final_regions:
            free &= mover.distance(places) >= self.radius - CLEARANCE_TOLERANCE
        return free

    @property
    def final_regions(self) -> list[Region]:
        """Obstacles and players once all players stand."""
        return [*self.standing, *(mover.at_rest() for mover in self.movers)]

    def are_open(self, standing: Sequence[Region], first: Complex, last: Complex) -> Mask:
        """(...) whether straight legs (...) keep clear of standing obstacles."""
        free = np.ones(first.shape, dtype=bool)
        for region in standing:
            free &= region.distance_of_legs(first, last) >= self.radius - CLEARANCE_TOLERANCE
        return free

    def is_clear(self, way: Way) -> bool:
        """Whether a way keeps clear of everything until all other players stand."""
        end = max([way.end, *(mover.last_motion() for mover in self.movers)])
        n = int(np.ceil((end - self.begin) / SAMPLE)) + 1
        t = np.linspace(self.begin, max(end, self.begin + SAMPLE), n + 1)
        xy, _ = way.footing(t)
        places = xy[:, 0] + 1j * xy[:, 1]
        margins = [region.distance(places) - self.radius for region in self.standing]
        margins += [
            np.abs(mover.at(t) - places) - self.radius - mover.radius for mover in self.movers
        ]
        return bool(np.all(self.space.holds(places))) and all(
            np.min(x) >= -MAX_INTRUSION for x in margins
        )

    def waits(self, way: Way) -> int:
        """Number of steps for which the puppet waits before a way and on it."""
        delay = round((way.begin - self.begin) / self.step_time)
        return delay + sum(step.stands for step in way.steps)

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
        )

    def way(self, goal: Footing, latest_begin: float) -> Way | None:
        """Way with the earliest arrival, with waits of any length; None if there is none."""
        roadmap = self.roadmap(goal)
        ends = (self.start.place, goal.place)
        traffic = Traffic(self.movers, self.begin, self.step_time, self.radius, ends)
        legs = Search(roadmap, traffic).run(complex(np.exp(1j * self.start.heading)))
        if legs is None:
            return None
        way = self._way_along(goal, roadmap, legs, latest_begin)
        return way if self.is_clear(way) else None

    def _places(self, ends: Complex) -> Complex:
        """Turning points of ways: places beside players, their paths and spread over the stage."""
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
        low = np.array([outline.real.min() - margin, outline.imag.min() - margin])
        high = np.array([outline.real.max() + margin, outline.imag.max() + margin])
        low, high = np.maximum(low, self.space.low), np.minimum(high, self.space.high)
        area = Rectangle((low[0], low[1]), (high[0], high[1]))
        return np.concatenate([places, spread_places(area)])

    def _way_along(self, goal: Footing, roadmap: Roadmap, legs: list[Leg], latest: float) -> Way:
        """Way along legs; steps at its start that only stand become a later beginning."""
        steps: list[Step] = []
        place, heading, step_index = self.start.place, self.start.heading, 0
        for leg in legs:
            to = complex(roadmap.points[leg.to])
            steps += [Step()] * (leg.departs - leg.turns - step_index)
            turn = _turn(heading, float(np.angle(to - place)), leg.turns)
            steps += turn + [Step(abs(to - place) / leg.steps)] * leg.steps
            heading += sum(step.turn for step in turn)
            place, step_index = to, leg.departs + leg.steps
        steps += _turn(heading, goal.heading, _n_turn_steps(heading, goal.heading))
        max_delay = int(np.floor((latest - self.begin) / self.step_time + 1e-9))
        n_delay = 0
        while n_delay < min(max_delay, len(steps)) and steps[n_delay].stands:
            n_delay += 1
        begin = self.begin + n_delay * self.step_time
        return Way(self.start, begin, tuple(steps[n_delay:]), self.step_time)


def _n_turn_steps(heading: float, to: float) -> int:
    """Number of steps to turn between two headings [rad]."""
    return int(turn_steps(np.exp(1j * np.array(heading)), np.exp(1j * np.array(to))))


def _turn(heading: float, to: float, n: int) -> list[Step]:
    """n equal steps of a turn between two headings [rad], in the shorter direction."""
    angle = float(np.angle(np.exp(1j * (to - heading))))
    return [Step(0.0, angle / n)] * n if n else []
