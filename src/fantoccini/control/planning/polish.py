"""Polishing: makes plans shorter and ends them nearer to the goal, by :mod:`.descent`.

A segment is a piece of the plan with constant driven accelerations; n_vK is the number of driven
velocities.
"""

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
    """Variants of a plan for polishing, and their time limits."""

    durations: tuple[float, ...] = (0.85, 1.0)
    """Durations of the first variants, relative to that of the plan."""
    first_share: float = 0.2
    """Share of the time limit for each of the first variants."""
    extensions: tuple[float, ...] = (0.0, 0.5, 1.0, 2.0, 4.0)
    """Times by which the plan is extended, tried in turn until its end reaches the goal [s]."""
    shortening: float = 0.15
    """Largest share of a plan's segments that is removed in one attempt to shorten it."""
    rounding: float = 1e-9
    """Rounding error allowed in a number of segments."""


_ATTEMPTS = _Attempts()


class PolishStatus(Outcome):
    """The outcome of polishing a plan."""

    POLISHED = "the plan ends as near to the goal as required"
    NO_BETTER = "the plan is unchanged: no variant that ends near enough costs less"
    NOT_NEAR = "the plan is unchanged: no variant within all bounds ends near enough to the goal"
    TIMEOUT = "the plan is unchanged: the time ended before a variant came near enough to the goal"
    NOT_HELD = "the plan is unchanged: its polished variants are not confirmed by simulation"
    TOO_LONG = "the plan is unchanged: its polished variants take longer than the problem allows"
    INTERRUPTED = "the plan is unchanged: polishing was interrupted before a variant was found"
    NO_MOTION = "the plan is unchanged: it has no motion"
    MAY_TOUCH = "the plan is unchanged: plans that may touch something are not polished"
    UNKNOWN_GOAL = "the plan is unchanged: its goal is a function, which has no residuals"

    @property
    def reached(self) -> bool:
        """Whether the plan ends as near to the goal as requested."""
        return self in (PolishStatus.POLISHED, PolishStatus.NO_BETTER)


@dataclass(frozen=True)
class PolishResult:
    """The outcome of polishing a plan.

    Attributes:
        status: whether the plan was improved, or the reason why not.
        required: required distance from the goal.
        nearest: distance of the best rollout that missed the goal; NaN if there is none.
        violated: constraints that this rollout violates: ``clearance``, ``limits``, ``tension``;
            ``equilibrium`` if the puppet would not stay in its final pose.
    """

    status: PolishStatus
    required: float
    nearest: float = math.nan
    violated: tuple[str, ...] = ()

    @classmethod
    def from_list(cls, data: list[Any] | None) -> PolishResult | None:
        """The outcome from :attr:`as_list`."""
        if data is None:
            return None
        status, required, nearest, violated = data
        return cls(PolishStatus[status], float(required), float(nearest), tuple(map(str, violated)))

    @property
    def as_list(self) -> list[Any]:
        """The outcome as plain data."""
        return [self.status.name, self.required, self.nearest, list(self.violated)]

    @property
    def reached(self) -> bool:
        """Whether the plan ends as near to the goal as requested."""
        return self.status.reached

    def __str__(self) -> str:
        text = f"{self.status.message} (required: {self.required:.3g}"
        if not self.reached and not math.isnan(self.nearest):
            text += f"; nearest: {self.nearest:.3g}"
            text += f", which violates {' and '.join(self.violated)}" if self.violated else ""
        return text + ")"


