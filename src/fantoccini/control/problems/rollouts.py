"""Rollouts: many short simulations at once, within bounds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from fantoccini.base import Array, Indices, MaskRows, StateError, UnknownNameError, check_positive
from fantoccini.control.tasks import Bounds, Goal, Most, StateArrays
from fantoccini.dynamics.clearance import Clearance
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import (
    Funnel,
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

    stop: float = 0.8
    """Part of the tolerance at which a rollout stops: its plans arrive in other simulations too."""
    min_length: float = 1e-3
    """Length to which a string may be wound in [m]."""
    max_bound: float = 1e6
    """Largest bound on a speed or an acceleration [m/s or m/s^2; rad/s or rad/s^2]."""
    unbounded_speed: float = 1.01
    """Speed that unbounded rollouts keep, relative to the bound."""
    max_steps: int = 10_000
    """Time steps of a segment."""
    speed: float = 0.5
    """Bound of speeds that have none [m/s]."""
    acceleration: float = 2.0
    """Bound of accelerations that have none [m/s^2]."""
    max_segment: float = 10.0
    """Duration of a segment [s]."""
    rounding: float = 1e-9
    """Rounding of a segment's duration, relative to it."""


_LIMITS = _Limits()
_NONE = Bounds()
_NOT_PLANNED = ("jerk", "tension", "joint", "force", "voltage", "current")
"""Bounds that optimisations have, and plans have not."""


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

    def without(self, reserve: float) -> DrivenBounds:
        """Speeds and accelerations less a share of them; ranges stay."""
        left = 1.0 - reserve
        return replace(self, speed=left * self.speed, acceleration=left * self.acceleration)

    @classmethod
    def of(cls, marionette: Marionette, bounds: Bounds) -> DrivenBounds:
        """Bounds by name.

        Args:
            marionette: the puppet.
            bounds: position, speed, acceleration and what is held. Lengths stay positive. A
                coordinate with a drive goes by its own name or its command's.

        Raises:
            UnknownNameError: a name that is no driven coordinate.
            StateError: a bound out of range or of another kind, a coordinate named twice, none that
                may move, or a puppet with driven rotations.
        """
        table = marionette.coordinates
        if table.quaternions_K:
            raise StateError("plans move points and lengths; this puppet has a driven rotation")
        if others := [
            name for name in _NOT_PLANNED if getattr(bounds, name) != getattr(_NONE, name)
        ]:
            raise StateError(
                f"plans have no bounds of {', '.join(others)}; give position, speed, acceleration, "
                "held, clearance and own_body"
            )
        sizes = {
            "speed": _sizes(table, bounds.speed, "speed", _LIMITS.speed),
            "acceleration": _sizes(
                table, bounds.acceleration, "acceleration", _LIMITS.acceleration
            ),
        }
        held = list(_by_index(table, dict.fromkeys(bounds.held), "held"))
        for size in sizes.values():
            size[held] = 0.0
        if not np.any((sizes["speed"] > 0.0) & (sizes["acceleration"] > 0.0)):
            raise StateError("no driven coordinate may move: speed or acceleration is 0 for all")
        low, high = np.full(table.n_qK, -np.inf), np.full(table.n_qK, np.inf)
        for string in (*marionette.tree.strings, *marionette.tree.chains):
            lead = marionette.tree.length_lead(string)
            if lead is not None:
                low[lead[0]] = _LIMITS.min_length
        for k, (name, (least, most)) in _by_index(table, bounds.position, "range").items():
            if not least < most:
                raise StateError(f"the range of {name} is {least} to {most}; it must not be empty")
            low[k], high[k] = max(low[k], least), most
        return cls(**sizes, low=low, high=high)


