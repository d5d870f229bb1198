"""Plans made shorter and brought to their goal, as a whole; see :mod:`fantoccini.plan.descent`."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator

import numpy as np

from fantoccini.arrays import Array
from fantoccini.plan.descent import brought
from fantoccini.plan.problem import Problem
from fantoccini.plan.shooting import Shooting, Ways
from fantoccini.runtime import UNKNOWN, Segments

_TIMES = (0.85, 1.0)
"""Of a plan's duration, that are tried at first."""

_EARLY = 0.2
"""Part of the time, for each of them."""

_LONGER = (0.0, 0.5, 1.0, 2.0, 4.0)
"""Seconds for which it is led on until its end can be brought to the goal."""

_FEWER = 0.15
"""Part of its segments by which it is shortened then at once, at most."""


class Polisher:
    """Makes plans of a problem shorter, and ends them at the goal.

    Args:
        problem: what was planned.

    Raises:
        ValueError: the goal is a function, of which nothing is known.
    """

    def __init__(self, problem: Problem):
        if problem.goal.numbers.kind == UNKNOWN:
            raise ValueError("a plan to a goal that is a function cannot be polished")
        self._problem, self._shooting = problem, Shooting(problem)
        self._strict = problem.motions.where(tolerance=-1.0)

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
        found = (
            self._brought(one, distance, end if late else self._soon(limit), late)
            for one, late in early
        )
        best = next((way for way in found if way is not None), None)
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
    ) -> Ways | None:
        """A way near velocities (m, n_vK) that ends at the goal with nothing in its way."""
        return brought(self._shooting, V, lambda way: self._there(way, distance), until, late)

    def _there(self, way: Ways, distance: float) -> bool:
        """Whether a way ends at the goal, within all bounds."""
        there = way.distance[0] <= distance and self._shooting.stays(way)
        return bool(there and self._made(way).distance[0, -1] <= distance)

    def _made(self, way: Ways) -> Segments:
        """A way, ended by what is in its way."""
        acceleration = self._shooting.accelerations(way.V)
        return self._strict.sweep(self._problem.root, np.zeros(1), acceleration)

    def _whole(self, acceleration: Array, looks: Array) -> Array:
        """The same ways in segments of the usual duration; the last one may last longer."""
        lasts = looks * self._problem.motions.interval
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
