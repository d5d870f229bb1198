"""Planning problems: tasks prepared once for searches with any seed.

q_K are the driven coordinates, the ends and lengths of strings, and q_D the dynamic ones. A slack
string does not pull.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from fantoccini.base import ConfigK, StateError, check_not_negative
from fantoccini.control.problems.feasible import out_of_reach, too_far_to_touch
from fantoccini.control.problems.guidance import guidance
from fantoccini.control.problems.pushing import find_push
from fantoccini.control.problems.rollouts import Rollouts
from fantoccini.control.tasks import (
    KEEP_OFF,
    Bounds,
    ContactLike,
    DrivenBounds,
    Goal,
    GoalLike,
    Objective,
    PlanConditions,
    RolloutOptions,
    StateArrays,
    Task,
    TouchRules,
)
from fantoccini.dynamics.clearance import Clearance, HalfSpace
from fantoccini.dynamics.compiled import check_start
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import Obstacle
from fantoccini.motion import State

_DEFAULT_HOLD = 1.0
"""Default time for which puppets that touch or stand, and pushed props, must stay [s]."""


class Problem:
    """A task for a search: a puppet, its start, its goal and its obstacles.

    Attributes:
        task: the planned task.
        marionette: see below; if it can touch something, with all obstacles but half-spaces.
        name, start, goal, tolerance, hold: see below.
        max_duration: longest duration of plans [s].
        touches: allowed and required contact pairs.
        objective: cost that better plans reduce.
        bounds: bounds of the driven coordinates, with the part that is reserved for feedback.
        rollouts: batch simulations from many states, within the bounds without that part.
        distance: distance of the start from the goal.
        reason: reason why no plan can begin at the start; may be empty.
        rests_at_goal: whether the puppet can rest at the goal, clear of obstacles; otherwise plans
            pass through it.
        out_of_reach: reason why no plan can end at the goal; may be empty.
        push: push of a prop, if the goal is a place for it; otherwise None.
        note: missing stance, or missing share of the weight on it, in words; may be empty.

    Args:
        marionette: the puppet.
        start: initial state; its driven coordinates may move.
        goal: a state, names and values (``{"elbow": 1.2}``), a :class:`Goal`, or a function of
            :class:`StateArrays` that returns distances.
        obstacles: obstacles in addition to the world's.
        name: name of the problem.
        contact, tolerance, hold, slack, objective, rollouts: see
            :class:`fantoccini.control.PlanConditions`.
        bounds: bounds of the driven coordinates, by default speeds of 0.5 m/s and accelerations of
            2 m/s^2; coordinates that a mapping does not name hold still. ``clearance`` is 0
            by default and does not apply to pairs that may touch. It always applies to bodies of
            different puppets and props of a scene; to bodies of one puppet with ``own_body``. Plans
            support no other bounds.

    Raises:
        StateError, UnknownNameError, FileError: ill-defined problem, or a string that is too short
            for the start.
        ValueError: number out of range.
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
        bounds: Bounds | None = None,
        slack: bool = True,
        objective: str | Objective = "gentle",
        rollouts: RolloutOptions | None = None,
    ):
        options = RolloutOptions() if rollouts is None else rollouts
        conditions = PlanConditions(tolerance, hold, contact, slack, objective, options)
        task = Task(
            marionette,
            start,
            bounds=bounds or Bounds(),
            end=goal,
            name=name,
            obstacles=tuple(obstacles),
            conditions=conditions,
        )
        self._prepare(task)

    @classmethod
    def from_task(cls, task: Task) -> Problem:
        """The problem of a task. A state at its end counts with its dynamic part and velocities.

        Args:
            task: the task; its tracks and smoothness are ignored.

        Raises:
            StateError: task without an end, or with parts that plans do not support.
        """
        problem = cls.__new__(cls)
        problem._prepare(task)
        return problem

    def _prepare(self, task: Task) -> None:
        for name in ("periodic", "touches", "parameters"):
            if getattr(task, name):
                raise StateError(f"the task has {name}, which plans do not support; give an end")
        if task.end is None:
            raise StateError(
                "the task has no end; needed: a state, names and values, a Goal or a function"
            )
        bounds, conditions, options = task.bounds, task.conditions, task.conditions.rollouts
        margin, tolerance = bounds.clearance or 0.0, conditions.tolerance
        check_not_negative(clearance=margin)
        self.objective = Objective.of(conditions.objective)
        check_start(task.marionette, task.x0, "timestepping")
        (marionette, obstacles), start = task.world, task.x0
        if not len(start.slip):
            start = start.replace(slip=np.zeros(len(marionette.tree.strings)))
        self.task, self.marionette, self.start, self.tolerance = task, marionette, start, tolerance
        self.name, self.max_duration = task.name, task.max_duration
        goal = Goal.of(marionette, task.end)
        self.touches = TouchRules(marionette, conditions.contact, goal.touches, bounds.own_body)
        self.goal = goal.for_problem(self.touches, tolerance)
        clearance = Clearance(
            marionette,
            obstacles,
            strings=options.strings,
            self_collision=bounds.own_body,
            free=self.touches.allowed_pairs,
        )
        self.bounds = DrivenBounds.from_bounds(marionette, bounds)
        self.rollouts = Rollouts(
            marionette,
            clearance,
            self.bounds.reduced(options.reserve) if options.reserve else self.bounds,
            self.goal,
            options,
            tolerance=tolerance,
            margin=margin,
            slack=conditions.slack,
            forbidden_pairs=~self.touches.may_touch,
        )
        self.reason = _start_violation(start, self.rollouts, self.touches)
        self.distance = self.goal.start_distance(self.root)
        self.push = find_push(self.goal, start, self.touches)
        must_stay = self.push is not None or bool(self.goal.touches)
        default_hold = _DEFAULT_HOLD if must_stay else 0.0
        self.hold = default_hold if conditions.hold is None else float(conditions.hold)
        self.out_of_reach = out_of_reach(self.goal, tolerance) or self._unreachable_touch
        self.rests_at_goal, self.note = False, ""
        if not self.infeasible:
            guidance_at_goal = guidance(self.goal, start, self.rollouts, self.touches, self.push)
            self.rollouts.laws, self.note = guidance_at_goal.laws, guidance_at_goal.note
            self.rests_at_goal = guidance_at_goal.rests_at_goal

    def __reduce__(self) -> tuple[Any, ...]:
        return Problem.from_task, (self.task,)

    @property
    def _unreachable_touch(self) -> str:
        """The reason why the goal's prop or touch is out of reach."""
        if self.push is not None and self.distance > self.tolerance and self.push.reason:
            return self.push.reason
        return too_far_to_touch(self.goal)

    @property
    def rest_K(self) -> ConfigK | None:
        """(n_qK,) driven coordinates with which the puppet rests on its required touches."""
        if not (self.rests_at_goal and self.goal.touches):
            return None
        return self.rollouts.laws[0].q_K

    @property
    def infeasible(self) -> str:
        """Reason why no plan can exist; may be empty."""
        return self.reason or self.out_of_reach

    @cached_property
    def drawn_marionette(self) -> Marionette:
        """The puppet with all obstacles except half-spaces, for pictures."""
        solids = tuple(o for o in self.rollouts.clearance.obstacles if not isinstance(o, HalfSpace))
        return self.marionette.with_obstacles(solids)

    @property
    def fingerprint(self) -> str:
        """Hash of everything that defines the problem."""
        rollouts, numbers, bounds = self.rollouts, self.goal.numbers, self.bounds
        options = rollouts.options
        # Plans without a reserve keep the hash that existing files have.
        planning_speed = [] if rollouts.bounds is bounds else [rollouts.bounds.speed]
        solids, digest = rollouts.clearance.solids, hashlib.sha256()
        for array in (
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
            *planning_speed,
            solids.moving,
            solids.standing,
            solids.pairs,
            solids.string_radius,
        ):
            digest.update(np.ascontiguousarray(array).tobytes())
        values = (
            self.tolerance,
            numbers.kind,
            numbers.link,
            numbers.speed_weight,
            numbers.driven_weight,
            rollouts.margin,
            rollouts.slack,
            options.dt,
            options.steps_per_check,
            options.n_checks,
            self.marionette.coordinates.v_D,
            self.marionette.coordinates.v_K,
            rollouts.clearance.meshes.digest,
        )
        digest.update(repr(values).encode())
        if np.isfinite(self.max_duration):
            digest.update(repr(self.max_duration).encode())
        contacts = self.touches.contacts
        if contacts is not None or self.hold:
            digest.update(repr((self.hold, self.goal.share, self.goal.touches)).encode())
        if contacts is not None:
            parts = contacts.pairs, contacts.friction, contacts.restitution, self.touches.may_touch
            for array in parts:
                digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()

    @property
    def root(self) -> StateArrays:
        """The start (1,), as the root of a search tree."""
        return StateArrays.of(self.start)


def _start_violation(start: State, rollouts: Rollouts, touches: TouchRules) -> str:
    """Reason why no plan can begin at a state; may be empty."""
    if pair := touches.forbidden_touch(start.q_D, start.q_K):
        first, second = pair
        contact = f"contact: {{touch: [[{first}, {second}]]}}"
        return f"at the start {first} touches {second}; they may with {contact}"
    nearest = rollouts.clearance.nearest(start)
    if nearest is not None and nearest.distance < rollouts.margin:
        return f"at the start {nearest}; the margin is {rollouts.margin:g} m"
    bounds, table = rollouts.bounds, rollouts.marionette.coordinates
    for k, name in enumerate(table.q_K):
        if not bounds.low[k] <= start.q_K[k] <= bounds.high[k]:
            span = f"{bounds.low[k]:g} to {bounds.high[k]:g}"
            return f"{name} starts at {start.q_K[k]:g}, outside of its range {span}"
    for k, name in enumerate(table.v_K):
        if abs(start.v_K[k]) > bounds.speed[k]:
            return f"{name} starts at {start.v_K[k]:g}, faster than its bound {bounds.speed[k]:g}"
    return ""
