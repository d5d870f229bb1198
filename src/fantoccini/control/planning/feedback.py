"""Feedback along a plan: a time-varying linear-quadratic regulator, evaluated once a segment.

    acc_K = planned_k - K_k z_k,      z = (dq_D, dv_D, dq_K, dv_K) from the plan's node k
    min z_m'Q_m z_m + sum_k z_k'Q z_k + r |dacc_K|^2,      z_k+1 = A_k z_k + B_k dacc_K

A_k and B_k are derivatives under the active set (:mod:`fantoccini.control.planning.active_sets`),
over changes that leave taut strings taut. In segments with catches or releases they are exact, with
the saltation matrix of every catch, where such a derivative exists.

The gains are those of the puppet's active set. Where the plan has another one at that time, because
a string was caught or released earlier or later, the reference state and K come from the nearest
part of the plan with the puppet's active set, extended beyond its event; without one, from the
plan at that time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fantoccini.base import (
    Array,
    Indices,
    MaskRows,
    StateError,
    Status,
    check_positive,
    riccati,
    tangent,
)
from fantoccini.control.planning.active_sets import (
    ExtendedReference,
    PlanReference,
    active_set_derivatives,
    away,
    event_derivatives,
)
from fantoccini.control.planning.plan_path import PlanPath, exact_start
from fantoccini.control.problems import SPEED_WEIGHT, Problem, taut_projection
from fantoccini.control.tasks import StateArrays
from fantoccini.dynamics.clearance import Path
from fantoccini.dynamics.compiled import (
    ActiveSet,
    Evaluation,
    Method,
    MethodName,
    TimeStepping,
    as_method,
)
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State


@dataclass(frozen=True)
class _Tolerances:
    """Numerics of feedback laws."""

    goal_step: float = 1e-6
    """Step of central differences of the goal's residuals [rad or m]."""
    rounding: float = 1e-9
    """Part of a segment that does not count as another one."""
    min_acceleration: float = 1e-9
    """Least acceleration with which a coordinate brakes [m/s^2]; avoids a division by 0."""


_TOLERANCES = _Tolerances()

Push = Callable[[float], Array]
"""Time -> (n_vD,) forces on the dynamic coordinates [N or N m]."""


@dataclass(frozen=True, eq=False)
class Followed:
    """The result of following a plan.

    Attributes:
        t: (T,) of every look [s].
        states: (T,) there.
        acceleration: (segments, n_vK) applied [m/s^2 or rad/s^2].
        distance: from the goal at the end.
        clearance: the least at looks [m].
        arrives: whether the run ends within the tolerance and touches nothing.
        status: how the run ended.
    """

    t: Array
    states: StateArrays
    acceleration: Array
    distance: float
    clearance: float
    arrives: bool
    status: Status

    @classmethod
    def of(
        cls, problem: Problem, states: list[State], acceleration: Array, status: Status
    ) -> Followed:
        """Evaluates the states of a run at looks.

        Args:
            problem: that was planned.
            states, acceleration, status: of the run.
        """
        found = StateArrays.of(*states)
        distance = float(problem.goal.distance(found[-1:])[0])
        t = np.array([x.t for x in states])
        path = Path(problem.marionette, t, found.q_D, found.q_K)
        clearance = problem.rollouts.clearance.least(path).distance
        arrives = status is Status.DONE and distance <= problem.tolerance and clearance >= 0.0
        return cls(t, found, acceleration, distance, clearance, bool(arrives), status)


