"""Planning problems: everything that is the same for every seed, prepared once."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from fantoccini.base import ConfigK, check_not_negative
from fantoccini.control.problems.feasible import out_of_reach, too_far_to_touch
from fantoccini.control.problems.goals import Goal, GoalLike
from fantoccini.control.problems.guidance import guidance
from fantoccini.control.problems.objective import Objective
from fantoccini.control.problems.pushing import push_of
from fantoccini.control.problems.rollouts import Bounds, RolloutOptions, Rollouts
from fantoccini.control.problems.state_arrays import StateArrays
from fantoccini.control.problems.touches import KEEP_OFF, ContactLike, Touches
from fantoccini.dynamics.clearance import Clearance, HalfSpace, standing
from fantoccini.dynamics.compiled import check_start
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import default_threads
from fantoccini.model.puppet import FLOOR, Obstacle
from fantoccini.motion import State

_HOLD = 1.0
"""Time for which puppets that touch or stand, and props that are pushed, must stay [s]."""


class Problem:
    """A puppet, its start, its goal and its obstacles.

    Attributes:
        marionette: see below; where it may touch something, among all obstacles but half-spaces.
        name, start, goal, tolerance, hold: see below.
        touches: what may touch what.
        objective: cost that better plans reduce.
        bounds: of the driven coordinates, all that feedback may use.
        rollouts: that simulate from many states at once, within the part of the bounds that is not
            reserved.
        distance: of the start from the goal.
        reason: why no plan can begin at the start; empty where one can.
        equilibrium: whether the puppet can rest at the goal, clear of obstacles; otherwise a plan
            only passes it.
        out_of_reach: why no plan can end at the goal; empty where one may.
        push: the push of a prop, where the goal is its place; otherwise None.
        note: what was not found at the goal, in words: no stance, or none with the share of the
            weight that is asked for. Empty where nothing is missing.

    Args:
        marionette: the puppet.
        start: where it begins; its driven coordinates may move.
        goal: a state, names and values (``{"elbow": 1.2}``), a :class:`Goal`, or a function of
            :class:`StateArrays` that returns distances.
        obstacles: in addition to the world's.
        name: of the problem.
        contact: ``"keep off"``: the puppets touch nothing but themselves; or
            ``{"touch": [("hand", "table")]}``, the pairs that may touch. What the goal asks to
            touch may, and so may props and what they lie on.
        tolerance: largest distance from the goal, in the goal's unit [rad and m for poses and
            states, m for points].
        hold: time for which the puppet must stay at the goal after the plan's end, with the inputs
            brought to rest [s]; 1 s where it is to touch something, to stand or to push a prop,
            otherwise 0.
        speed, acceleration: bounds of the driven coordinates, for all or by name [m/s, m/s^2].
        reserve: share of these bounds that plans leave unused, 0 to less than 1: feedback needs
            it to bring a puppet back to a plan that is at its bounds itself.
        ranges: name of a driven coordinate -> (low, high) [m].
        margin: least clearance [m]; not of pairs that may touch.
        slack: whether taut strings may go slack on the way. Plans in which none does depend less
            on how exactly they are followed.
        strings: whether strings are kept clear of obstacles too.
        self_collision: whether bodies of one puppet are kept clear of one another; those of
            different puppets and props of a scene always are.
        threads: that share the work; all processors by default.
        dt: step of the time-stepper [s].
        look: steps from one check for collisions and the goal to the next.
        segment: duration of constant accelerations [s], a whole number of looks and at most 10 s;
            five looks, 0.1 s, by default. Rollouts of ``"est-2007"`` last 1 to 5 times as long.
        objective: ``"time"``; ``"gentle"``, catches of strings and limits, and time;
            ``"acceleration"``, accelerations of the driven coordinates, and time; or an
            :class:`Objective`.

    Raises:
        StateError, UnknownNameError, FileError: the problem is not well defined, or a string is too
            short for the start.
        ValueError: a number out of range.
    """

    def __init__(
        self,
        marionette: Marionette,
        start: State,
        goal: GoalLike,
        obstacles: Iterable[Obstacle | HalfSpace | Mapping[str, Any]] = (),
        *,
        name: str = "",
        contact: ContactLike = KEEP_OFF,
        tolerance: float = 0.1,
        hold: float | None = None,
        speed: float | Mapping[str, float] = 0.5,
        acceleration: float | Mapping[str, float] = 2.0,
        reserve: float = 0.0,
        ranges: Mapping[str, tuple[float, float]] | None = None,
        margin: float = 0.0,
        slack: bool = True,
        strings: bool = True,
        self_collision: bool = False,
        threads: int | None = None,
        dt: float = RolloutOptions.dt,
        look: int = RolloutOptions.look,
        segment: float | None = None,
        objective: str | Objective = "gentle",
    ):
        threads = default_threads() if threads is None else threads
        options = RolloutOptions(tolerance, margin, slack, dt, look, threads=threads)
        options = options.with_segment(segment)
        self.objective = Objective.of(objective)
        check_start(marionette, start, "timestepping")
        if marionette.contacts is not None:
            every = standing(marionette.puppet, obstacles)
            solid = [o for o in every if not isinstance(o, HalfSpace)]
            marionette = marionette.with_obstacles(solid)
            obstacles = [o for o in every if isinstance(o, HalfSpace) and o.name != FLOOR]
        if not len(start.slip):
            start = start.replace(slip=np.zeros(len(marionette.tree.strings)))
        self.marionette, self.start, self.tolerance = marionette, start, tolerance
        self.name = name
        wanted = Goal.of(marionette, goal)
        self.touches = Touches(marionette, contact, wanted.touches, self_collision)
        self.goal = wanted.for_problem(self.touches, tolerance)
        clearance = Clearance(
            marionette,
            obstacles,
            strings=strings,
            self_collision=self_collision,
            free=self.touches.free,
        )
        self.bounds = Bounds.of(marionette, speed, acceleration, ranges or {})
        bounds = self.bounds.without(reserve) if reserve else self.bounds
        kept_off = ~self.touches.may
        self.rollouts = Rollouts(marionette, clearance, bounds, self.goal, options, kept_off)
        self.reason = _start_violation(start, self.rollouts, self.touches)
        self.distance = self.goal.of_start(self.root)
        self.push = push_of(self.goal, start, self.touches)
        stays = self.push is not None or bool(self.goal.touches)
        self.hold = (_HOLD if stays else 0.0) if hold is None else float(hold)
        check_not_negative(hold=self.hold)
        self.out_of_reach = out_of_reach(self.goal, tolerance) or self._out_of_touch
        self.equilibrium, self.note = False, ""
        if not self.infeasible:
            found = guidance(self.goal, start, self.rollouts, self.touches, self.push)
            self.rollouts.funnels, self.note = found.funnels, found.note
            self.equilibrium = found.equilibrium

    @property
    def _out_of_touch(self) -> str:
        """Why the goal's prop or touch is out of reach."""
        if self.push is not None and self.distance > self.tolerance and self.push.reason:
            return self.push.reason
        return too_far_to_touch(self.goal)

    @property
    def rest_K(self) -> ConfigK | None:
        """(n_qK,) driven coordinates with which the puppet rests on what it is to touch."""
        if not (self.equilibrium and self.goal.touches):
            return None
        return self.rollouts.funnels[0].q_K

    @property
    def infeasible(self) -> str:
        """Why no plan can exist; empty where one may."""
        return self.reason or self.out_of_reach

    @cached_property
    def drawn_marionette(self) -> Marionette:
        """The puppet among all obstacles except half-spaces, for pictures."""
        solid = tuple(o for o in self.rollouts.clearance.obstacles if not isinstance(o, HalfSpace))
        return self.marionette.with_obstacles(solid)

    @property
    def fingerprint(self) -> str:
        """Hash of everything that defines the problem."""
        rollouts, numbers, bounds = self.rollouts, self.goal.numbers, self.bounds
        options = rollouts.options
        # Plans without a reserve keep the hash that they have in files.
        planned = [] if rollouts.bounds is bounds else [rollouts.bounds.speed]
        solids, digest = rollouts.clearance.solids, hashlib.sha256()
        for a in (
            *self.root.parts.values(),
            self.marionette.p,
            self.marionette.winches,
            numbers.low,
            numbers.high,
            numbers.weight,
            numbers.v_D,
            numbers.v_K,
            numbers.at,
            numbers.place,
            numbers.place_high,
            bounds.speed,
            bounds.acceleration,
            bounds.low,
            bounds.high,
            *planned,
            solids.moving,
            solids.standing,
            solids.pairs,
            solids.string_radius,
        ):
            digest.update(np.ascontiguousarray(a).tobytes())
        plain = (
            self.tolerance,
            numbers.kind,
            numbers.link,
            numbers.speed_weight,
            numbers.driven_weight,
            options.margin,
            options.slack,
            options.dt,
            options.look,
            options.looks,
            self.marionette.coordinates.v_D,
            self.marionette.coordinates.v_K,
            rollouts.clearance.meshes.digest,
        )
        digest.update(repr(plain).encode())
        contacts = self.touches.contacts
        if contacts is not None or self.hold:
            digest.update(repr((self.hold, self.goal.share, self.goal.touches)).encode())
        if contacts is not None:
            parts = contacts.pairs, contacts.friction, contacts.restitution, self.touches.may
            for a in parts:
                digest.update(np.ascontiguousarray(a).tobytes())
        return digest.hexdigest()

    @property
    def root(self) -> StateArrays:
        """The start (1,), as the root of a tree."""
        return StateArrays.of(self.start)


def _start_violation(start: State, rollouts: Rollouts, touches: Touches) -> str:
    """Why no plan can begin at a state; empty where one can."""
    if met := touches.broken(start.q_D, start.q_K):
        a, b = met
        return f"at the start {a} touches {b}; they may with contact: {{touch: [[{a}, {b}]]}}"
    nearest = rollouts.clearance.nearest(start)
    if nearest is not None and nearest.distance < rollouts.options.margin:
        return f"at the start {nearest}; the margin is {rollouts.options.margin:g} m"
    bounds, table = rollouts.bounds, rollouts.marionette.coordinates
    for k, name in enumerate(table.q_K):
        if not bounds.low[k] <= start.q_K[k] <= bounds.high[k]:
            span = f"{bounds.low[k]:g} to {bounds.high[k]:g}"
            return f"{name} starts at {start.q_K[k]:g}, outside of its range {span}"
    for k, name in enumerate(table.v_K):
        if abs(start.v_K[k]) > bounds.speed[k]:
            return f"{name} starts at {start.v_K[k]:g}, faster than its bound {bounds.speed[k]:g}"
    return ""
