"""Polishing: shorter plans that end nearer to the goal, found by ``descent``."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from fantoccini.base import Array, Indices, Outcome
from fantoccini.control.planning.descent import approach
from fantoccini.control.planning.shooting import Candidates, Shooting
from fantoccini.control.problems import Problem
from fantoccini.kernel.runtime import UNKNOWN, Segments


@dataclass(frozen=True)
class _Attempts:
    """Which variants of a plan are tried, and for how long."""

    durations: tuple[float, ...] = (0.85, 1.0)
    """Durations relative to the plan's that are tried first."""
    first_share: float = 0.2
    """Part of the time limit for each of them."""
    extensions: tuple[float, ...] = (0.0, 0.5, 1.0, 2.0, 4.0)
    """Time added to the plan until its end can be brought to the goal [s]."""
    shortening: float = 0.15
    """Largest part of its segments by which it is then shortened at once."""
    rounding: float = 1e-9
    """Part of a segment that does not count as another one."""


_ATTEMPTS = _Attempts()


class PolishStatus(Outcome):
    """The outcome of polishing a plan."""

    POLISHED = "it ends as near to the goal as was asked"
    NO_BETTER = "the plan is as it was: nothing that ends so near costs less"
    NOT_NEAR = "the plan is as it was: no rollout close to it ends so near within all bounds"
    TIMEOUT = "the plan is as it was: the time ended before it came so near to the goal"
    NOT_HELD = "the plan is as it was: its polished versions do not hold in simulation"
    INTERRUPTED = "the plan is as it was: it was interrupted before anything was found"
    NO_MOTION = "the plan is as it was: it has no segment"
    MAY_TOUCH = "the plan is as it was: plans that may touch something are not polished"
    UNKNOWN_GOAL = "the plan is as it was: its goal is a function, which has no residuals"


@dataclass(frozen=True)
class Polish:
    """The outcome of polishing a plan.

    Attributes:
        status: whether it helped, and why not.
        asked: the distance from the goal that was near enough.
        nearest: distance of the best rollout that did not reach the goal; nan without any.
        broken: constraints that it violates: ``clearance``, ``limits``, ``tension``;
            ``equilibrium`` where the puppet would not stay.
    """

    status: PolishStatus
    asked: float
    nearest: float = math.nan
    broken: tuple[str, ...] = ()

    @classmethod
    def of(cls, plain: list[Any] | None) -> Polish | None:
        """From :attr:`plain`."""
        if plain is None:
            return None
        status, asked, nearest, broken = plain
        return cls(PolishStatus[status], float(asked), float(nearest), tuple(map(str, broken)))

    @property
    def plain(self) -> list[Any]:
        """As plain data."""
        return [self.status.name, self.asked, self.nearest, list(self.broken)]

    @property
    def reached(self) -> bool:
        """Whether the plan ends as near to the goal as requested."""
        return self.status in (PolishStatus.POLISHED, PolishStatus.NO_BETTER)

    def __str__(self) -> str:
        text = f"{self.status.message} (asked: {self.asked:.3g}"
        if not self.reached and not math.isnan(self.nearest):
            text += f"; nearest: {self.nearest:.3g}"
            text += f", at the cost of {' and '.join(self.broken)}" if self.broken else ""
        return text + ")"