@dataclass(frozen=True, eq=False)
class Feedback:
    """The feedback law that follows a plan. Made by :meth:`along`.

    Attributes:
        plan: that is followed.
        nodes: (m + 1,) states of the plan.
        looks: (m,) of its segments.
        planned: (m, n_vK) accelerations [m/s^2 or rad/s^2].
        A, B: (m, n_z, n_z), (m, n_z, n_vK) derivatives of its segments.
        gains: (m, n_vK, n_z).
        active: (m + 1, n_strings) bool, the active sets after the nodes.
        extended: references for other active sets.
    """

    plan: PlanPath
    nodes: StateArrays
    looks: Indices
    planned: Array
    A: Array
    B: Array
    gains: Array
    active: MaskRows
    extended: ExtendedReference

    @classmethod
    def along(
        cls, plan: PlanPath, *, acceleration: float = 0.03, arrive: float = 100.0, window: int = 3
    ) -> Feedback:
        """The feedback law of a plan.

        Args:
            plan: to be followed.
            acceleration: r, weight of the driven accelerations relative to positions [s^4].
            arrive: weight of the goal's residuals at the end, relative to deviations before it.
            window: number of segments by which active sets are extended beyond their part of the
                plan; with 0, gains depend on time alone.

        Raises:
            ValueError: the plan has no segment or may touch something, a weight that is not greater
                than 0, or a negative window.
        """
        if len(plan.path) < 2:
            raise ValueError("the plan has no segment that could be followed")
        if plan.problem.touches.expected:
            raise ValueError("the plan may touch something, of which feedback knows nothing yet")
        check_positive(acceleration=acceleration, arrive=arrive)
        if not window >= 0:
            raise ValueError(f"window is {window}; it must be at least 0")
        rollouts, marionette = plan.rollouts, plan.problem.marionette
        nodes, looks, planned = plan.states, plan.looks, plan.acceleration
        durations = looks.astype(float) * rollouts.options.interval
        active = _active_sets(plan)
        onto = taut_projection(marionette, nodes[:-1], active[:-1])
        A, B = active_set_derivatives(marionette, nodes[:-1], active[:-1], planned, durations, onto)
        catches = plan.tree.catches[list(plan.path[1:])]
        for k in np.flatnonzero(np.any(active[1:] != active[:-1], axis=1) | (catches > 0)):
            exact = event_derivatives(marionette, nodes[k], planned[k], durations[k], active[k])
            if exact is not None:
                A[k], B[k] = exact
        size, table = A.shape[1], marionette.coordinates
        Q = np.diag(np.where(np.arange(size) < table.n_vD, 1.0, SPEED_WEIGHT**2))
        moves, gains = rollouts.bounds.moves, np.zeros((len(looks), table.n_vK, size))
        R = acceleration * np.eye(moves.sum())
        gains[:, moves], P = riccati.gains(
            A, B[:, :, moves], Q, R, Q + arrive * _goal_weights(plan, nodes[-1])
        )
        reference = PlanReference(
            marionette, nodes, active, durations, planned, A, B, gains, P, Q, R, moves
        )
        extended = ExtendedReference.of(reference, window)
        return cls(plan, nodes, looks, planned, A, B, gains, active, extended)

    def acceleration(self, k: int, x: State) -> Array:
        """(n_vK,) for segment k from a state, within the problem's bounds [m/s^2 or rad/s^2].

        After the last segment the funnel to the goal holds the puppet there, where the problem has
        one; otherwise the driven coordinates stop. A driven coordinate brakes before its range
        ends.

        Args:
            k: number of the segment.
            x: the puppet's state.
        """
        rollouts = self.plan.rollouts
        bounds, T = self.plan.problem.bounds, rollouts.options.segment
        if k < len(self.looks):
            T = self.looks[k] * rollouts.options.interval
            node, K = self.reference(k, x)
            acc_K = self.planned[k] - K @ self.away(node, x)
        elif rollouts.funnels:
            funnel, still = rollouts.funnels[0], np.zeros_like
            there = StateArrays(funnel.q_D, still(x.v_D), x.slip, funnel.q_K, still(x.v_K))
            acc_K = -funnel.gains @ self.away(there, x)
        else:
            acc_K = -x.v_K / T
        slowest, fastest = self._velocities_within(x, T)
        acc_K = np.clip(acc_K, (slowest - x.v_K) / T, (fastest - x.v_K) / T)
        return np.clip(acc_K, -bounds.acceleration, bounds.acceleration)

    def reference(self, k: int, x: State) -> tuple[StateArrays, Array]:
        """The reference state in segment k, and the gains (n_vK, n_z) on deviations from it.

        Args:
            k: number of the segment.
            x: the puppet's state.
        """
        active = self.active_set(x)
        e = self.extended.nearest(k, active)
        if e is None or np.array_equal(active, self.active[k]):
            return self.nodes[k], self.gains[k]
        return self.extended.nodes[e], self.extended.gains[e]

    def active_set(self, x: State) -> MaskRows:
        """(n_strings,) bool: strings marked taut in the state, or at their length and at rest."""
        marionette, strings = self.plan.problem.marionette, self.active.shape[1]
        closed = ActiveSet.of(marionette, x, Evaluation.of(marionette, x))
        return (closed.held | closed.slipping)[:strings]

    def _velocities_within(self, x: State, T: float) -> tuple[Array, Array]:
        """(n_vK,) least and greatest velocities from which driven coordinates stop in their range.

        After T, v leaves room to brake within d, in whole segments T_1::

            v^2 / (2 a) + v T_1 / 2 <= d - (v_K + v) T / 2
        """
        rollouts, table = self.plan.rollouts, self.plan.problem.marionette.coordinates
        bounds, mean = self.plan.problem.bounds, 0.5 * (T + rollouts.options.segment)
        fastest, slowest = bounds.speed.copy(), -bounds.speed
        for q, v in table.scalars_K:
            a = max(float(bounds.acceleration[v]), _TOLERANCES.min_acceleration)

            def most(d: float, toward: float, a: float = a) -> float:
                left = d - 0.5 * toward * T
                return float(a * (np.sqrt(max(mean**2 + 2.0 / a * left, 0.0)) - mean))

            fastest[v] = min(fastest[v], most(bounds.high[q] - x.q_K[q], x.v_K[v]))
            slowest[v] = max(slowest[v], -most(x.q_K[q] - bounds.low[q], -x.v_K[v]))
        return slowest, np.maximum(fastest, slowest)

    def away(self, node: StateArrays, x: State) -> Array:
        """(n_z,) tangent vector from a reference state to a state."""
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
        """Simulates the puppet under the feedback law: a closed-loop rollout.

        Args:
            x0: initial state; the plan's start by default.
            marionette: the puppet, where it is not the one that was planned for.
            method: of the simulation; ``timestepping`` has the planner's step.
            push: additional forces, held from look to look.
            hold: time to stay at the goal afterwards [s].
            closed: whether there is feedback; otherwise the planned accelerations are applied.

        Raises:
            StateError: another puppet has other coordinates, or a run cannot begin at ``x0``.
        """
        problem, options = self.plan.problem, self.plan.rollouts.options
        puppet = problem.marionette if marionette is None else marionette
        names = [(m.coordinates.v_D, m.coordinates.v_K) for m in (puppet, problem.marionette)]
        if names[0] != names[1]:
            raise StateError("this puppet has other coordinates than the plan's")
        if method == "timestepping":
            method = TimeStepping(dt=options.dt, extrapolate=False)
        chosen = as_method(method)
        x = exact_start(problem, chosen) if x0 is None else x0
        stepper = puppet.stepper(x, chosen)
        m, whole = len(self.looks), options.looks
        more = int(np.ceil(hold / options.segment - _TOLERANCES.rounding))
        states, applied = [x], list[Array]()
        for k in np.repeat(np.arange(m + more), np.append(self.looks, np.full(more, whole))):
            if len(applied) <= k:
                feedback = closed or k >= m
                applied.append(self.acceleration(int(k), x) if feedback else self.planned[k])
            u_D = None if push is None else push(x.t)
            x = stepper.advance(options.interval, applied[-1], u_D=u_D, throw=False)
            states.append(x)
            if not stepper.arrived:
                break
        return Followed.of(problem, states, np.array(applied), stepper.status)


