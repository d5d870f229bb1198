"""Makes plans shorter and brings them to their goal; see :mod:`fantoccini.planning.descent`."""

from __future__ import annotations

import enum
import itertools
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.planning.descent import brought
from fantoccini.planning.problem import Problem
from fantoccini.planning.shooting import Candidates, Shooting
from fantoccini.runtime import UNKNOWN, Segments

_TIMES = (0.85, 1.0)
"""Of a plan's duration, that are tried at first."""

_EARLY = 0.2
"""Part of the time, for each of them."""

_LONGER = (0.0, 0.5, 1.0, 2.0, 4.0)
"""Seconds for which it is led on until its end can be brought to the goal."""

_FEWER = 0.15
"""Part of its segments by which it is shortened then at once, at most."""


class PolishStatus(enum.Enum):
    """What came of polishing a plan."""

    POLISHED = "it ends as near to the goal as was asked"
    NO_BETTER = "the plan is as it was: nothing that ends so near costs less"
    NOT_NEAR = "the plan is as it was: no way near it ends so near to the goal within all bounds"
    TIMEOUT = "the plan is as it was: the time ended before it was brought so near to the goal"
    NOT_HELD = "the plan is as it was: what was made of it does not hold event-driven"
    INTERRUPTED = "the plan is as it was: it was interrupted before anything was found"
    NO_MOTION = "the plan is as it was: it has no motion"
    UNKNOWN_GOAL = "the plan is as it was: its goal is a function, of which nothing is known"

    @property
    def message(self) -> str:
        """In words."""
        return self.value


@dataclass(frozen=True)
class Polish:
    """What came of polishing a plan.

    Attributes:
        status: whether it helped, and why not.
        asked: the distance from the goal that was near enough.
        nearest: that of the way that came nearest to it; nan where none could be made.
        broken: what that one breaks: ``clearance``, ``limits``, ``tension``; ``equilibrium`` where
            the puppet would not stay.
    """

    status: PolishStatus
    asked: float
    nearest: float = math.nan
    broken: tuple[str, ...] = ()

    @classmethod
    def of(cls, plain: list | None) -> Polish | None:
        """From what ``plain`` gave."""
        if plain is None:
            return None
        status, asked, nearest, broken = plain
        return cls(PolishStatus[status], float(asked), float(nearest), tuple(map(str, broken)))

    @property
    def plain(self) -> list:
        """As plain data."""
        return [self.status.name, self.asked, self.nearest, list(self.broken)]

    @property
    def reached(self) -> bool:
        """Whether the plan ends as near to the goal as was asked."""
        return self.status in (PolishStatus.POLISHED, PolishStatus.NO_BETTER)

    def __str__(self) -> str:
        text = f"{self.status.message} (asked: {self.asked:.3g}"
        if not self.reached and not math.isnan(self.nearest):
            text += f"; nearest: {self.nearest:.3g}"
            text += f", at the cost of {' and '.join(self.broken)}" if self.broken else ""
        return text + ")"


