"""What is to be planned: everything that is the same for every seed, made ready once."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from fantoccini.errors import StateError
from fantoccini.marionette import Marionette, check_start
from fantoccini.motion import State
from fantoccini.planning.balance import balanced
from fantoccini.planning.clearance import Clearance
from fantoccini.planning.feasible import out_of_reach
from fantoccini.planning.funnels import funnels
from fantoccini.planning.goals import Goal, Rows
from fantoccini.planning.motions import Bounds, Motions
from fantoccini.planning.objective import Objective
from fantoccini.planning.obstacles import HalfSpace
from fantoccini.puppet import Obstacle
from fantoccini.runtime import Funnel, default_threads

DT = 0.004
"""Step of a planner's time-stepper, by default [s]."""

LOOK = 5
"""Steps from one look to the next, by default."""

_SEGMENT = 5
"""Looks of a segment, by default."""

_LONGEST = 10.0
"""Duration of a segment, at most [s]."""

_STEPS = 10_000
"""Steps of a segment, at most."""

_TRIAL = 20
"""Segments after which laws are compared."""

_HURRY = 0.6
"""By how much motions hurry that compare laws [s]."""

_BALANCED = 1e-6
"""What may be left of the forces on a puppet that hangs, beside its weight."""


class Problem:
    """A puppet, where it begins, where it is to be, and what is about it.

    Attributes:
        marionette: the puppet.
        name: of the problem; may be empty.
        start: where it begins.
        goal: where it is to be.
        tolerance: of the goal's distance.
        objective: what better plans have less of.
        motions: makes its motions.
        reason: why no plan can begin at the start; empty where one can.
        equilibrium: whether the puppet can hang at the goal, clear of obstacles; a plan passes one
            at which it cannot.
        out_of_reach: why no plan can end at the goal; empty where one may.

    Args:
        marionette: the puppet.
        start: where it begins; its driven coordinates may move.
        goal: a state, names and values (``{"elbow": 1.2}``), a :class:`Goal`, or a function of
            :class:`Rows` that gives distances.
        obstacles: more than the world has.
        name: of the problem.
        tolerance: of the goal's distance.
        speed, acceleration: largest of the driven coordinates, for all or by name [m/s, m/s^2].
        ranges: name of a driven coordinate -> (low, high) [m].
        margin: least clearance [m].
        slack: whether strings that pull may go slack on the way. Plans on which none does depend
            less on how exactly they are followed.
        strings: whether strings are kept clear of obstacles too.
        self_collision: whether bodies are kept clear of one another.
        threads: that share the work; all processors by default.
        dt: step of the time-stepper [s].
        look: steps from one look for collisions and the goal to the next.
        segment: for which accelerations hold [s], a whole number of looks and at most 10 s; five
            looks, 0.1 s, by default. Motions of ``"est-2007"`` last 1 to 5 times as long.
        objective: what better plans have less of: ``"time"``; ``"gentle"``, strings and limits that
            are caught, and time; ``"effort"``, accelerations of the driven coordinates, and time;
            or an :class:`Objective`.

    Raises:
        StateError, UnknownNameError, FileError: what is asked makes no sense, or a string is too
            short for the start.
        ValueError: a number out of range.
    """

    def __init__(
        self,
        marionette: Marionette,
        start: State,
        goal: Goal | State | Mapping[str, Any] | Any,
        obstacles: Iterable[Obstacle | HalfSpace | Mapping[str, Any]] = (),
        *,
        name: str = "",
        tolerance: float = 0.1,
        speed: float | Mapping[str, float] = 0.5,
        acceleration: float | Mapping[str, float] = 2.0,
        ranges: Mapping[str, tuple[float, float]] | None = None,
        margin: float = 0.0,
        slack: bool = True,
        strings: bool = True,
        self_collision: bool = False,
        threads: int | None = None,
        dt: float = DT,
        look: int = LOOK,
        segment: float | None = None,
        objective: str | Objective = "gentle",
    ):
        threads = default_threads() if threads is None else threads
        for what, value in (("tolerance", tolerance), ("dt", dt)):
            if not 0.0 < value < np.inf:
                raise ValueError(f"{what} is {value}; it must be finite and greater than 0")
        if not 0.0 <= margin < np.inf:
            raise ValueError(f"margin is {margin}; it must be a number of at least 0 [m]")
        for what, number in (("look", look), ("threads", threads)):
            if not number >= 1:
                raise ValueError(f"{what} is {number}; it must be at least 1")
        looks = _SEGMENT if segment is None else whole_looks(segment, dt * look)
        if looks * look > _STEPS:
            raise ValueError(
                f"a segment of {looks * look * dt:g} s takes {looks * look} steps of {dt:g} s; it "
                f"must be at most {_STEPS}"
            )
        self.objective = Objective.of(objective)
        check_start(marionette.model, start, "timestepping")
        if not len(start.slip):
            start = start.replace(slip=np.zeros(len(marionette.tree.strings)))
        self.marionette, self.start, self.tolerance = marionette, start, tolerance
        self.name = name
        self.goal = Goal.of(marionette, goal)
        clearance = Clearance(marionette, obstacles, strings=strings, self_collision=self_collision)
        bounds = Bounds.of(marionette, speed, acceleration, ranges or {})
        self.motions = Motions(
            marionette, clearance, bounds, self.goal, tolerance=tolerance, margin=margin,
            slack=slack, dt=dt, look=look, looks=looks,
            threads=threads,
        )  # fmt: skip
        self.reason = _blocked(start, self.motions)
        self.distance = self.goal.of_start(self.root)
        self.equilibrium = False
        self.out_of_reach = out_of_reach(self.goal, tolerance)
        if not self.hopeless:
            self.motions.funnels, self.equilibrium = _hanging_at(self.goal, start, self.motions)

    @property
    def hopeless(self) -> str:
        """Why there is nothing to search for; empty where there is."""
        return self.reason or self.out_of_reach

    @cached_property
    def stage(self) -> Marionette:
        """The puppet in a world with all the obstacles, to be drawn; half-spaces are left out."""
        solid = tuple(o for o in self.motions.clearance.obstacles if not isinstance(o, HalfSpace))
        return Marionette(self.marionette.model.with_obstacles(solid))

    @property
    def fingerprint(self) -> str:
        """Of all that decides what a plan is: a plan of another problem is none of this one."""
        motions, numbers, bounds = self.motions, self.goal.numbers, self.motions.bounds
        solids, digest = motions.clearance.solids, hashlib.sha256()
        for a in (
            *self.root.parts.values(), self.marionette.p, self.marionette.winches,
            numbers.low, numbers.high, numbers.weight, numbers.v_D, numbers.v_K, numbers.at,
            numbers.place, numbers.place_high, bounds.speed, bounds.acceleration, bounds.low,
            bounds.high, solids.moving, solids.standing, solids.pairs, solids.string_radius,
        ):  # fmt: skip
            digest.update(np.ascontiguousarray(a).tobytes())
        plain = (
            self.tolerance, numbers.kind, numbers.link, numbers.speed_weight,
            numbers.driven_weight, motions.margin, motions.slack, motions.dt, motions.look,
            motions.looks, self.marionette.coordinates.v_D, self.marionette.coordinates.v_K,
            motions.clearance.meshes.digest,
        )  # fmt: skip
        digest.update(repr(plain).encode())
        return digest.hexdigest()

    @property
    def root(self) -> Rows:
        """The start as the one row of a tree."""
        return Rows.of(self.start)