def _by_index(
    table: CoordinateTable, given: Mapping[str, Value], what: str
) -> dict[int, tuple[str, Value]]:
    """Index in q_K -> name and value; a coordinate with a drive may go by its command's name."""
    found: dict[int, tuple[str, Value]] = {}
    for name, value in given.items():
        driven = table.commands.get(name, name)
        if driven not in table.q_K:
            raise UnknownNameError("driven coordinate", name, [*table.commands, *table.q_K])
        k = table.q_K.index(driven)
        if k in found:
            raise StateError(f"the {what} of {driven} is given twice: as {found[k][0]} and {name}")
        found[k] = name, value
    return found


def _sizes(table: CoordinateTable, given: Most, what: str, usual: float) -> Array:
    """(n_qK,) bounds of all driven coordinates; 0 of those that a mapping does not name."""
    if not isinstance(given, Mapping):
        given = dict.fromkeys(table.q_K, usual if given == np.inf else given)
    found, most = np.zeros(table.n_qK), _LIMITS.max_bound
    for k, (name, value) in _by_index(table, given, what).items():
        if not 0.0 <= value <= most:
            raise StateError(
                f"the {what} of {name} is {value}; it must be at least 0 and at most {most:g}"
            )
        found[k] = value
    return found


@dataclass(frozen=True)
class RolloutOptions:
    """How rollouts are simulated and checked.

    Attributes:
        dt: step of the time-stepper [s].
        look: steps from one check for collisions and the goal to the next.
        looks: checks of a segment, over which accelerations are constant: 0.1 s by default, 10 s at
            most. Rollouts of ``"est-2007"`` last 1 to 5 times as long.
        threads: that share the work, all processors by default; results do not depend on it.
        reserve: share of the bounds of speed and acceleration that plans leave unused, 0 to less
            than 1: feedback needs it to bring a puppet back to a plan that is at its bounds itself.
        strings: whether strings are kept clear of obstacles too.

    Raises:
        ValueError: a number out of range.
    """

    dt: float = 0.004
    look: int = 5
    looks: int = 5
    threads: int = field(default_factory=default_threads)
    reserve: float = 0.0
    strings: bool = True

    def __post_init__(self) -> None:
        check_positive(dt=self.dt)
        for what in ("look", "looks", "threads"):
            if not (number := getattr(self, what)) >= 1:
                raise ValueError(f"{what} is {number}; it must be at least 1")
        if not 0.0 <= self.reserve < 1.0:
            raise ValueError(f"reserve is {self.reserve!r}; it must be at least 0 and less than 1")
        if self.segment > _LIMITS.max_segment:
            raise ValueError(
                f"a segment lasts {self.segment:g} s; it must be at most {_LIMITS.max_segment:g} s"
            )
        steps = self.looks * self.look
        if steps > _LIMITS.max_steps:
            raise ValueError(
                f"a segment of {steps * self.dt:g} s takes {steps} steps of {self.dt:g} s; it "
                f"must be at most {_LIMITS.max_steps}"
            )

    @property
    def interval(self) -> float:
        """From one check to the next [s]."""
        return self.dt * self.look

    @property
    def segment(self) -> float:
        """Duration of a segment [s]."""
        return self.looks * self.interval


def whole_looks(segment: float, interval: float) -> int:
    """The number of checks of a segment; both durations in seconds.

    Raises:
        ValueError: the segment is too long, or not a whole number of intervals.
    """
    if _LIMITS.max_segment < segment < np.inf:
        raise ValueError(f"segment is {segment} s; it must be at most {_LIMITS.max_segment:g} s")
    looks = round(segment / interval) if 0.0 < segment < np.inf else 0
    if looks < 1 or abs(segment - looks * interval) > _LIMITS.rounding * segment:
        raise ValueError(
            f"segment is {segment} s; it must be a whole number of looks, which are {interval:g} s "
            "apart"
        )
    return looks


