"""Feedback along a plan: a time-varying linear-quadratic regulator, asked once a segment.

    acc_K = planned_k - K_k z_k,      z = (dq_D, dv_D, dq_K, dv_K) from the plan's node k
    min z_m'Q_m z_m + sum_k z_k'Q z_k + effort |dacc_K|^2,      z_k+1 = A_k z_k + B_k dacc_K

A_k and B_k are those of the strings that pull (:mod:`fantoccini.planning.modes`), of changes that
leave taut strings taut; in segments where strings or limits are caught or let go they are exact,
with the saltation of every catch (:mod:`fantoccini.planning.saltation`), if there is such a
derivative.

Gains are indexed by event: the law is that of the mode that the puppet is in, the set of strings
that pull. Where the plan is in another one at that time, because the puppet's string is caught or
let go earlier or later than the plan's, the state that z is measured from and K are those of the
nearest part of the plan with the puppet's mode, led on beyond its event
(:mod:`fantoccini.planning.modes`); where there is none near, those of the time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.arrays import Array, MaskRows
from fantoccini.errors import StateError, Status
from fantoccini.marionette import (
    ActiveSet,
    Evaluation,
    Marionette,
    Method,
    MethodName,
    TimeStepping,
    as_method,
)
from fantoccini.motion import State, tangent
from fantoccini.planning.check import beginning
from fantoccini.planning.funnels import regulators
from fantoccini.planning.goals import Rows
from fantoccini.planning.modes import Beyond, Course, away, mode_slopes
from fantoccini.planning.problem import Problem
from fantoccini.planning.saltation import caught_slopes
from fantoccini.planning.slopes import taut

if TYPE_CHECKING:
    from fantoccini.planning.result import PlanResult

_SPEED = 0.1
"""Weight of velocities beside positions [s]."""

_EFFORT = 0.03
"""Weight of accelerations beside positions [s^4]."""

_ARRIVE = 100.0
"""Weight of what the goal asks for beside what is asked on the way."""

_WINDOW = 3
"""How far modes are led beyond their events, in segments."""

_STEP = 1e-6
"""Of differences of what the goal lacks [rad or m]."""

Push = Callable[[float], Array]
"""Time -> (n_vD,) forces on the dynamic coordinates [N or N m]."""


@dataclass(frozen=True, eq=False)
class Followed:
    """A plan that was followed.

    Attributes:
        t: (T,) at every look [s].
        states: (T,) there.
        acceleration: (segments, n_vK) that was asked for.
        distance: from the goal at the end.
        clearance: the least on the way, at looks [m].
        arrives: whether it ends within the tolerance and touches nothing.
        status: how the run ended.
    """

    t: Array
    states: Rows
    acceleration: Array
    distance: float
    clearance: float
    arrives: bool
    status: Status

    @classmethod
    def of(
        cls, problem: Problem, states: list[State], acceleration: Array, status: Status
    ) -> Followed:
        """What states of a run say.

        Args:
            problem: what was planned.
            states: at looks.
            acceleration: (segments, n_vK) that was asked for.
            status: how the run ended.
        """
        rows = Rows.of(*states)
        distance = float(problem.goal.distance(rows[-1:])[0])
        clearance = float(np.min(problem.motions.clearance.at(rows.q_D, rows.q_K)))
        arrives = status is Status.DONE and distance <= problem.tolerance and clearance >= 0.0
        t = np.array([x.t for x in states])
        return cls(t, rows, acceleration, distance, clearance, bool(arrives), status)


@dataclass(frozen=True, eq=False)
class Feedback:
    """The law that follows a plan. Made by :meth:`along`.

    Attributes:
        plan: what is followed.
        nodes: (m + 1,) states of the plan.
        looks: (m,) of its segments.
        planned: (m, n_vK) accelerations [m/s^2 or rad/s^2].
        A, B: (m, n_z, n_z), (m, n_z, n_vK) slopes of its segments.
        gains: (m, n_vK, n_z).
        pulling: (m + 1, n_strings) bool, the strings that pull after the nodes.
        beyond: what a puppet is compared with that is in another mode.
    """

    plan: PlanResult
    nodes: Rows
    looks: Array
    planned: Array
    A: Array
    B: Array
    gains: Array
    pulling: MaskRows
    beyond: Beyond

    @classmethod
    def along(
        cls,
        plan: PlanResult,
        *,
        effort: float = _EFFORT,
        arrive: float = _ARRIVE,
        window: int = _WINDOW,
    ) -> Feedback:
        """The law for a plan.

        Args:
            plan: what is to be followed.
            effort: weight of accelerations beside positions [s^4].
            arrive: weight of the goal's residuals at the end beside positions on the way.
            window: how many segments before and after its part of the plan a mode is known; with 0
                gains go by time alone.

        Raises:
            ValueError: the plan has no motion, a weight that is not greater than 0, or a negative
                window.
        """
        path, tree, motions = list(plan.path), plan.tree, plan.motions
        if len(path) < 2:
            raise ValueError("the plan has no motion that could be followed")
        for name, value in (("effort", effort), ("arrive", arrive)):
            if not 0.0 < value < np.inf:
                raise ValueError(f"{name} is {value}; it must be finite and greater than 0")
        if not window >= 0:
            raise ValueError(f"window is {window}; it must be at least 0")
        nodes, looks, planned = tree.rows[path], tree.looks[path[1:]], tree.acceleration[path[1:]]
        marionette = plan.problem.marionette
        table, durations = marionette.coordinates, looks * motions.interval
        pulling = _pulling(plan)
        onto = taut(marionette, nodes[:-1], pulling[:-1])
        A, B = mode_slopes(marionette, nodes[:-1], pulling[:-1], planned, durations, onto)
        events = np.any(pulling[1:] != pulling[:-1], axis=1) | (tree.catches[path[1:]] > 0)
        for k in np.flatnonzero(events):
            exact = caught_slopes(
                marionette, nodes[k], planned[k], durations[k], pulling[k]
            )
            if exact is not None:
                A[k], B[k] = exact
        size = A.shape[1]
        Q = np.diag(np.where(np.arange(size) < table.n_vD, 1.0, _SPEED**2))
        moves, gains = motions.bounds.moves, np.zeros((len(looks), table.n_vK, size))
        R = effort * np.eye(moves.sum())
        gains[:, moves], P = regulators(
            A, B[:, :, moves], Q, R, Q + arrive * _wanted(plan, nodes[-1])
        )
        course = Course(
            marionette, nodes, pulling, durations, planned, A, B, gains, P, Q, R, moves
        )
        beyond = Beyond.of(course, window)
        return cls(plan, nodes, looks, planned, A, B, gains, pulling, beyond)

    def acceleration(self, k: int, x: State) -> Array:
        """(n_vK,) that segment k is to have from a state on, within the bounds of the problem.

        After the last segment the puppet is held at the goal by the law that leads there, where
        the problem has one; otherwise the driven coordinates stop. Before a range of a driven
        coordinate ends it is slowed down, so that a string is never wound in to nothing.

        Args:
            k: which segment; from the plan's first.
            x: where the puppet is.
        """
        motions = self.plan.motions
        bounds, T = motions.bounds, motions.looks * motions.interval
        if k < len(self.looks):
            T = self.looks[k] * motions.interval
            node, K = self.reference(k, x)
            asked = self.planned[k] - K @ self.away(node, x)
        elif motions.funnels:
            funnel, still = motions.funnels[0], np.zeros_like
            there = Rows(funnel.q_D, still(x.v_D), x.slip, funnel.q_K, still(x.v_K))
            asked = -funnel.gains @ self.away(there, x)
        else:
            asked = -x.v_K / T
        slowest, fastest = self._kept_within(x, T)
        asked = np.clip(asked, (slowest - x.v_K) / T, (fastest - x.v_K) / T)
        return np.clip(asked, -bounds.acceleration, bounds.acceleration)

    def reference(self, k: int, x: State) -> tuple[Rows, Array]:
        """What a state is compared with in segment k, and the gains (n_vK, n_z) on that.

        Args:
            k: which segment.
            x: where the puppet is.
        """
        pulling = self.mode(x)
        e = self.beyond.nearest(k, pulling)
        if e is None or np.array_equal(pulling, self.pulling[k]):
            return self.nodes[k], self.gains[k]
        return self.beyond.nodes[e], self.beyond.gains[e]

    def mode(self, x: State) -> MaskRows:
        """(n_strings,) bool, the strings that pull.

        They are those that are closed: taut in the state's mode, or at their length and at rest.
        """
        marionette, strings = self.plan.problem.marionette, self.pulling.shape[1]
        closed = ActiveSet.of(marionette.model, x, Evaluation.of(marionette.model, x))
        return (closed.held | closed.slipping)[:strings]

    def _kept_within(self, x: State, T: float) -> tuple[Array, Array]:
        """(n_vK,) velocities, least and greatest, from which driven coordinates stop in time.

        v after T leaves room to brake, in whole segments T_1, before a range ends at d::

            v^2 / (2 a) + v T_1 / 2 <= d - (v_K + v) T / 2
        """
        motions, table = self.plan.motions, self.plan.problem.marionette.coordinates
        bounds, mean = motions.bounds, 0.5 * (T + motions.looks * motions.interval)
        fastest, slowest = bounds.speed.copy(), -bounds.speed
        for q, v in table.scalars_K:
            a = max(float(bounds.acceleration[v]), 1e-9)

            def most(d: float, toward: float, a: float = a) -> float:
                return a * (np.sqrt(max(mean**2 + 2.0 / a * (d - 0.5 * toward * T), 0.0)) - mean)

            fastest[v] = min(fastest[v], most(bounds.high[q] - x.q_K[q], x.v_K[v]))
            slowest[v] = max(slowest[v], -most(x.q_K[q] - bounds.low[q], -x.v_K[v]))
        return slowest, np.maximum(fastest, slowest)

    def away(self, node: Rows, x: State) -> Array:
        """(n_z,) tangent vector from a state of the plan to another."""
        return away(self.plan.problem.marionette, node, x)

    def run(
        self,
        x0: State | None = None,
        marionette: Marionette | None = None,
        method: Method | MethodName = "timestepping",
        *,
        push: Push | None = None,
        hold: float = 0.0,
        closed: bool = True,
    ) -> Followed:
        """Follows the plan.

        Args:
            x0: where the puppet is; at the plan's start by default.
            marionette: what is led, where that is not the puppet that was planned for.
            method: of the simulation; ``timestepping`` has the planner's step.
            push: forces beside those of the plan, held from look to look.
            hold: how long to stay at the goal afterwards [s].
            closed: whether the law is asked; otherwise the plan's accelerations are made.

        Raises:
            StateError: another puppet has other coordinates, or a run cannot begin at ``x0``.
        """
        problem, interval = self.plan.problem, self.plan.motions.interval
        led = problem.marionette if marionette is None else marionette
        names = [(m.coordinates.v_D, m.coordinates.v_K) for m in (led, problem.marionette)]
        if names[0] != names[1]:
            raise StateError("the puppet that is led has other coordinates than the plan's")
        if method == "timestepping":
            method = TimeStepping(dt=self.plan.motions.dt, extrapolate=False)
        chosen = as_method(method)
        x = beginning(problem, chosen.name) if x0 is None else x0
        stepper = led.stepper(x, chosen)
        m, whole = len(self.looks), self.plan.motions.looks
        more = int(np.ceil(hold / (whole * interval) - 1e-9))
        states, asked = [x], []
        for k in np.repeat(np.arange(m + more), np.append(self.looks, np.full(more, whole))):
            if len(asked) <= k:
                law = closed or k >= m
                asked.append(self.acceleration(k, x) if law else self.planned[k])
            u_D = None if push is None else push(x.t)
            x = stepper.advance(interval, asked[-1], u_D=u_D, throw=False)
            states.append(x)
            if not stepper.arrived:
                break
        return Followed.of(problem, states, np.array(asked), stepper.status)


def _pulling(plan: PlanResult) -> MaskRows:
    """(m + 1, n_strings) bool, whether strings pull in the step after a node."""
    run, times = plan.trajectory, plan.start.t + plan.tree.time[list(plan.path)]
    # Tensions of a time step stand at its end.
    after = np.searchsorted(run.t, times + 0.5 * plan.motions.dt)
    pulls = run.tension.values[np.minimum(after, len(run.t) - 1)] != 0.0
    return pulls | plan.problem.marionette.model.two_sided[: pulls.shape[1]]


def _wanted(plan: PlanResult, end: Rows) -> Array:
    """(n_z, n_z) weights of what the goal asks for at the plan's end: J'J of its residuals."""
    goal, table = plan.goal, plan.problem.marionette.coordinates
    n, k = table.n_vD, table.n_vK
    steps = _STEP * np.concatenate([np.eye(n + k), -np.eye(n + k)])
    q_D = tangent.moved(table.scalars_D, table.quaternions_D, end.q_D, steps[:, :n])
    q_K = tangent.moved(table.scalars_K, table.quaternions_K, end.q_K, steps[:, n:])
    v_D, slip, v_K = (np.tile(a, (len(steps), 1)) for a in (end.v_D, end.slip, end.v_K))
    lacking = goal.residuals(Rows(q_D, v_D, slip, q_K, v_K))
    J = np.zeros((lacking.shape[1], 2 * (n + k)))
    at = np.concatenate([np.arange(n), 2 * n + np.arange(k)])
    J[:, at] = (lacking[: n + k] - lacking[n + k :]).T / (2.0 * _STEP)
    rates = np.zeros(2 * (n + k))
    rates[n : 2 * n], rates[2 * n + k :] = goal.numbers.speed_weight, goal.numbers.driven_weight
    return J.T @ J + np.diag(rates**2)
