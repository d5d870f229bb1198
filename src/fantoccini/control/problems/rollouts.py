"""Rollouts: many short simulations at once, within bounds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from fantoccini.base import Array, Indices, MaskRows, StateError, UnknownNameError, check_positive
from fantoccini.control.tasks import Bounds, Goal, Magnitudes, StateArrays
from fantoccini.dynamics.clearance import Clearance
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import (
    LqrLaw,
    RolloutPool,
    RolloutSettings,
    Segments,
    default_threads,
)
from fantoccini.model.tree import CoordinateTable

Value = TypeVar("Value")


@dataclass(frozen=True)
class _Limits:
    """Limits of rollouts and of their options."""

    stop_share: float = 0.8
    """Share of the tolerance at which a rollout stops, so that other simulations also arrive."""
    min_length: float = 1e-3
    """Smallest length of a string on a winch [m]."""
    max_bound: float = 1e6
    """Largest bound on a speed or an acceleration [m/s or m/s^2; rad/s or rad/s^2]."""
    unbounded_speed: float = 1.01
    """Speed bound of unbounded rollouts, relative to the usual bound."""
    max_steps: int = 10_000
    """Largest number of time steps in a segment."""
    default_speed: float = 0.5
    """Default bound of speeds [m/s]."""
    default_acceleration: float = 2.0
    """Default bound of accelerations [m/s^2]."""
    max_segment: float = 10.0
    """Longest duration of a segment [s]."""
    rounding: float = 1e-9
    """Rounding error of a segment's duration, relative to it."""


_LIMITS = _Limits()
_DEFAULT_BOUNDS = Bounds()
_UNSUPPORTED_BOUNDS = ("jerk", "tension", "joint", "force", "voltage", "current")
"""Bounds that optimisations support, and plans do not."""


@dataclass(frozen=True, eq=False)
class DrivenBounds:
    """Bounds of the driven coordinates, as arrays.

    Attributes:
        speed: (n_vK,) largest |v_K| [m/s or rad/s].
        acceleration: (n_vK,) largest |acc_K| [m/s^2 or rad/s^2].
        low, high: (n_qK,) range of the coordinates [m or rad].
    """

    speed: Array
    acceleration: Array
    low: Array
    high: Array

    @property
    def moves(self) -> MaskRows:
        """(n_vK,) bool, the driven velocities that may be nonzero."""
        return (self.speed > 0.0) & (self.acceleration > 0.0)

    def reduced(self, reserve: float) -> DrivenBounds:
        """The bounds with speeds and accelerations reduced by a share."""
        share = 1.0 - reserve
        return replace(self, speed=share * self.speed, acceleration=share * self.acceleration)

    @classmethod
    def of(cls, marionette: Marionette, bounds: Bounds) -> DrivenBounds:
        """The bounds of a task.

        Args:
            marionette: the puppet.
            bounds: position, speed, acceleration and held velocities. Lengths stay positive. A
                driven coordinate may be named by its command.

        Raises:
            UnknownNameError: name that is not a driven coordinate.
            StateError: bound out of range or not supported, coordinate named twice, no coordinate
                that moves, or a puppet with driven rotations.
        """
        table = marionette.coordinates
        if table.quaternions_K:
            raise StateError("plans move points and lengths; this puppet has a driven rotation")
        if extra := [
            name
            for name in _UNSUPPORTED_BOUNDS
            if getattr(bounds, name) != getattr(_DEFAULT_BOUNDS, name)
        ]:
            raise StateError(
                f"plans do not support bounds of {', '.join(extra)}; give position, speed, "
                "acceleration, held, clearance and own_body"
            )
        magnitudes = {
            "speed": _magnitudes(table, bounds.speed, "speed", _LIMITS.default_speed),
            "acceleration": _magnitudes(
                table, bounds.acceleration, "acceleration", _LIMITS.default_acceleration
            ),
        }
        held = list(_by_index(table, dict.fromkeys(bounds.held), "held"))
        for magnitude in magnitudes.values():
            magnitude[held] = 0.0
        if not np.any((magnitudes["speed"] > 0.0) & (magnitudes["acceleration"] > 0.0)):
            raise StateError("no driven coordinate may move: speed or acceleration is 0 for all")
        low, high = np.full(table.n_qK, -np.inf), np.full(table.n_qK, np.inf)
        for string in (*marionette.tree.strings, *marionette.tree.chains):
            driven = marionette.tree.commanding_length(string)
            if driven is not None:
                low[driven[0]] = _LIMITS.min_length
        for k, (name, (lower, upper)) in _by_index(table, bounds.position, "range").items():
            if not lower < upper:
                raise StateError(f"the range of {name} is {lower} to {upper}; it must not be empty")
            low[k], high[k] = max(low[k], lower), upper
        return cls(**magnitudes, low=low, high=high)