class Rollouts:
    """Simulates rollouts by time-stepping, in lanes on all threads, and checks their clearance.

    A rollout consists of segments in which every driven coordinate has a constant acceleration.

    Attributes:
        marionette, clearance, bounds, goal, options, margin, slack, kept_off: see below.
        stop_distance: from the goal, at which rollouts stop.
        funnels: the feedback laws that may lead rollouts; empty where there is none.
        run_options: of the time-stepper.

    Args:
        marionette: the puppet.
        clearance: what it is kept clear of.
        bounds: of the driven coordinates.
        goal: where rollouts stop.
        options: how they are simulated and checked.
        tolerance: of the goal's distance; negative where a rollout goes on past the goal.
        margin: least clearance [m].
        slack: whether taut strings may go slack.
        kept_off: (n_pairs,) bool, the pairs of contact that must not touch; none by default.
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
        self.stop_distance = _LIMITS.stop * tolerance
        self.funnels: list[Funnel] = []
        # Rollouts restart at every node, so a step must depend on its state alone.
        self.run_options = marionette.run_options(
            dt=options.dt, save_every=options.look, extrapolate=False
        )
        settings = RolloutSettings(
            self.run_options,
            options.looks,
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

    def where(self, *, tolerance: float, free: bool = False) -> Rollouts:
        """The same rollouts with another tolerance.

        Args:
            tolerance: of the goal's distance.
            free: whether nothing else stops them; speeds may be 1 % above their bounds then.
        """
        bounds = self.bounds
        if free:
            far = np.full(len(bounds.low), np.inf)
            speed = _LIMITS.unbounded_speed * bounds.speed
            bounds = replace(bounds, speed=speed, low=-far, high=far)
        made = Rollouts(
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
        made.funnels = self.funnels
        return made

    @cached_property
    def ends(self) -> tuple[Indices, int]:
        """(n_vK,) string end of each driven velocity, by its name's first part; their number."""
        names = [name.rsplit(".", 1)[0] for name in self.marionette.coordinates.v_K]
        found = sorted(set(names))
        return np.array([found.index(name) for name in names]), len(found)

    def simulate(
        self,
        starts: StateArrays,
        start: Indices,
        acceleration: Array,
        *,
        n_given: Indices | None = None,
        n_segments: Indices | None = None,
        funnel: Indices | None = None,
        lead_time: Array | None = None,
        looks: int | None = None,
    ) -> Segments:
        """Simulates each rollout until it is complete, reaches the goal, or leaves its bounds.

        A segment on whose way the margin or a bound is broken is not completed.

        Args:
            starts: (m,) states.
            start: (n,) index of the start of each rollout.
            acceleration: (n, segments, n_vK) of the driven coordinates.
            n_given: (n,) how many of these are given; a funnel leads the others. All by default.
            n_segments: (n,) segments of each, at most; all by default.
            funnel: (n,) index of the funnel; the first by default.
            lead_time: (n,) time by which a funnel's reference runs ahead [s].
            looks: checks of a segment.
        """
        n, segments = acceleration.shape[:2]
        n_given = np.full(n, segments) if n_given is None else n_given
        found = self._pool(
            starts.parts,
            start,
            acceleration,
            n_given,
            n_segments,
            self.funnels,
            funnel,
            lead_time,
            looks,
        )
        if self.goal.function is not None:
            whole = found.looks > 0
            found.distance[whole] = self.goal.distance(StateArrays(**found.states)[whole])
        if self.goal.touches:
            self._add_gaps(found)
        return found

    def _add_gaps(self, found: Segments) -> None:
        """Adds their gaps to the distances of ends at which a touch is open."""
        far = (found.looks > 0) & (found.distance >= self.goal.numbers.open)
        gaps = self.goal.gaps(StateArrays(**found.states)[far])
        found.distance[far] += np.sum(np.maximum(gaps, 0.0), axis=-1)

    def replay(self, before: StateArrays, acceleration: Array, looks: int) -> StateArrays | None:
        """The end of one segment, simulated again; None where it is not clear.

        Args:
            before: (1,) state.
            acceleration: (n_vK,).
            looks: checks that it lasts.
        """
        made = self.simulate(before, np.zeros(1, int), acceleration[None, None], looks=looks)
        return StateArrays(**made.states)[:, 0] if made.looks[0, 0] == looks else None