def _active_sets(plan: PlanPath) -> MaskRows:
    """(m + 1, n_strings) bool, whether strings pull in the step after a node."""
    run = plan.trajectory
    # Tensions of a time step are saved at its end.
    after = np.searchsorted(run.t, plan.times + 0.5 * plan.rollouts.options.dt)
    pulls = run.tension.values[np.minimum(after, len(run.t) - 1)] != 0.0
    return pulls | plan.problem.marionette.two_sided[: pulls.shape[1]]


def _goal_weights(plan: PlanPath, end: StateArrays) -> Array:
    """(n_z, n_z) weights of the goal at the plan's end: J'J of its residuals."""
    goal, table = plan.goal, plan.problem.marionette.coordinates
    n, k = table.n_vD, table.n_vK
    steps = _TOLERANCES.goal_step * np.concatenate([np.eye(n + k), -np.eye(n + k)])
    q_D = tangent.moved(table.scalars_D, table.quaternions_D, end.q_D, steps[:, :n])
    q_K = tangent.moved(table.scalars_K, table.quaternions_K, end.q_K, steps[:, n:])
    v_D, slip, v_K = (np.tile(a, (len(steps), 1)) for a in (end.v_D, end.slip, end.v_K))
    residuals = goal.residuals(StateArrays(q_D, v_D, slip, q_K, v_K))
    J = np.zeros((residuals.shape[1], 2 * (n + k)))
    at = np.concatenate([np.arange(n), 2 * n + np.arange(k)])
    J[:, at] = (residuals[: n + k] - residuals[n + k :]).T / (2.0 * _TOLERANCES.goal_step)
    rates = np.zeros(2 * (n + k))
    rates[n : 2 * n], rates[2 * n + k :] = goal.numbers.speed_weight, goal.numbers.driven_weight
    return J.T @ J + np.diag(rates**2)