def _by_index(
    table: CoordinateTable, values: Mapping[str, Value], label: str
) -> dict[int, tuple[str, Value]]:
    """Index in q_K -> name and value; coordinates may be named by their commands."""
    by_index: dict[int, tuple[str, Value]] = {}
    for name, value in values.items():
        driven = table.commands.get(name, name)
        if driven not in table.q_K:
            raise UnknownNameError("driven coordinate", name, [*table.commands, *table.q_K])
        k = table.q_K.index(driven)
        if k in by_index:
            raise StateError(
                f"the {label} of {driven} is given twice: as {by_index[k][0]} and {name}"
            )
        by_index[k] = name, value
    return by_index


def _magnitudes(table: CoordinateTable, bounds: Magnitudes, label: str, default: float) -> Array:
    """(n_qK,) bounds of all driven coordinates; 0 for those that a mapping does not name."""
    if not isinstance(bounds, Mapping):
        bounds = dict.fromkeys(table.q_K, default if bounds == np.inf else bounds)
    magnitudes, upper = np.zeros(table.n_qK), _LIMITS.max_bound
    for k, (name, value) in _by_index(table, bounds, label).items():
        if not 0.0 <= value <= upper:
            raise StateError(
                f"the {label} of {name} is {value}; it must be at least 0 and at most {upper:g}"
            )
        magnitudes[k] = value
    return magnitudes


@dataclass(frozen=True)
class RolloutOptions:
    """Options for the simulation and checks of rollouts.

    Attributes:
        dt: step of the time-stepper [s].
        steps_per_check: number of steps between checks for collisions and the goal.
        n_checks: number of checks in a segment, over which accelerations are constant: 0.1 s by
            default, 10 s at most. Rollouts of ``"est-2007"`` last 1 to 5 times as long.
        threads: number of threads, all processors by default; results do not depend on it.
        reserve: share of the bounds of speed and acceleration that plans leave unused, 0 to less
            than 1; feedback needs it to correct deviations from a plan that is at its bounds.
        strings: whether strings are kept clear of obstacles, too.

    Raises:
        ValueError: number out of range.
    """

    dt: float = 0.004
    steps_per_check: int = 5
    n_checks: int = 5
    threads: int = field(default_factory=default_threads)
    reserve: float = 0.0
    strings: bool = True

    def __post_init__(self) -> None:
        check_positive(dt=self.dt)
        for name in ("steps_per_check", "n_checks", "threads"):
            if not (number := getattr(self, name)) >= 1:
                raise ValueError(f"{name} is {number}; it must be at least 1")
        if not 0.0 <= self.reserve < 1.0:
            raise ValueError(f"reserve is {self.reserve!r}; it must be at least 0 and less than 1")
        if self.segment > _LIMITS.max_segment:
            raise ValueError(
                f"a segment lasts {self.segment:g} s; it must be at most {_LIMITS.max_segment:g} s"
            )
        steps = self.n_checks * self.steps_per_check
        if steps > _LIMITS.max_steps:
            raise ValueError(
                f"a segment of {steps * self.dt:g} s takes {steps} steps of {self.dt:g} s; it "
                f"must be at most {_LIMITS.max_steps}"
            )

    @property
    def interval(self) -> float:
        """Time between checks [s]."""
        return self.dt * self.steps_per_check

    @property
    def segment(self) -> float:
        """Duration of a segment [s]."""
        return self.n_checks * self.interval


def whole_checks(segment: float, interval: float) -> int:
    """The number of checks of a segment; both durations in seconds.

    Raises:
        ValueError: segment that is too long, or not a whole number of intervals.
    """
    if _LIMITS.max_segment < segment < np.inf:
        raise ValueError(f"segment is {segment} s; it must be at most {_LIMITS.max_segment:g} s")
    n_checks = round(segment / interval) if 0.0 < segment < np.inf else 0
    if n_checks < 1 or abs(segment - n_checks * interval) > _LIMITS.rounding * segment:
        raise ValueError(
            f"segment is {segment} s; it must be a whole number of checks, which are "
            f"{interval:g} s apart"
        )
    return n_checks