class Polisher:
    """Shortens plans of a problem, and ends them at the goal.

    Attributes:
        nearest: the rollout with the least merit that does not end at the goal; None without any.
        late: whether the time ended before a plan reached the goal.

    Args:
        problem: that was planned.

    Raises:
        ValueError: the goal is a function, which has no residuals, or something may touch.
    """

    def __init__(self, problem: Problem):
        if problem.goal.numbers.kind == UNKNOWN:
            raise ValueError("a plan to a goal that is a function cannot be polished")
        if problem.touches.expected:
            raise ValueError("a plan that may touch something cannot be polished")
        self._problem, self._shooting = problem, Shooting(problem)
        self._strict = problem.rollouts.where(tolerance=-1.0)
        self.nearest: Candidates | None = None
        self.late = False

    def __call__(
        self,
        acceleration: Array,
        looks: Indices,
        distance: float,
        seconds: float,
        limit: float = np.inf,
        *,
        shorter: bool = True,
    ) -> Iterator[Segments]:
        """Yields plans that end at the goal, each shorter than the one before.

        Args:
            acceleration: (m, n_vK) of a plan's segments.
            looks: (m,) that they last.
            distance: from the goal that is near enough.
            seconds: how long to look for shorter plans.
            limit: time after which polishing is abandoned where no plan comes so near [s].
            shorter: whether shorter plans are wanted.
        """
        began = time.perf_counter()
        V, until, end = self._resampled(acceleration, looks), began + seconds, began + limit
        sizes = [max(1, round(x * len(V))) for x in _ATTEMPTS.durations if shorter or x >= 1.0]
        V, segment = self._shooting.within(V), self._shooting.segment
        tries = itertools.chain(
            ((self._stretched(V, m), False) for m in sizes),
            ((self._shooting.continued(V, round(s / segment)), True) for s in _ATTEMPTS.extensions),
        )
        early = itertools.takewhile(lambda _: time.perf_counter() < end, tries)
        self.nearest, self.late = None, True
        found = (
            self._at_goal(one, distance, end if late else self._soon(limit), late)
            for one, late in early
        )
        best = next((one for one in found if one is not None), None)
        self.late = time.perf_counter() >= end
        if best is None:
            return
        yield self._checked(best)
        fewer = round(_ATTEMPTS.shortening * len(best)) if shorter else 0
        while fewer and time.perf_counter() < until:
            m = max(1, len(best) - fewer)
            shorter_one = self._at_goal(self._stretched(best.V[0], m), distance, until)
            if shorter_one is None:
                fewer //= 2
            else:
                best, fewer = shorter_one, min(fewer, round(_ATTEMPTS.shortening * m))
                yield self._checked(best)

    @staticmethod
    def _soon(limit: float) -> float:
        """Time at which to stop varying the whole plan, and vary its end, which is quicker."""
        return time.perf_counter() + _ATTEMPTS.first_share * limit

    def _at_goal(
        self, V: Array, distance: float, until: float, late: bool = False
    ) -> Candidates | None:
        """A candidate near velocities (m, n_vK) that ends at the goal, unobstructed."""
        made = approach(
            self._shooting, V, lambda candidate: self._arrives(candidate, distance), until, late
        )
        if made.arrives:
            return made.candidate
        if made.candidate is not None and not (
            self.nearest is not None and self.nearest.merit[0] <= made.candidate.merit[0]
        ):
            self.nearest = made.candidate
        return None

    def outcome(self, status: PolishStatus, asked: float) -> Polish:
        """The outcome, with the nearest candidate of the last plan."""
        if self.nearest is None:
            return Polish(status, asked)
        broken = self._shooting.broken(self.nearest)
        if not self._shooting.stays(self.nearest):
            broken += ("equilibrium",)
        return Polish(status, asked, float(self.nearest.distance[0]), broken)

    def _arrives(self, candidate: Candidates, distance: float) -> bool:
        """Whether a candidate ends at the goal, within all bounds."""
        there = candidate.distance[0] <= distance and self._shooting.stays(candidate)
        return bool(there and self._checked(candidate).distance[0, -1] <= distance)

    def _checked(self, candidate: Candidates) -> Segments:
        """A candidate as a rollout that bounds and obstacles stop."""
        acceleration = self._shooting.accelerations(candidate.V)
        return self._strict.simulate(self._problem.root, np.zeros(1, int), acceleration)

    def _resampled(self, acceleration: Array, looks: Indices) -> Array:
        """(m, n_vK) velocities in segments of the usual duration; the last may last longer."""
        lasts = looks * self._problem.rollouts.options.interval
        times = np.concatenate([[0.0], np.cumsum(lasts)])
        first = self._problem.root.v_K
        V = np.concatenate([first, first + np.cumsum(acceleration * lasts[:, None], axis=0)])
        segment = self._shooting.segment
        last = math.ceil(times[-1] / segment - _ATTEMPTS.rounding)
        at = segment * np.arange(1, last + 1)
        return np.stack([np.interp(at, times, column) for column in V.T], axis=1)

    def _stretched(self, V: Array, m: int) -> Array:
        """(m, n_vK) velocities along the same path in m segments."""
        scale = len(V) / m
        at, there = scale * np.arange(1, m + 1), np.arange(len(V) + 1)
        V = np.concatenate([self._problem.root.v_K, V])
        return scale * np.stack([np.interp(at, there, column) for column in V.T], axis=1)