class Polisher:
    """Makes plans of a problem shorter, and ends them at the goal.

    Attributes:
        nearest: the way with the least merit that does not end at the goal; None without any.
        late: whether the time ended before a plan was brought to the goal.

    Args:
        problem: what was planned.

    Raises:
        ValueError: the goal is a function, of which nothing is known.
    """

    def __init__(self, problem: Problem):
        if problem.goal.numbers.kind == UNKNOWN:
            raise ValueError("a plan to a goal that is a function cannot be polished")
        self._problem, self._shooting = problem, Shooting(problem)
        self._strict = problem.rollouts.where(tolerance=-1.0)
        self.nearest: Candidates | None = None
        self.late = False

    def __call__(
        self,
        acceleration: Array,
        looks: Array,
        distance: float,
        seconds: float,
        limit: float = np.inf,
        *,
        shorter: bool = True,
    ) -> Iterator[Segments]:
        """Plans that end at the goal, one motion each; every one is shorter than that before.

        Args:
            acceleration: (m, n_vK) of a plan's segments.
            looks: (m,) that they last.
            distance: that is near enough.
            seconds: how long to look for shorter ones.
            limit: after which it is given up where none comes so near [s].
            shorter: whether shorter ones are wanted.
        """
        began = time.perf_counter()
        V, until, end = self._whole(acceleration, looks), began + seconds, began + limit
        sizes = [max(1, round(x * len(V))) for x in _TIMES if shorter or x >= 1.0]
        V = self._shooting.within(V)
        tries = itertools.chain(
            ((self._in_segments(V, m), False) for m in sizes),
            ((self._shooting.led(V, round(s / self._shooting.segment)), True) for s in _LONGER),
        )
        early = itertools.takewhile(lambda _: time.perf_counter() < end, tries)
        self.nearest, self.late = None, True
        found = (
            self._brought(one, distance, end if late else self._soon(limit), late)
            for one, late in early
        )
        best = next((way for way in found if way is not None), None)
        self.late = time.perf_counter() >= end
        if best is None:
            return
        yield self._made(best)
        fewer = round(_FEWER * len(best)) if shorter else 0
        while fewer and time.perf_counter() < until:
            m = max(1, len(best) - fewer)
            way = self._brought(self._in_segments(best.V[0], m), distance, until)
            if way is None:
                fewer //= 2
            else:
                best, fewer = way, min(fewer, round(_FEWER * m))
                yield self._made(best)

    @staticmethod
    def _soon(limit: float) -> float:
        """Until when the whole of a plan is varied at first: its last part is sure, and quick."""
        return time.perf_counter() + _EARLY * limit

    def _brought(
        self, V: Array, distance: float, until: float, late: bool = False
    ) -> Candidates | None:
        """A way near velocities (m, n_vK) that ends at the goal with nothing in its way."""
        made = brought(self._shooting, V, lambda way: self._there(way, distance), until, late)
        if made.arrives:
            return made.way
        if made.way is not None and not (
            self.nearest is not None and self.nearest.merit[0] <= made.way.merit[0]
        ):
            self.nearest = made.way
        return None

    def outcome(self, status: PolishStatus, asked: float) -> Polish:
        """What came of it, with how near the last plan's ways came."""
        if self.nearest is None:
            return Polish(status, asked)
        broken = self._shooting.broken(self.nearest)
        if not self._shooting.stays(self.nearest):
            broken += ("equilibrium",)
        return Polish(status, asked, float(self.nearest.distance[0]), broken)

    def _there(self, way: Candidates, distance: float) -> bool:
        """Whether a way ends at the goal, within all bounds."""
        there = way.distance[0] <= distance and self._shooting.stays(way)
        return bool(there and self._made(way).distance[0, -1] <= distance)

    def _made(self, way: Candidates) -> Segments:
        """A way, ended by what is in its way."""
        acceleration = self._shooting.accelerations(way.V)
        return self._strict.simulate(self._problem.root, np.zeros(1, int), acceleration)

    def _whole(self, acceleration: Array, looks: Array) -> Array:
        """The same ways in segments of the usual duration; the last one may last longer."""
        lasts = looks * self._problem.rollouts.options.interval
        times = np.concatenate([[0.0], np.cumsum(lasts)])
        first = self._problem.root.v_K
        V = np.concatenate([first, first + np.cumsum(acceleration * lasts[:, None], axis=0)])
        segment = self._shooting.segment
        at = segment * np.arange(1, math.ceil(times[-1] / segment - 1e-9) + 1)
        return np.stack([np.interp(at, times, column) for column in V.T], axis=1)

    def _in_segments(self, V: Array, m: int) -> Array:
        """(m, n_vK) velocities that lead along the same ways in m segments."""
        scale = len(V) / m
        at, there = scale * np.arange(1, m + 1), np.arange(len(V) + 1)
        V = np.concatenate([self._problem.root.v_K, V])
        return scale * np.stack([np.interp(at, there, column) for column in V.T], axis=1)
