"""Rollouts: many short simulations at once, within bounds.

A segment is a piece of motion with constant accelerations of the driven coordinates, and a check an
instant at which bounds and clearances are evaluated. Lanes are rollouts that the vector unit of the
processor advances together.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from fantoccini.base import Array, Indices, MaskRows
from fantoccini.control.tasks import DrivenBounds, Goal, RolloutOptions, StateArrays
from fantoccini.dynamics.clearance import Clearance
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import LqrLaw, RolloutPool, RolloutSettings, Segments

_STOP_SHARE = 0.8
"""Share of the tolerance at which a rollout stops, so that other simulations also arrive."""
_UNBOUNDED_SPEED = 1.01
"""Speed bound of unbounded rollouts, relative to the usual bound."""


class Rollouts:
    """Rollouts by time-stepping, in lanes on all threads, with checks of their clearance.

    A rollout consists of segments in which every driven coordinate has a constant acceleration.

    Attributes:
        marionette, clearance, bounds, goal, options, margin, slack, forbidden_pairs: see below.
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
        forbidden_pairs: (n_pairs,) bool, the contact pairs that must not touch; none by default.
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
        forbidden_pairs: MaskRows | None = None,
    ):
        self.marionette, self.clearance, self.bounds = marionette, clearance, bounds
        self.goal, self.options, self.forbidden_pairs = goal, options, forbidden_pairs
        self.margin, self.slack = margin, slack
        self.stop_distance = _STOP_SHARE * tolerance
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
            forbidden_pairs,
        )
        self._pool = RolloutPool(marionette.libraries.rollouts, settings, options.threads)

    def with_tolerance(self, *, tolerance: float, unbounded: bool = False) -> Rollouts:
        """The same rollouts with another tolerance.

        Args:
            tolerance: tolerance of the goal's distance.
            unbounded: whether all other bounds are dropped, except speeds up to 1 % above theirs.
        """
        bounds = self.bounds
        if unbounded:
            unlimited = np.full(len(bounds.low), np.inf)
            speed = _UNBOUNDED_SPEED * bounds.speed
            bounds = replace(bounds, speed=speed, low=-unlimited, high=unlimited)
        rollouts = Rollouts(
            self.marionette,
            self.clearance,
            bounds,
            self.goal,
            self.options,
            tolerance=tolerance,
            margin=-np.inf if unbounded else self.margin,
            slack=unbounded or self.slack,
            forbidden_pairs=None if unbounded else self.forbidden_pairs,
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
        start_index: Indices,
        acceleration: Array,
        *,
        n_prescribed: Indices | None = None,
        n_segments: Indices | None = None,
        law: Indices | None = None,
        lead_time: Array | None = None,
        n_checks: int | None = None,
    ) -> Segments:
        """Rollouts, each until it is complete, reaches the goal, or leaves its bounds.

        A segment that violates the margin or a bound is not completed.

        Args:
            starts: (m,) states.
            start_index: (n,) index of the start of each rollout.
            acceleration: (n, segments, n_vK) accelerations of the driven coordinates.
            n_prescribed: (n,) number of segments with these accelerations; a law controls the
                others. All by default.
            n_segments: (n,) largest number of segments; all by default.
            law: (n,) index of the law; the first by default.
            lead_time: (n,) lead time of a law's reference [s].
            n_checks: number of checks in a segment.
        """
        n, n_columns = acceleration.shape[:2]
        n_prescribed = np.full(n, n_columns) if n_prescribed is None else n_prescribed
        result = self._pool(
            starts.parts,
            start_index,
            acceleration,
            n_prescribed,
            n_segments,
            self.laws,
            law,
            lead_time,
            n_checks,
        )
        if self.goal.function is not None:
            complete = result.n_checks > 0
            result.distance[complete] = self.goal.distance(StateArrays(**result.states)[complete])
        if self.goal.touches:
            self._add_gaps(result)
        return result

    def _add_gaps(self, result: Segments) -> None:
        """Adds the gaps of open touches to the distances at the ends of segments."""
        is_open = (result.n_checks > 0) & (result.distance >= self.goal.numbers.open)
        gaps = self.goal.gaps(StateArrays(**result.states)[is_open])
        result.distance[is_open] += np.sum(np.maximum(gaps, 0.0), axis=-1)

    def replay(
        self, start_state: StateArrays, acceleration: Array, n_checks: int
    ) -> StateArrays | None:
        """The end of a segment, simulated again; None if it is not clear.

        Args:
            start_state: (1,) state at its beginning.
            acceleration: (n_vK,) accelerations of the driven coordinates.
            n_checks: number of checks in the segment.
        """
        result = self.simulate(
            start_state, np.zeros(1, int), acceleration[None, None], n_checks=n_checks
        )
        is_complete = result.n_checks[0, 0] == n_checks
        return StateArrays(**result.states)[:, 0] if is_complete else None