class Rollouts:
    """Rollouts by time-stepping, in lanes on all threads, with checks of their clearance.

    A rollout consists of segments in which every driven coordinate has a constant acceleration.

    Attributes:
        marionette, clearance, bounds, goal, options, margin, slack, kept_off: see below.
        stop_distance: distance from the goal at which rollouts stop.
        laws: feedback laws for rollouts; may be empty.
        run_options: options of the time-stepper.

    Args:
        marionette: the puppet.
        clearance: obstacles and bodies with required clearance.
        bounds: bounds of the driven coordinates.
        goal: goal at which rollouts stop.
        options: options for simulation and checks.
        tolerance: tolerance of the goal's distance; negative to continue past the goal.
        margin: least clearance [m].
        slack: whether taut strings may go slack.
        kept_off: (n_pairs,) bool, the contact pairs that must not touch; none by default.
    """

    def __init__(
        self,
        marionette: Marionette,
        clearance: Clearance,
        bounds: DrivenBounds,
        goal: Goal,
        options: RolloutOptions,
        *,
        tolerance: float,
        margin: float,
        slack: bool,
        kept_off: MaskRows | None = None,
    ):
        self.marionette, self.clearance, self.bounds = marionette, clearance, bounds
        self.goal, self.options, self.kept_off = goal, options, kept_off
        self.margin, self.slack = margin, slack
        self.stop_distance = _LIMITS.stop_share * tolerance
        self.laws: list[LqrLaw] = []
        # Rollouts restart at every node, so a step must depend on its state alone.
        self.run_options = marionette.run_options(
            dt=options.dt, save_every=options.steps_per_check, extrapolate=False
        )
        settings = RolloutSettings(
            self.run_options,
            options.n_checks,
            marionette.p,
            marionette.winches,
            vars(bounds),
            margin,
            slack,
            clearance.solids,
            goal.numbers,
            self.stop_distance,
            kept_off,
        )
        self._pool = RolloutPool(marionette.libraries.rollouts, settings, options.threads)

    def with_tolerance(self, *, tolerance: float, free: bool = False) -> Rollouts:
        """The same rollouts with another tolerance.

        Args:
            tolerance: tolerance of the goal's distance.
            free: whether all other bounds are dropped, except speeds up to 1 % above theirs.
        """
        bounds = self.bounds
        if free:
            unlimited = np.full(len(bounds.low), np.inf)
            speed = _LIMITS.unbounded_speed * bounds.speed
            bounds = replace(bounds, speed=speed, low=-unlimited, high=unlimited)
        rollouts = Rollouts(
            self.marionette,
            self.clearance,
            bounds,
            self.goal,
            self.options,
            tolerance=tolerance,
            margin=-np.inf if free else self.margin,
            slack=free or self.slack,
            kept_off=None if free else self.kept_off,
        )
        rollouts.laws = self.laws
        return rollouts

    @cached_property
    def string_ends(self) -> tuple[Indices, int]:
        """(n_vK,) string end of each driven velocity, by its name's first part; number of ends."""
        names = [name.rsplit(".", 1)[0] for name in self.marionette.coordinates.v_K]
        ends = sorted(set(names))
        return np.array([ends.index(name) for name in names]), len(ends)

    def simulate(
        self,
        starts: StateArrays,
        start: Indices,
        acceleration: Array,
        *,
        n_given: Indices | None = None,
        n_segments: Indices | None = None,
        law: Indices | None = None,
        lead_time: Array | None = None,
        n_checks: int | None = None,
    ) -> Segments:
        """Rollouts, each until it is complete, reaches the goal, or leaves its bounds.

        A segment that violates the margin or a bound is not completed.

        Args:
            starts: (m,) states.
            start: (n,) index of the start of each rollout.
            acceleration: (n, segments, n_vK) accelerations of the driven coordinates.
            n_given: (n,) number of segments with these accelerations; a law controls the others.
                All by default.
            n_segments: (n,) largest number of segments; all by default.
            law: (n,) index of the law; the first by default.
            lead_time: (n,) lead time of a law's reference [s].
            n_checks: number of checks in a segment.
        """
        n, segments = acceleration.shape[:2]
        n_given = np.full(n, segments) if n_given is None else n_given
        segments_run = self._pool(
            starts.parts,
            start,
            acceleration,
            n_given,
            n_segments,
            self.laws,
            law,
            lead_time,
            n_checks,
        )
        if self.goal.function is not None:
            complete = segments_run.n_checks > 0
            segments_run.distance[complete] = self.goal.distance(
                StateArrays(**segments_run.states)[complete]
            )
        if self.goal.touches:
            self._add_gaps(segments_run)
        return segments_run

    def _add_gaps(self, segments_run: Segments) -> None:
        """Adds the gaps of open touches to the distances at the ends of segments."""
        is_open = (segments_run.n_checks > 0) & (segments_run.distance >= self.goal.numbers.open)
        gaps = self.goal.gaps(StateArrays(**segments_run.states)[is_open])
        segments_run.distance[is_open] += np.sum(np.maximum(gaps, 0.0), axis=-1)

    def replay(self, before: StateArrays, acceleration: Array, n_checks: int) -> StateArrays | None:
        """The end of a segment, simulated again; None if it is not clear.

        Args:
            before: (1,) state at its beginning.
            acceleration: (n_vK,) accelerations of the driven coordinates.
            n_checks: number of checks in the segment.
        """
        segment_run = self.simulate(
            before, np.zeros(1, int), acceleration[None, None], n_checks=n_checks
        )
        is_complete = segment_run.n_checks[0, 0] == n_checks
        return StateArrays(**segment_run.states)[:, 0] if is_complete else None
