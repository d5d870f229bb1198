"""Planning problems: everything that is the same for every seed, prepared once."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fantoccini.arrays import check_not_negative
from fantoccini.errors import StateError
from fantoccini.marionette import Marionette, check_start
from fantoccini.motion import State
from fantoccini.planning.balance import balanced
from fantoccini.planning.clearance import Clearance
from fantoccini.planning.feasible import out_of_reach
from fantoccini.planning.funnels import funnels, servo
from fantoccini.planning.goals import Goal, GoalLike
from fantoccini.planning.objective import Objective
from fantoccini.planning.obstacles import HalfSpace, standing
from fantoccini.planning.rollouts import Bounds, RolloutOptions, Rollouts
from fantoccini.planning.state_arrays import StateArrays
from fantoccini.planning.touches import KEEP_OFF, ContactLike, Touches
from fantoccini.puppet import Obstacle
from fantoccini.puppet.contact import FLOOR
from fantoccini.runtime import Funnel, default_threads


@dataclass(frozen=True)
class _Tolerances:
    """Tolerances for the equilibrium at the goal and the choice of a feedback law."""

    trial_segments: int = 20
    """Segments after which feedback laws are compared."""
    trial_lead_time: float = 0.6
    """Time by which their references run ahead in that comparison [s]."""
    max_unbalanced: float = 1e-6
    """Force left on a puppet in equilibrium, relative to its weight."""


_TOLERANCES = _Tolerances()
_HOLD = 1.0
"""Time for which a puppet that is to stand must stay at the goal [s]."""


class Problem:
    """A puppet, its start, its goal and its obstacles.

    Attributes:
        marionette, name, start, goal, tolerance, hold: see below.
        touches: what may touch what.
        objective: cost that better plans reduce.
        rollouts: that simulate from many states at once.
        distance: of the start from the goal.
        reason: why no plan can begin at the start; empty where one can.
        equilibrium: whether the puppet can rest at the goal, clear of obstacles; otherwise a plan
            only passes it.
        out_of_reach: why no plan can end at the goal; empty where one may.

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
            brought to rest [s]; 1 s where it is to stand, otherwise 0.
        speed, acceleration: bounds of the driven coordinates, for all or by name [m/s, m/s^2].
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
        check_start(marionette.model, start, "timestepping")
        every = standing(marionette.puppet, obstacles)
        spaces = [o for o in every if isinstance(o, HalfSpace) and o.name != FLOOR]
        solid = [o for o in every if not isinstance(o, HalfSpace)]
        marionette = Marionette(marionette.model.with_obstacles(solid))
        if not len(start.slip):
            start = start.replace(slip=np.zeros(len(marionette.tree.strings)))
        self.marionette, self.start, self.tolerance = marionette, start, tolerance
        self.name = name
        wanted = Goal.of(marionette, goal)
        self.touches = Touches(marionette, contact, wanted.touches, self_collision)
        self.goal = wanted.for_problem(self.touches, tolerance)
        self.hold = _HOLD if hold is None and wanted.share is not None else hold or 0.0
        check_not_negative(hold=self.hold)
        clearance = Clearance(
            marionette, spaces, strings=strings, self_collision=self_collision,
            free=self.touches.free,
        )  # fmt: skip
        bounds = Bounds.of(marionette, speed, acceleration, ranges or {})
        kept_off = ~self.touches.may
        self.rollouts = Rollouts(marionette, clearance, bounds, self.goal, options, kept_off)
        self.reason = _start_violation(start, self.rollouts)
        self.distance = self.goal.of_start(self.root)
        self.equilibrium = False
        self.out_of_reach = out_of_reach(self.goal, tolerance)
        if not self.infeasible:
            self.rollouts.funnels, self.equilibrium = _hanging_at(
                self.goal, start, self.rollouts, self.touches
            )

    @property
    def infeasible(self) -> str:
        """Why no plan can exist; empty where one may."""
        return self.reason or self.out_of_reach

    @cached_property
    def drawn_marionette(self) -> Marionette:
        """The puppet among all obstacles except half-spaces, for pictures."""
        solid = tuple(o for o in self.rollouts.clearance.obstacles if not isinstance(o, HalfSpace))
        return Marionette(self.marionette.model.with_obstacles(solid))

    @property
    def fingerprint(self) -> str:
        """Hash of everything that defines the problem."""
        rollouts, numbers, bounds = self.rollouts, self.goal.numbers, self.rollouts.bounds
        options = rollouts.options
        solids, digest = rollouts.clearance.solids, hashlib.sha256()
        for a in (
            *self.root.parts.values(), self.marionette.p, self.marionette.winches,
            numbers.low, numbers.high, numbers.weight, numbers.v_D, numbers.v_K, numbers.at,
            numbers.place, numbers.place_high, bounds.speed, bounds.acceleration, bounds.low,
            bounds.high, solids.moving, solids.standing, solids.pairs, solids.string_radius,
        ):  # fmt: skip
            digest.update(np.ascontiguousarray(a).tobytes())
        plain = (
            self.tolerance, numbers.kind, numbers.link, numbers.speed_weight,
            numbers.driven_weight, options.margin, options.slack, options.dt, options.look,
            options.looks, self.marionette.coordinates.v_D, self.marionette.coordinates.v_K,
            rollouts.clearance.meshes.digest, self.hold, self.goal.share, self.goal.touches,
            sorted(map(sorted, self.touches.free)),
        )  # fmt: skip
        digest.update(repr(plain).encode())
        return digest.hexdigest()

    @property
    def root(self) -> StateArrays:
        """The start (1,), as the root of a tree."""
        return StateArrays.of(self.start)