def _hanging_at(goal: Goal, start: State, motions: Motions) -> tuple[list[Funnel], bool]:
    """The laws that lead to where the puppet hangs at a goal, or nearest to it.

    None of them where the driven coordinates cannot be there. And whether that is at the goal.
    """
    marionette, bounds = motions.marionette, motions.bounds
    q_D, q_K, left = balanced(marionette, goal, start, bounds.moves)
    if goal.q_K is not None:
        q_K = np.where(bounds.moves, goal.q_K, start.q_K)
    # Of a length that a drive winds it is not known yet whether the string just reaches.
    wound = any(string.wound_length for string in marionette.tree.strings)
    if wound or left > _BALANCED * marionette.weight or goal.q_K is not None:
        try:
            at = marionette.rest(start.replace(q_D=q_D, q_K=q_K))
        except StateError:
            return [], False
        q_D, q_K = at.q_D, at.q_K
    if not np.all((q_K >= bounds.low) & (q_K <= bounds.high)):
        return [], False
    motions.funnels = funnels(
        marionette, q_D, q_K, bounds.moves, motions.options, motions.looks, motions.threads
    )
    chosen = _best_of(motions, start)
    at_rest = Rows.of(start.replace(q_D=q_D, q_K=q_K, v_D=0.0 * start.v_D, v_K=0.0 * start.v_K))
    there = goal.distance(at_rest)[0] <= motions.inner
    return [chosen], bool(there and motions.clearance.at(q_D, q_K) >= motions.margin)


def _best_of(motions: Motions, start: State) -> Funnel:
    """The law that comes nearest to the goal from the start, as if nothing were about."""
    n, n_K = len(motions.funnels), motions.marionette.coordinates.n_vK
    made = motions.where(tolerance=-1.0, free=True).sweep(
        Rows.of(start), np.zeros(n), np.zeros((n, _TRIAL, n_K)), given=np.zeros(n),
        which=np.arange(n), reach=np.full(n, _HURRY),
    )  # fmt: skip
    late = np.where(made.looks > 0, made.distance, np.inf)[:, _TRIAL // 2 :]
    return motions.funnels[int(np.argmin(np.mean(late, axis=1)))]


def whole_looks(segment: float, interval: float = DT * LOOK) -> int:
    """The looks of a segment, both in seconds.

    Raises:
        ValueError: it is none, longer than 10 s, or not a whole number of them.
    """
    if _LONGEST < segment < np.inf:
        raise ValueError(f"segment is {segment} s; it must be at most {_LONGEST:g} s")
    looks = round(segment / interval) if 0.0 < segment < np.inf else 0
    if looks < 1 or abs(segment - looks * interval) > 1e-9 * segment:
        raise ValueError(
            f"segment is {segment} s; it must be a whole number of looks, which are {interval:g} s "
            "apart"
        )
    return looks


def _blocked(start: State, motions: Motions) -> str:
    """Why no plan can begin at a state; nothing where one can."""
    nearest = motions.clearance.nearest(start)
    if nearest is not None and nearest.distance < motions.margin:
        return f"at the start {nearest}; the margin is {motions.margin:g} m"
    bounds, table = motions.bounds, motions.marionette.coordinates
    for k, name in enumerate(table.q_K):
        if not bounds.low[k] <= start.q_K[k] <= bounds.high[k]:
            span = f"{bounds.low[k]:g} to {bounds.high[k]:g}"
            return f"{name} starts at {start.q_K[k]:g}, outside of its range {span}"
    for k, name in enumerate(table.v_K):
        if abs(start.v_K[k]) > bounds.speed[k]:
            return f"{name} starts at {start.v_K[k]:g}, faster than its bound {bounds.speed[k]:g}"
    return ""
