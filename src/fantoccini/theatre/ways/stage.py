"""The stage around a puppet that is to walk: obstacles and other players."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fantoccini.base import Mask
from fantoccini.theatre.cast import Footing, Way
from fantoccini.theatre.gestures import Complex, Step
from fantoccini.theatre.ways.regions import Disk, Rectangle, Region
from fantoccini.theatre.ways.roadmap import EDGE, Roadmap, lattice, turns
from fantoccini.theatre.ways.search import Leg, Search
from fantoccini.theatre.ways.traffic import SAMPLE, Other, Traffic

HORIZON = 120
"""Largest number of steps for which a puppet waits, at its start and on its way."""
CLOSER = 1e-5
"""Amount by which two passing players may be closer than their radii, between samples [m]."""
_PATH_POINTS = 8
"""Number of points of a path that have places beside them where a puppet can make way."""
_BESIDE_OTHERS = 2e-3
"""Distance of turning points from moving players, in addition to the clearance [m]; more than the
clearance adds for the time between samples."""
_ASIDE = 1.1
"""Distance of the places beside a path from it, relative to that at which two players pass."""


class Near(NamedTuple):
    """An obstacle or another player that is too near to a place.

    Attributes:
        name: its name.
        distance: distance of the place from its border, below 0 inside [m].
        needed: least distance [m].
    """

    name: str
    distance: float
    needed: float


class Stage:
    """The stage around a puppet that walks.

    Attributes:
        start, begin, step_time, longest_step, radius, blocked: see ``find_way``.
        standing: obstacles, and players that do not move from the beginning on.
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
        """An obstacle or player too near to a place at a time [s]; None if it is free."""
        for region in self.standing:
            distance = float(region.distance(np.array(place)))
            if distance < self.radius - EDGE:
                return Near(region.name, distance, self.radius)
        for other in self.movers:
            distance = float(abs(other.at(np.array(t)) - place)) - other.radius
            if distance < self.radius - CLOSER:
                return Near(other.name, distance, self.radius)
        return None

    def is_free(self, places: Complex) -> Mask:
        """(n,) whether places are free once all players have come to rest."""
        free = self.space.holds(places)
        for mover in self.at_last:
            free &= mover.distance(places) >= self.radius - EDGE
        return free

    @property
    def at_last(self) -> list[Region]:
        """Obstacles and players once all players have come to rest."""
        return [*self.standing, *(mover.at_rest() for mover in self.movers)]

    def are_open(self, standing: Sequence[Region], first: Complex, last: Complex) -> Mask:
        """(...) whether straight legs (...) keep clear of standing obstacles."""
        free = np.ones(first.shape, dtype=bool)
        for region in standing:
            free &= region.distance_of_legs(first, last) >= self.radius - EDGE
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
        return bool(np.all(self.space.holds(places))) and all(np.min(x) >= -CLOSER for x in margins)

    def waits(self, way: Way) -> int:
        """Number of steps for which the puppet waits before a way and on it."""
        late = round((way.begin - self.begin) / self.step_time)
        return late + sum(step.stands for step in way.steps)

    # -- ways --------------------------------------------------------------------------------

    def roadmap(self, goal: Footing) -> Roadmap:
        """Places between the start and a goal."""
        heading = complex(np.exp(1j * goal.heading))
        ends = np.array([self.start.place, goal.place])
        return Roadmap.over(
            ends,
            heading,
            self._places(ends),
            self.standing,
            self.space,
            self.radius,
            self.longest_step,
        )

    def way(self, goal: Footing, latest_begin: float) -> Way | None:
        """Way with the earliest arrival, however long it waits; None if there is none."""
        roadmap = self.roadmap(goal)
        ends = (self.start.place, goal.place)
        traffic = Traffic(self.movers, self.begin, self.step_time, self.radius, ends)
        legs = Search(roadmap, traffic).run(complex(np.exp(1j * self.start.heading)))
        if legs is None:
            return None
        way = self._walked(goal, roadmap, legs, latest_begin)
        return way if self.is_clear(way) else None

    def _places(self, ends: Complex) -> Complex:
        """Turning points of ways: places beside players, their paths and spread over the stage."""
        groups = [ends]
        for other in self.movers:
            pass_by = self.radius + other.radius
            t = np.linspace(self.begin, other.last_motion(), _PATH_POINTS)
            path = other.at(t)
            along = np.gradient(path)
            aside = 1j * along / np.maximum(np.abs(along), np.finfo(float).tiny)
            groups += [path + side * _ASIDE * pass_by * aside for side in (-1.0, 1.0)]
            for place in (path[0], path[-1]):
                disk = Disk(other.name, (place.real, place.imag), other.radius)
                groups.append(disk.corners(self.radius + _BESIDE_OTHERS))
        places = np.concatenate(groups)
        seen = np.concatenate([places, *(region.corners(self.radius) for region in self.standing)])
        margin = 2.0 * self.radius
        low = np.array([seen.real.min() - margin, seen.imag.min() - margin])
        high = np.array([seen.real.max() + margin, seen.imag.max() + margin])
        low, high = np.maximum(low, self.space.low), np.minimum(high, self.space.high)
        area = Rectangle((low[0], low[1]), (high[0], high[1]))
        return np.concatenate([places, lattice(area)])

    def _walked(self, goal: Footing, roadmap: Roadmap, legs: list[Leg], latest: float) -> Way:
        """Way along legs; steps at its start that only stand are a later beginning instead."""
        steps: list[Step] = []
        place, heading, step_index = self.start.place, self.start.heading, 0
        for leg in legs:
            to = complex(roadmap.points[leg.to])
            steps += [Step()] * (leg.departs - leg.turns - step_index)
            turned = _turn(heading, float(np.angle(to - place)), leg.turns)
            steps += turned + [Step(abs(to - place) / leg.steps)] * leg.steps
            heading += sum(step.turn for step in turned)
            place, step_index = to, leg.departs + leg.steps
        last = int(_turns(heading, goal.heading))
        steps += _turn(heading, goal.heading, last)
        patience = int(np.floor((latest - self.begin) / self.step_time + 1e-9))
        still = 0
        while still < min(patience, len(steps)) and steps[still].stands:
            still += 1
        begin = self.begin + still * self.step_time
        return Way(self.start, begin, tuple(steps[still:]), self.step_time)


def _turns(heading: float, to: float) -> float:
    return float(turns(np.exp(1j * np.array(heading)), np.exp(1j * np.array(to))))


def _turn(heading: float, to: float, n: int) -> list[Step]:
    """Steps of a turn in the shorter direction, n equal ones."""
    angle = float(np.angle(np.exp(1j * (to - heading))))
    return [Step(0.0, angle / n)] * n if n else []
