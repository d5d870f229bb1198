"""Feedback along a plan: a time-varying linear-quadratic regulator, evaluated once per segment.

    acc_K = planned_k - K_k z_k,      z = (dq_D, dv_D, dq_K, dv_K) from the plan's node k
    min z_m'Q_m z_m + sum_k z_k'Q z_k + r |dacc_K|^2,      z_k+1 = A_k z_k + B_k dacc_K

A_k and B_k are derivatives under the active set (:mod:`fantoccini.control.planning.active_sets`),
over changes that keep taut strings taut. In segments with catches or releases they are exact, with
the saltation matrix of every catch, if such a derivative exists.

The gains are those for the puppet's active set. If the plan has another one at that time, because a
string was caught or released earlier or later, the reference state and K come from the nearest part
of the plan with the puppet's active set, extended beyond its event; if there is no such part, from
the plan at that time.

A segment is a piece of the plan with constant accelerations acc_K of the driven coordinates, and
node k the state at its start. D stands for dynamic coordinates, K for driven ones; K_k is a gain
matrix. At a catch, a slack string becomes taut. Slip is the length of string that a winch lets out
at its largest tension.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fantoccini.base import (
    Array,
    Indices,
    MaskRows,
    ShortRepr,
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
    deviation,
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
    """Numerical parameters of feedback laws."""

    goal_step: float = 1e-6
    """Step of central differences of the goal's residuals [rad or m]."""
    rounding: float = 1e-9
    """Rounding error of a number of segments."""
    min_acceleration: float = 1e-9
    """Smallest braking acceleration of a coordinate [m/s^2]; avoids a division by 0."""


_TOLERANCES = _Tolerances()

Push = Callable[[float], Array]
"""Time -> (n_vD,) forces on the dynamic coordinates [N or N m]."""


@dataclass(frozen=True, eq=False, repr=False)
class ClosedLoopRollout(ShortRepr):
    """The result of a closed-loop rollout of a plan.

    Attributes:
        t: (T,) times of the checks [s].
        states: (T,) states at the checks.
        acceleration: (segments, n_vK) applied accelerations [m/s^2 or rad/s^2].
        distance: distance from the goal at the end.
        clearance: least clearance at checks [m].
        arrives: whether the run ends within the tolerance and touches nothing.
        status: status at the end of the run.
    """

    t: Array
    states: StateArrays
    acceleration: Array
    distance: float
    clearance: float
    arrives: bool
    status: Status

    @classmethod
    def from_states(
        cls, problem: Problem, states: list[State], acceleration: Array, status: Status
    ) -> ClosedLoopRollout:
        """The result with the states of a run at checks.

        Args:
            problem: the planning problem.
            states, acceleration, status: results of the run.
        """
        state_arrays = StateArrays.of(*states)
        distance = float(problem.goal.distance(state_arrays[-1:])[0])
        t = np.array([x.t for x in states])
        path = Path(problem.marionette, t, state_arrays.q_D, state_arrays.q_K)
        clearance = problem.rollouts.clearance.least(path).distance
        arrives = status is Status.DONE and distance <= problem.tolerance and clearance >= 0.0
        return cls(t, state_arrays, acceleration, distance, clearance, bool(arrives), status)


