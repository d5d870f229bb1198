"""Earliest path over a roadmap past moving players: A* over places and their free intervals.

A state is a place, the heading with which the puppet came, and the time until which the place
stays free. An earlier arrival in the same free interval can wait, so that only the earliest counts
(safe-interval path planning, Phillips and Likhachev 2011). The heuristic is the cost of the
remaining path past standing obstacles, with its turns; it is exact without other players.

A leg is a straight part of a path. A* continues at every step from the state with the least sum of
its cost so far and the heuristic, an estimate of the remaining cost.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field
from itertools import count

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.theatre.pathfinding.roadmap import GOAL, START, TURN_COST, Roadmap, turn_steps
from fantoccini.theatre.pathfinding.traffic import NEVER, Traffic

_MAX_STATES = 20000
"""Largest number of states to examine."""


@dataclass(frozen=True)
class Leg:
    """Straight part of a path, between two points.

    Attributes:
        end_point: index of the point at its end.
        n_turn_steps: number of steps that turn the puppet before it.
        departure_step: index of its first step, after the turns.
        n_steps: number of steps, with its pauses.
    """

    end_point: int
    n_turn_steps: int
    departure_step: int
    n_steps: int


@dataclass(frozen=True, eq=False)
class _Visit:
    """Stay at a point, from a step until the first one in which the point is no longer free."""

    point: int
    heading: complex
    arrival_step: int
    occupied_step: int
    cost: float
    leg: Leg | None = None
    previous: _Visit | None = None


@dataclass(eq=False)
class _Departures:
    """Legs from a visit that remain to be tried: end points, the most promising first."""

    visit: _Visit
    end_points: Indices
    n_turn_steps: Array
    earliest_steps: Array
    costs: Array
    next_index: int = 0


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
    _occupied_steps: dict[int, Indices] = field(default_factory=dict)
    _best_arrivals: dict[tuple[int, int], list[tuple[float, complex]]] = field(default_factory=dict)

    def run(self, heading: complex) -> list[Leg] | None:
        """Legs of the earliest path to the goal; None if no path exists.

        Args:
            heading: heading at the start, complex of length 1.
        """
        first = _Visit(START, heading, 0, self._free_until(START, 0), 0.0)
        if abs(self.roadmap.points[GOAL] - self.roadmap.points[START]) < 1e-9 and (
            first.occupied_step == NEVER
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
                if visit.point == GOAL and visit.occupied_step == NEVER:
                    return _legs(visit)
                self._queue_departures(visit)
        return None

    def _push(self, f: float, entry: _Departures | _Arrival) -> None:
        heapq.heappush(self._queue, (f, next(self._serial), entry))

    def _free_until(self, point: int, step: int) -> int:
        """First step, at or after a given one, in which a point is not free."""
        if point not in self._occupied_steps:
            self._occupied_steps[point] = self.traffic.occupied_steps(
                complex(self.roadmap.points[point])
            )
        steps = self._occupied_steps[point]
        return int(steps[min(step, len(steps) - 1)])

    def _queue_departures(self, visit: _Visit) -> None:
        """Queues the legs from a visit."""
        point, roadmap = visit.point, self.roadmap
        n_turn_steps = turn_steps(
            np.array(visit.heading), roadmap.directions[point], roadmap.pauses
        )
        n_lead_steps = n_turn_steps if visit.leg is None else np.maximum(n_turn_steps, 1.0)
        costs = visit.cost + n_lead_steps + TURN_COST * (n_lead_steps > 0.0) + roadmap.costs[point]
        f = costs + roadmap.cost_to_goal[point]
        f = np.where(visit.arrival_step + n_lead_steps <= visit.occupied_step, f, np.inf)
        order = np.argsort(f, kind="stable")
        order = order[np.isfinite(f[order])]
        if len(order):
            departures = _Departures(
                visit, order, n_turn_steps, visit.arrival_step + n_lead_steps, costs
            )
            self._push(float(f[order[0]]), departures)

    def _depart(self, f: float, departures: _Departures) -> None:
        """Queues the next leg at its earliest departure, and the other ones for later."""
        visit, end_point = departures.visit, int(departures.end_points[departures.next_index])
        start_point = visit.point
        departures.next_index += 1
        if departures.next_index < len(departures.end_points):
            next_point = departures.end_points[departures.next_index]
            cost = departures.costs[next_point] + self.roadmap.cost_to_goal[start_point, next_point]
            self._push(float(cost), departures)
        earliest = int(departures.earliest_steps[end_point])
        self._queue_arrival(
            f,
            departures.costs[end_point],
            visit,
            end_point,
            int(departures.n_turn_steps[end_point]),
            earliest,
            earliest,
        )

    def _queue_arrival(
        self,
        f: float,
        cost: float,
        visit: _Visit,
        end_point: int,
        n_turn_steps: int,
        earliest: int,
        assumed_departure: int,
    ) -> None:
        """Queues the arrival of the first possible departure at or after step ``earliest``.

        ``f`` and ``cost`` are those of a departure at step ``assumed_departure``.
        """
        points, n_steps = self.roadmap.points, int(self.roadmap.steps[visit.point, end_point])
        departure = self.traffic.departures(
            complex(points[visit.point]),
            complex(points[end_point]),
            n_steps,
            earliest,
            visit.occupied_step,
        )
        if departure != NEVER:
            delay = departure - assumed_departure
            self._push(
                f + delay,
                _Arrival(visit, Leg(end_point, n_turn_steps, departure, n_steps), cost + delay),
            )

    def _arrive(self, f: float, arrival: _Arrival) -> _Visit | None:
        """Visit at the end of a leg; None if an earlier one is as good."""
        visit, leg, end_point = arrival.visit, arrival.leg, arrival.leg.end_point
        arrival_step = leg.departure_step + leg.n_steps
        occupied_step = self._free_until(end_point, arrival_step)
        if occupied_step != NEVER:
            next_departure = max(leg.departure_step + 1, occupied_step + 1 - leg.n_steps)
            self._queue_arrival(
                f,
                arrival.cost,
                visit,
                end_point,
                leg.n_turn_steps,
                next_departure,
                leg.departure_step,
            )
        heading = complex(self.roadmap.directions[visit.point, end_point])
        earlier_arrivals = self._best_arrivals.setdefault((end_point, occupied_step), [])
        if earlier_arrivals:
            costs, headings = (np.array(x) for x in zip(*earlier_arrivals, strict=True))
            n_turn_steps = turn_steps(headings, np.array(heading), self.roadmap.pauses)
            if np.any(costs + n_turn_steps <= arrival.cost + 1e-12):
                return None
        earlier_arrivals.append((arrival.cost, heading))
        return _Visit(end_point, heading, arrival_step, occupied_step, arrival.cost, leg, visit)


def _legs(visit: _Visit | None) -> list[Leg]:
    """Legs that lead to a visit, in order."""
    legs: list[Leg] = []
    while visit is not None and visit.leg is not None:
        legs.append(visit.leg)
        visit = visit.previous
    return legs[::-1]