class Polisher:
    """Polishes plans of a problem: makes them shorter, and brings their end to the goal.

    Attributes:
        nearest: best rollout that misses the goal, with the lowest merit; None if there is none.
        timed_out: whether the time ended before a plan reached the goal.

    Args:
        problem: the planning problem.

    Raises:
        ValueError: the goal is a function, which has no residuals, or plans may touch something.
    """

    def __init__(self, problem: Problem):
        if problem.goal.numbers.kind == UNKNOWN:
            raise ValueError("a plan to a goal that is a function cannot be polished")
        if problem.touches.expected:
            raise ValueError("a plan that may touch something cannot be polished")
        self._problem, self._shooting = problem, Shooting(problem)
        self._bounded_rollouts = problem.rollouts.with_tolerance(tolerance=-1.0)
        self.nearest: Candidates | None = None
        self.timed_out = False

    def __call__(
        self,
        acceleration: Array,
        n_checks: Indices,
        distance: float,
        seconds: float,
        time_limit: float = np.inf,
        *,
        shorten: bool = True,
    ) -> Iterator[Segments]:
        """Yields plans that end at the goal, each shorter than the previous one.

        Args:
            acceleration: (m, n_vK) accelerations of a plan's segments.
            n_checks: (m,) numbers of checks in the segments.
            distance: required distance from the goal.
            seconds: time to search for shorter plans [s].
            time_limit: time after which polishing is abandoned if no plan has come within
                `distance` of the goal [s].
            shorten: whether to search for shorter plans.
        """
        start_time = time.perf_counter()
        search_deadline, deadline = start_time + seconds, start_time + time_limit
        V = self._resample(acceleration, n_checks)
        segment_counts = [
            max(1, round(x * len(V))) for x in _ATTEMPTS.durations if shorten or x >= 1.0
        ]
        V, segment = self._shooting.within(V), self._shooting.segment
        trials = itertools.chain(
            ((self._stretch(V, m), False) for m in segment_counts),
            ((self._shooting.extended(V, round(s / segment)), True) for s in _ATTEMPTS.extensions),
        )
        trials_in_time = itertools.takewhile(lambda _: time.perf_counter() < deadline, trials)
        self.nearest, self.timed_out = None, True
        candidates = (
            self._descend(
                velocities,
                distance,
                deadline if end_only else self._first_deadline(time_limit),
                end_only,
            )
            for velocities, end_only in trials_in_time
        )
        best = next((candidate for candidate in candidates if candidate is not None), None)
        self.timed_out = time.perf_counter() >= deadline
        if best is None:
            return
        yield self._simulate(best)
        n_fewer = round(_ATTEMPTS.shortening * len(best)) if shorten else 0
        while n_fewer and time.perf_counter() < search_deadline:
            m = max(1, len(best) - n_fewer)
            shortened = self._descend(self._stretch(best.V[0], m), distance, search_deadline)
            if shortened is None:
                n_fewer //= 2
            else:
                best, n_fewer = shortened, min(n_fewer, round(_ATTEMPTS.shortening * m))
                yield self._simulate(best)

    @staticmethod
    def _first_deadline(time_limit: float) -> float:
        """Time at which to stop varying the whole plan; then only its end is varied."""
        return time.perf_counter() + _ATTEMPTS.first_share * time_limit

    def _descend(
        self, V: Array, distance: float, search_deadline: float, end_only: bool = False
    ) -> Candidates | None:
        """A candidate near V (m, n_vK) that ends at the goal within all bounds, or None.

        Args:
            V: (m, n_vK) velocities at the ends of the segments.
            distance: required distance from the goal.
            search_deadline: time of ``time.perf_counter`` at which to stop [s].
            end_only: whether to vary only the end of the plan.
        """
        result = approach(
            self._shooting,
            V,
            lambda candidate: self._arrives(candidate, distance),
            search_deadline,
            end_only,
        )
        if result.arrives:
            return result.candidate
        if result.candidate is not None and not (
            self.nearest is not None and self.nearest.merit[0] <= result.candidate.merit[0]
        ):
            self.nearest = result.candidate
        return None

    def outcome(self, status: PolishStatus, required: float) -> PolishResult:
        """The outcome, with the nearest candidate of the last plan."""
        if self.nearest is None:
            return PolishResult(status, required)
        violated = self._shooting.violated_constraints(self.nearest)
        if not self._shooting.stays_at_goal(self.nearest):
            violated += ("equilibrium",)
        return PolishResult(status, required, float(self.nearest.distance[0]), violated)

    def _arrives(self, candidate: Candidates, distance: float) -> bool:
        """Whether a candidate ends at the goal, within all bounds."""
        at_goal = candidate.distance[0] <= distance and self._shooting.stays_at_goal(candidate)
        return bool(at_goal and self._simulate(candidate).distance[0, -1] <= distance)

    def _simulate(self, candidate: Candidates) -> Segments:
        """A candidate's rollout with bounds and obstacles."""
        acceleration = self._shooting.accelerations(candidate.V)
        return self._bounded_rollouts.simulate(self._problem.root, np.zeros(1, int), acceleration)

    def _resample(self, acceleration: Array, n_checks: Indices) -> Array:
        """(m, n_vK) velocities in segments of the usual duration; the last may be longer."""
        durations = n_checks * self._problem.rollouts.options.interval
        times = np.concatenate([[0.0], np.cumsum(durations)])
        start_velocity = self._problem.root.v_K
        V = np.concatenate(
            [start_velocity, start_velocity + np.cumsum(acceleration * durations[:, None], axis=0)]
        )
        segment = self._shooting.segment
        n_segments = math.ceil(times[-1] / segment - _ATTEMPTS.rounding)
        end_times = segment * np.arange(1, n_segments + 1)
        return np.stack([np.interp(end_times, times, column) for column in V.T], axis=1)

    def _stretch(self, V: Array, m: int) -> Array:
        """(m, n_vK) velocities along the same path in m segments."""
        scale = len(V) / m
        positions, nodes = scale * np.arange(1, m + 1), np.arange(len(V) + 1)
        V = np.concatenate([self._problem.root.v_K, V])
        return scale * np.stack([np.interp(positions, nodes, column) for column in V.T], axis=1)