@dataclass(frozen=True, eq=False, repr=False)
class Feedback(ShortRepr):
    """The feedback law that follows a plan. Made by :meth:`along`.

    Attributes:
        plan: the plan.
        nodes: (m + 1,) states of the plan.
        n_checks: (m,) numbers of checks in its segments.
        planned_acceleration: (m, n_vK) accelerations [m/s^2 or rad/s^2].
        A, B: (m, n_z, n_z), (m, n_z, n_vK) derivatives of its segments.
        gains: (m, n_vK, n_z) feedback gains.
        active_sets: (m + 1, n_strings) bool, the active sets after the nodes.
        extensions: references for other active sets.
    """

    plan: PlanPath
    nodes: StateArrays
    n_checks: Indices
    planned_acceleration: Array
    A: Array
    B: Array
    gains: Array
    active_sets: MaskRows
    extensions: ExtendedReference

    @classmethod
    def along(
        cls, plan: PlanPath, *, acceleration: float = 0.03, arrive: float = 100.0, window: int = 3
    ) -> Feedback:
        """The feedback law of a plan.

        Args:
            plan: the plan to follow.
            acceleration: weight r of the driven accelerations relative to positions [s^4].
            arrive: weight of the goal's residuals at the end, relative to earlier deviations.
            window: number of segments by which active sets are extended beyond their part of the
                plan; with 0, gains depend on time alone.

        Raises:
            ValueError: plan without segments or with possible touches, weight that is not greater
                than 0, or a negative window.
        """
        if len(plan.path) < 2:
            raise ValueError("the plan has no segment that could be followed")
        if plan.problem.touches.expected:
            raise ValueError("the plan may touch something, which feedback does not support")
        check_positive(acceleration=acceleration, arrive=arrive)
        if not window >= 0:
            raise ValueError(f"window is {window}; it must be at least 0")
        rollouts, marionette = plan.rollouts, plan.problem.marionette
        nodes, n_checks, planned_acceleration = plan.states, plan.n_checks, plan.acceleration
        durations = n_checks.astype(float) * rollouts.options.interval
        active_sets = _active_sets(plan)
        projection = taut_projection(marionette, nodes[:-1], active_sets[:-1])
        A, B = active_set_derivatives(
            marionette, nodes[:-1], active_sets[:-1], planned_acceleration, durations, projection
        )
        catches = plan.tree.catches[list(plan.path[1:])]
        for k in np.flatnonzero(
            np.any(active_sets[1:] != active_sets[:-1], axis=1) | (catches > 0)
        ):
            exact = event_derivatives(
                marionette, nodes[k], planned_acceleration[k], durations[k], active_sets[k]
            )
            if exact is not None:
                A[k], B[k] = exact
        n_z, table = A.shape[1], marionette.coordinates
        Q = np.diag(np.where(np.arange(n_z) < table.n_vD, 1.0, SPEED_WEIGHT**2))
        movable, gains = rollouts.bounds.movable, np.zeros((len(n_checks), table.n_vK, n_z))
        R = acceleration * np.eye(movable.sum())
        gains[:, movable], P = riccati.gains(
            A, B[:, :, movable], Q, R, Q + arrive * _goal_weights(plan, nodes[-1])
        )
        reference = PlanReference(
            marionette,
            nodes,
            active_sets,
            durations,
            planned_acceleration,
            A,
            B,
            gains,
            P,
            Q,
            R,
            movable,
        )
        extended = ExtendedReference.from_plan(reference, window)
        return cls(plan, nodes, n_checks, planned_acceleration, A, B, gains, active_sets, extended)

    def acceleration(self, k: int, x: State) -> Array:
        """(n_vK,) accelerations for segment k from a state, within bounds [m/s^2 or rad/s^2].

        After the last segment the law that leads to the goal, if there is one, holds the puppet
        there; otherwise the driven coordinates stop. A driven coordinate brakes before the end of
        its range.

        Args:
            k: index of the segment.
            x: the puppet's state.
        """
        rollouts = self.plan.rollouts
        bounds, duration = self.plan.problem.bounds, rollouts.options.segment
        if k < len(self.n_checks):
            duration = self.n_checks[k] * rollouts.options.interval
            node, K = self.reference(k, x)
            acc_K = self.planned_acceleration[k] - K @ self.deviation(node, x)
        elif rollouts.laws:
            law, zeros = rollouts.laws[0], np.zeros_like
            target = StateArrays(law.q_D, zeros(x.v_D), x.slip, law.q_K, zeros(x.v_K))
            acc_K = -law.gains @ self.deviation(target, x)
        else:
            acc_K = -x.v_K / duration
        slowest, fastest = self._velocities_within(x, duration)
        acc_K = np.clip(acc_K, (slowest - x.v_K) / duration, (fastest - x.v_K) / duration)
        return np.clip(acc_K, -bounds.acceleration, bounds.acceleration)

    def reference(self, k: int, x: State) -> tuple[StateArrays, Array]:
        """The reference state in segment k, and the gains (n_vK, n_z) on deviations from it.

        Args:
            k: index of the segment.
            x: the puppet's state.
        """
        active = self.active_set(x)
        index = self.extensions.nearest(k, active)
        if index is None or np.array_equal(active, self.active_sets[k]):
            return self.nodes[k], self.gains[k]
        return self.extensions.nodes[index], self.extensions.gains[index]

    def active_set(self, x: State) -> MaskRows:
        """(n_strings,) bool: strings marked taut in the state, or at their length and at rest."""
        marionette, n_strings = self.plan.problem.marionette, self.active_sets.shape[1]
        active_set = ActiveSet.at_state(marionette, x, Evaluation.at_state(marionette, x))
        return (active_set.held | active_set.slipping)[:n_strings]

    def _velocities_within(self, x: State, duration: float) -> tuple[Array, Array]:
        """(n_vK,) lowest and highest velocities from which driven coordinates stop in their range.

        After T, v leaves enough distance to brake within d, in whole segments T_1::

            v^2 / (2 a) + v T_1 / 2 <= d - (v_K + v) T / 2
        """
        rollouts, table = self.plan.rollouts, self.plan.problem.marionette.coordinates
        bounds = self.plan.problem.bounds
        mean_duration = 0.5 * (duration + rollouts.options.segment)
        fastest, slowest = bounds.speed.copy(), -bounds.speed
        for q, v in table.scalars_K:
            acceleration = max(float(bounds.acceleration[v]), _TOLERANCES.min_acceleration)

            def max_speed(
                range_left: float, velocity: float, acceleration: float = acceleration
            ) -> float:
                distance = range_left - 0.5 * velocity * duration
                return float(
                    acceleration
                    * (
                        np.sqrt(max(mean_duration**2 + 2.0 / acceleration * distance, 0.0))
                        - mean_duration
                    )
                )

            fastest[v] = min(fastest[v], max_speed(bounds.high[q] - x.q_K[q], x.v_K[v]))
            slowest[v] = max(slowest[v], -max_speed(x.q_K[q] - bounds.low[q], -x.v_K[v]))
        return slowest, np.maximum(fastest, slowest)

    def deviation(self, node: StateArrays, x: State) -> Array:
        """(n_z,) tangent vector from a reference state to a state."""
        return deviation(self.plan.problem.marionette, node, x)

    def run(
        self,
        x0: State | None = None,
        marionette: Marionette | None = None,
        method: Method | MethodName = "timestepping",
        *,
        push: Push | None = None,
        hold: float = 0.0,
        closed: bool = True,
    ) -> ClosedLoopRollout:
        """The result of a closed-loop rollout, in which the puppet follows the plan.

        Args:
            x0: initial state; the plan's start by default.
            marionette: the puppet, if it is not the one of the plan.
            method: method of the simulation; ``timestepping`` has the planner's step.
            push: additional forces, constant between checks.
            hold: time to stay at the goal afterwards [s].
            closed: whether there is feedback; otherwise the planned accelerations are applied.

        Raises:
            StateError: puppet with other coordinates, or a run that cannot begin at ``x0``.
        """
        problem, options = self.plan.problem, self.plan.rollouts.options
        puppet = problem.marionette if marionette is None else marionette
        names = [(m.coordinates.v_D, m.coordinates.v_K) for m in (puppet, problem.marionette)]
        if names[0] != names[1]:
            raise StateError("this puppet has other coordinates than the plan's")
        if method == "timestepping":
            method = TimeStepping(dt=options.dt, extrapolate=False)
        method_options = as_method(method)
        x = exact_start(problem, method_options) if x0 is None else x0
        stepper = puppet.stepper(x, method_options)
        n_plan_segments, n_segment_checks = len(self.n_checks), options.n_checks
        hold_segments = int(np.ceil(hold / options.segment - _TOLERANCES.rounding))
        states, applied = [x], list[Array]()
        for k in np.repeat(
            np.arange(n_plan_segments + hold_segments),
            np.append(self.n_checks, np.full(hold_segments, n_segment_checks)),
        ):
            if len(applied) <= k:
                has_feedback = closed or k >= n_plan_segments
                applied.append(
                    self.acceleration(int(k), x) if has_feedback else self.planned_acceleration[k]
                )
            u_D = None if push is None else push(x.t)
            x = stepper.advance(options.interval, applied[-1], u_D=u_D, throw=False)
            states.append(x)
            if not stepper.arrived:
                break
        return ClosedLoopRollout.from_states(problem, states, np.array(applied), stepper.status)


def _active_sets(plan: PlanPath) -> MaskRows:
    """(m + 1, n_strings) bool, whether strings pull in the step after a node."""
    run = plan.trajectory
    # Tensions of a time step are saved at its end.
    sample_indices = np.searchsorted(run.t, plan.times + 0.5 * plan.rollouts.options.dt)
    taut = run.tension.values[np.minimum(sample_indices, len(run.t) - 1)] != 0.0
    return taut | plan.problem.marionette.two_sided[: taut.shape[1]]


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
    q_indices = np.concatenate([np.arange(n), 2 * n + np.arange(k)])
    J[:, q_indices] = (residuals[: n + k] - residuals[n + k :]).T / (2.0 * _TOLERANCES.goal_step)
    velocity_weights = np.zeros(2 * (n + k))
    velocity_weights[n : 2 * n], velocity_weights[2 * n + k :] = (
        goal.numbers.speed_weight,
        goal.numbers.driven_weight,
    )
    return J.T @ J + np.diag(velocity_weights**2)
