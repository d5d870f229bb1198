"""Earliest way over a roadmap past moving players: A* over places and their free intervals.

A state is a place, the heading with which the puppet came, and the time until which the place
stays free. An earlier arrival in the same free interval can wait, so that only the earliest counts
(safe-interval path planning, Phillips and Likhachev 2011). The heuristic is the cost of the rest
of the way past standing obstacles, turns included; without other players no search is needed.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field
from itertools import count

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.theatre.ways.roadmap import CORNER, GOAL, START, Roadmap, turns
from fantoccini.theatre.ways.traffic import NEVER, Traffic

_MAX_STATES = 20000
"""Number of states examined before the search gives up."""


@dataclass(frozen=True)
class Leg:
    """A straight way between two points.

    Attributes:
        to: index of the point at its end.
        turns: steps of turning before it.
        departs: step at which it begins, after the turns.
        steps: number of steps.
    """

    to: int
    turns: int
    departs: int
    steps: int


@dataclass(frozen=True, eq=False)
class _Visit:
    """A stay at a point, from a step until the first one in which it is no longer free."""

    point: int
    heading: complex
    since: int
    until: int
    cost: float
    leg: Leg | None = None
    before: _Visit | None = None


@dataclass(eq=False)
class _Onward:
    """Legs from a visit that are still to be tried: end points, the most promising first."""

    visit: _Visit
    points: Indices
    turns: Array
    earliest: Array
    costs: Array
    next: int = 0


@dataclass(frozen=True, eq=False)
class _Arrival:
    visit: _Visit
    leg: Leg
    cost: float


@dataclass(eq=False)
class Search:
    """A search from the start's heading, a unit number, to the goal.

    Attributes:
        roadmap, traffic: standing obstacles and moving players.
        looked: number of states examined.
    """

    roadmap: Roadmap
    traffic: Traffic
    looked: int = 0
    _queue: list[tuple[float, int, _Onward | _Arrival]] = field(default_factory=list)
    _serial: count[int] = field(default_factory=count)
    _stays: dict[int, Indices] = field(default_factory=dict)
    _best: dict[tuple[int, int], list[tuple[float, complex]]] = field(default_factory=dict)

    def run(self, heading: complex) -> list[Leg] | None:
        """Legs of the earliest way; None if there is none."""
        first = _Visit(START, heading, 0, self._until(START, 0), 0.0)
        if abs(self.roadmap.points[GOAL] - self.roadmap.points[START]) < 1e-9 and (
            first.until == NEVER
        ):
            return []
        self._go_on(first)
        while self._queue and self.looked < _MAX_STATES:
            self.looked += 1
            f, _, entry = heapq.heappop(self._queue)
            if isinstance(entry, _Onward):
                self._depart(f, entry)
                continue
            visit = self._arrive(f, entry)
            if visit is not None:
                if visit.point == GOAL and visit.until == NEVER:
                    return _legs(visit)
                self._go_on(visit)
        return None

    def _push(self, f: float, entry: _Onward | _Arrival) -> None:
        heapq.heappush(self._queue, (f, next(self._serial), entry))

    def _until(self, point: int, step: int) -> int:
        if point not in self._stays:
            self._stays[point] = self.traffic.stays(complex(self.roadmap.points[point]))
        stays = self._stays[point]
        return int(stays[min(step, len(stays) - 1)])

    def _go_on(self, visit: _Visit) -> None:
        j, roadmap = visit.point, self.roadmap
        turned = turns(np.array(visit.heading), roadmap.units[j])
        lead = turned if visit.leg is None else np.maximum(turned, 1.0)
        costs = visit.cost + lead + CORNER * (lead > 0.0) + roadmap.costs[j]
        f = costs + roadmap.rest[j]
        f = np.where(visit.since + lead <= visit.until, f, np.inf)
        order = np.argsort(f, kind="stable")
        order = order[np.isfinite(f[order])]
        if len(order):
            onward = _Onward(visit, order, turned, visit.since + lead, costs)
            self._push(float(f[order[0]]), onward)

    def _depart(self, f: float, onward: _Onward) -> None:
        """Queues the next leg at its earliest departure, and the other ones for later."""
        visit, k = onward.visit, int(onward.points[onward.next])
        j = visit.point
        onward.next += 1
        if onward.next < len(onward.points):
            then = onward.points[onward.next]
            self._push(float(onward.costs[then] + self.roadmap.rest[j, then]), onward)
        earliest = int(onward.earliest[k])
        self._send(f, onward.costs[k], visit, k, int(onward.turns[k]), earliest, earliest)

    def _send(
        self, f: float, cost: float, visit: _Visit, k: int, turned: int, since: int, at: int
    ) -> None:
        """Queues the arrival of the first departure since a step; f, cost are those of ``at``."""
        points, n = self.roadmap.points, int(self.roadmap.steps[visit.point, k])
        departs = self.traffic.departures(
            complex(points[visit.point]), complex(points[k]), n, since, visit.until
        )
        if departs != NEVER:
            later = departs - at
            self._push(f + later, _Arrival(visit, Leg(k, turned, departs, n), cost + later))

    def _arrive(self, f: float, arrival: _Arrival) -> _Visit | None:
        """Visit at the end of a leg; None if an earlier one is as good."""
        visit, leg, k = arrival.visit, arrival.leg, arrival.leg.to
        since = leg.departs + leg.steps
        until = self._until(k, since)
        if until != NEVER:
            later = max(leg.departs + 1, until + 1 - leg.steps)
            self._send(f, arrival.cost, visit, k, leg.turns, later, leg.departs)
        heading = complex(self.roadmap.units[visit.point, k])
        known = self._best.setdefault((k, until), [])
        if known:
            costs, headings = (np.array(x) for x in zip(*known, strict=True))
            if np.any(costs + turns(headings, np.array(heading)) <= arrival.cost + 1e-12):
                return None
        known.append((arrival.cost, heading))
        return _Visit(k, heading, since, until, arrival.cost, leg, visit)


def _legs(visit: _Visit | None) -> list[Leg]:
    legs: list[Leg] = []
    while visit is not None and visit.leg is not None:
        legs.append(visit.leg)
        visit = visit.before
    return legs[::-1]
