"""Earliest way over a roadmap past moving players: A* over places and their free intervals.

A state is a place, the heading with which the puppet came, and the time until which the place
stays free. An earlier arrival in the same free interval can wait, so that only the earliest counts
(safe-interval path planning, Phillips and Likhachev 2011). The heuristic is the cost of the
remaining way past standing obstacles, with its turns; it is exact without other players.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field
from itertools import count

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.theatre.ways.roadmap import GOAL, START, TURN_COST, Roadmap, turn_steps
from fantoccini.theatre.ways.traffic import NEVER, Traffic

_MAX_STATES = 20000
"""Largest number of states to examine."""


@dataclass(frozen=True)
class Leg:
    """Straight way between two points.

    Attributes:
        to: index of the point at its end.
        turns: number of steps that turn the puppet before it.
        departs: index of its first step, after the turns.
        steps: number of steps.
    """

    to: int
    turns: int
    departs: int
    steps: int


@dataclass(frozen=True, eq=False)
class _Visit:
    """Stay at a point, from a step until the first one in which the point is no longer free."""

    point: int
    heading: complex
    since: int
    until: int
    cost: float
    leg: Leg | None = None
    before: _Visit | None = None


@dataclass(eq=False)
class _Departures:
    """Legs from a visit that remain to be tried: end points, the most promising first."""

    visit: _Visit
    points: Indices
    turns: Array
    earliest: Array
    costs: Array
    next: int = 0


@dataclass(frozen=True, eq=False)
class _Arrival:
    """End of a leg that was begun at a visit."""

    visit: _Visit
    leg: Leg
    cost: float


@dataclass(eq=False)
class Search:
    """Search from the start to the goal.

    Attributes:
        roadmap, traffic: standing obstacles and moving players.
        n_examined: number of states examined.
    """

    roadmap: Roadmap
    traffic: Traffic
    n_examined: int = 0
    _queue: list[tuple[float, int, _Departures | _Arrival]] = field(default_factory=list)
    _serial: count[int] = field(default_factory=count)
    _stays: dict[int, Indices] = field(default_factory=dict)
    _best: dict[tuple[int, int], list[tuple[float, complex]]] = field(default_factory=dict)

    def run(self, heading: complex) -> list[Leg] | None:
        """Legs of the earliest way; None if there is none.

        Args:
            heading: heading at the start, complex of length 1.
        """
        first = _Visit(START, heading, 0, self._free_until(START, 0), 0.0)
        if abs(self.roadmap.points[GOAL] - self.roadmap.points[START]) < 1e-9 and (
            first.until == NEVER
        ):
            return []
        self._queue_departures(first)
        while self._queue and self.n_examined < _MAX_STATES:
            self.n_examined += 1
            f, _, entry = heapq.heappop(self._queue)
            if isinstance(entry, _Departures):
                self._depart(f, entry)
                continue
            visit = self._arrive(f, entry)
            if visit is not None:
                if visit.point == GOAL and visit.until == NEVER:
                    return _legs(visit)
                self._queue_departures(visit)
        return None

    def _push(self, f: float, entry: _Departures | _Arrival) -> None:
        heapq.heappush(self._queue, (f, next(self._serial), entry))

    def _free_until(self, point: int, step: int) -> int:
        """First step, at or after a given one, in which a point is not free."""
        if point not in self._stays:
            self._stays[point] = self.traffic.stays(complex(self.roadmap.points[point]))
        stays = self._stays[point]
        return int(stays[min(step, len(stays) - 1)])

    def _queue_departures(self, visit: _Visit) -> None:
        """Queues the legs from a visit."""
        j, roadmap = visit.point, self.roadmap
        turning = turn_steps(np.array(visit.heading), roadmap.directions[j])
        lead = turning if visit.leg is None else np.maximum(turning, 1.0)
        costs = visit.cost + lead + TURN_COST * (lead > 0.0) + roadmap.costs[j]
        f = costs + roadmap.cost_to_goal[j]
        f = np.where(visit.since + lead <= visit.until, f, np.inf)
        order = np.argsort(f, kind="stable")
        order = order[np.isfinite(f[order])]
        if len(order):
            departures = _Departures(visit, order, turning, visit.since + lead, costs)
            self._push(float(f[order[0]]), departures)

    def _depart(self, f: float, departures: _Departures) -> None:
        """Queues the next leg at its earliest departure, and the other ones for later."""
        visit, k = departures.visit, int(departures.points[departures.next])
        j = visit.point
        departures.next += 1
        if departures.next < len(departures.points):
            following = departures.points[departures.next]
            cost = departures.costs[following] + self.roadmap.cost_to_goal[j, following]
            self._push(float(cost), departures)
        earliest = int(departures.earliest[k])
        self._queue_arrival(
            f, departures.costs[k], visit, k, int(departures.turns[k]), earliest, earliest
        )

    def _queue_arrival(
        self, f: float, cost: float, visit: _Visit, k: int, turning: int, since: int, at: int
    ) -> None:
        """Queues the arrival of the first possible departure at or after step ``since``.

        ``f`` and ``cost`` are those of a departure at step ``at``.
        """
        points, n = self.roadmap.points, int(self.roadmap.steps[visit.point, k])
        departs = self.traffic.departures(
            complex(points[visit.point]), complex(points[k]), n, since, visit.until
        )
        if departs != NEVER:
            later = departs - at
            self._push(f + later, _Arrival(visit, Leg(k, turning, departs, n), cost + later))

    def _arrive(self, f: float, arrival: _Arrival) -> _Visit | None:
        """Visit at the end of a leg; None if an earlier one is as good."""
        visit, leg, k = arrival.visit, arrival.leg, arrival.leg.to
        since = leg.departs + leg.steps
        until = self._free_until(k, since)
        if until != NEVER:
            later = max(leg.departs + 1, until + 1 - leg.steps)
            self._queue_arrival(f, arrival.cost, visit, k, leg.turns, later, leg.departs)
        heading = complex(self.roadmap.directions[visit.point, k])
        known = self._best.setdefault((k, until), [])
        if known:
            costs, headings = (np.array(x) for x in zip(*known, strict=True))
            if np.any(costs + turn_steps(headings, np.array(heading)) <= arrival.cost + 1e-12):
                return None
        known.append((arrival.cost, heading))
        return _Visit(k, heading, since, until, arrival.cost, leg, visit)


def _legs(visit: _Visit | None) -> list[Leg]:
    """Legs that lead to a visit, in order."""
    legs: list[Leg] = []
    while visit is not None and visit.leg is not None:
        legs.append(visit.leg)
        visit = visit.before
    return legs[::-1]