def _hanging_at(
    goal: Goal, start: State, rollouts: Rollouts, touches: Touches
) -> tuple[list[Funnel], bool]:
    """The feedback law that leads to the equilibrium nearest to the goal.

    Returns:
        The law, or none where the driven coordinates cannot be there; and whether the equilibrium
        is at the goal and clear.
    """
    marionette, bounds = rollouts.marionette, rollouts.bounds
    q_D, q_K, left = balanced(marionette, goal, start, bounds.moves)
    if goal.q_K is not None:
        q_K = np.where(bounds.moves, goal.q_K, start.q_K)
    # Lengths wound by a drive are not solved for in `balanced`.
    wound = any(string.wound_length for string in marionette.tree.strings)
    if wound or left > _TOLERANCES.max_unbalanced * marionette.weight or goal.q_K is not None:
        try:
            at = marionette.rest(start.replace(q_D=q_D, q_K=q_K))
        except StateError:
            return [], False
        q_D, q_K = at.q_D, at.q_K
    if not np.all((q_K >= bounds.low) & (q_K <= bounds.high)):
        return [], False
    alone = replace(rollouts.run_options, contacts=None)
    rollouts.funnels = funnels(marionette, q_D, q_K, bounds.moves, alone, rollouts.options)
    if touches.expected:
        segment = rollouts.options.segment
        rollouts.funnels.append(servo(marionette, q_D, q_K, bounds.moves, segment))
    chosen = _best_of(rollouts, start)
    at_rest = start.replace(q_D=q_D, q_K=q_K, v_D=0.0 * start.v_D, v_K=0.0 * start.v_K)
    there = goal.distance(StateArrays.of(at_rest))[0] <= rollouts.stop_distance
    return [chosen], bool(there and rollouts.clearance.at(q_D, q_K) >= rollouts.options.margin)


def _best_of(rollouts: Rollouts, start: State) -> Funnel:
    """The feedback law that comes nearest to the goal from the start, without obstacles."""
    n, segments = len(rollouts.funnels), _TOLERANCES.trial_segments
    which, none = np.arange(n), np.zeros(n, dtype=int)
    made = rollouts.where(tolerance=-1.0, free=True).simulate(
        StateArrays.of(start), none, np.zeros((n, segments, rollouts.marionette.coordinates.n_vK)),
        n_given=none, funnel=which, lead_time=np.full(n, _TOLERANCES.trial_lead_time),
    )  # fmt: skip
    late = np.where(made.looks > 0, made.distance, np.inf)[:, segments // 2 :]
    return rollouts.funnels[int(np.argmin(np.mean(late, axis=1)))]


def _start_violation(start: State, rollouts: Rollouts) -> str:
    """Why no plan can begin at a state; empty where one can."""
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
