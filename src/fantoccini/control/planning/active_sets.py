"""Extensions of a plan beyond its catches and releases, for a puppet with another active set.

The active set is the set of taut strings. Under one active set the motion is smooth. With the
plan's inputs, it can be extended beyond the plan's part with this active set: active strings are
held, as wires if need be, and the others are left out. A puppet that is caught early or late is
compared with such an extension, not with the plan's state at that time ("reference spreading":
Rijnen, Saccon and Nijmeijer)::

    early:  K from Riccati's recursion, with A and B of the active set, continued into the plan
    late:   K = K_k S,   S = A_k-1 F^-1

where F is the derivative under the old active set, and A_k-1 the derivative through the event. S
predicts the deviation from the plan after the puppet's own event: the saltation, taken to the node.

A segment is a piece of the plan with constant driven accelerations acc_K, and a node the state
between two segments. q_D are dynamic and q_K driven coordinates. A and B are derivatives of a
segment's end with respect to its start and its acc_K; K are gains of the feedback. Slip is the
length of string that a winch lets out at its largest tension.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, FantocciniError, Indices, MaskRows, riccati, tangent
from fantoccini.control.problems import central_differences, taut_projection
from fantoccini.control.tasks import StateArrays
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import interval_derivatives, simulate
from fantoccini.motion import Input, State


@dataclass(frozen=True)
class _Tolerances:
    """Numerical parameters of extensions."""

    n_steps: int = 10
    """Runge-Kutta steps in a segment."""
    difference: float = 1e-5
    """Step of central differences [rad, m and their rates]."""
    compliance: float = 1e-9
    """Compliance of strings, relative to the trace of G, which allows redundant strings."""
    integration: float = 1e-6
    """Values of rtol and atol for derivatives through events."""
    max_distance: float = 1.0
    """Weighted distance from the plan beyond which an extension is not used."""


_TOLERANCES = _Tolerances()


@dataclass(frozen=True, eq=False)
class PlanReference:
    """A plan of m segments with its active sets and its feedback gains.

    Attributes:
        marionette: the puppet.
        nodes: (m + 1,) states.
        active: (m + 1, n_strings) bool, the active sets after the nodes.
        durations: (m,) durations of the segments [s].
        planned_acceleration: (m, n_vK) accelerations [m/s^2 or rad/s^2].
        A, B: (m, n_z, n_z), (m, n_z, n_vK) derivatives of the segments.
        gains: (m, n_vK, n_z) feedback gains.
        P: (m + 1, n_z, n_z) matrices of the cost to go.
        Q: (n_z, n_z) weights of deviations.
        R: weights of the accelerations that may be nonzero.
        movable: (n_vK,) bool, the accelerations that may be nonzero.
    """

    marionette: Marionette
    nodes: StateArrays
    active: MaskRows
    durations: Array
    planned_acceleration: Array
    A: Array
    B: Array
    gains: Array
    P: Array
    Q: Array
    R: Array
    movable: MaskRows


@dataclass(frozen=True, eq=False)
class ExtendedReference:
    """Reference states and gains for other active sets than the plan's. Made by :meth:`from_plan`.

    Attributes:
        segment: (e,) index of the segment in which the reference is used.
        active: (e, n_strings) bool, the active set.
        offset: (e,) number of segments since the plan left that active set; negative before the
            plan enters it.
        nodes: (e,) states that replace the plan's.
        gains: (e, n_vK, n_z) feedback gains.
    """

    segment: Indices
    active: MaskRows
    offset: Indices
    nodes: StateArrays
    gains: Array

    @classmethod
    def from_plan(cls, reference: PlanReference, window: int) -> ExtendedReference:
        """Extensions of every active set of a plan beyond its part of the plan.

        Args:
            reference: the plan.
            window: number of segments of an extension.
        """
        events = np.flatnonzero(np.any(reference.active[1:] != reference.active[:-1], axis=1))
        no_events = events[:0]
        extensions = [
            cls(
                no_events, reference.active[:0], no_events, reference.nodes[:0], reference.gains[:0]
            )
        ]
        with np.errstate(all="ignore"):  # extensions that diverge are left out below
            extensions += _extended_backward(reference, events, window) + _extended_forward(
                reference, events, window
            )
        nodes = [extension.nodes.parts for extension in extensions]
        return cls(
            np.concatenate([extension.segment for extension in extensions]),
            np.concatenate([extension.active for extension in extensions]),
            np.concatenate([extension.offset for extension in extensions]),
            StateArrays(
                **{name: np.concatenate([arrays[name] for arrays in nodes]) for name in nodes[0]}
            ),
            np.concatenate([extension.gains for extension in extensions]),
        )

    def nearest(self, k: int, active: MaskRows) -> int | None:
        """Index of the nearest reference with an active set; None if there is none.

        Args:
            k: index of the segment.
            active: (n_strings,) bool, the active set.
        """
        matches = np.flatnonzero((self.segment == k) & np.all(self.active == active, axis=1))
        return int(matches[np.argmin(np.abs(self.offset[matches]))]) if len(matches) else None


def _extended_backward(
    plan: PlanReference, events: Indices, window: int
) -> list[ExtendedReference]:
    """Extensions of the active sets after events, into segments before them."""
    extensions, k, active = [], events, plan.active[events + 1]
    states, P = plan.nodes[events + 1], plan.P[events + 1]
    for n_back in range(window):
        is_extended = k >= 0
        is_extended[is_extended] = np.any(
            plan.active[k[is_extended]] != active[is_extended], axis=1
        )
        k = k[is_extended]
        states = states[is_extended]
        P = P[is_extended]
        active = active[is_extended]
        states = advance_states(
            plan.marionette, states, active, plan.planned_acceleration[k], -plan.durations[k]
        )
        is_near = _near(plan, k, states)
        k, states, P, active = k[is_near], states[is_near], P[is_near], active[is_near]
        if not len(k):
            break
        projection = taut_projection(plan.marionette, states, active)
        A, B = _derivatives(plan, states, active, k, projection)
        gains = np.zeros_like(plan.gains[k])
        gains[:, plan.movable], P = riccati.step(A, B[:, :, plan.movable], plan.Q, plan.R, P)
        extensions.append(ExtendedReference(k, active, np.full(len(k), -1 - n_back), states, gains))
        k = k - 1
    return extensions


def _extended_forward(plan: PlanReference, events: Indices, window: int) -> list[ExtendedReference]:
    """Extensions of the active sets before events, into segments after them."""
    extensions, k, active, states = [], events, plan.active[events], plan.nodes[events]
    S = np.tile(np.eye(len(plan.Q)), (len(k), 1, 1))
    for n_forward in range(window):
        is_extended = k + 1 < len(plan.planned_acceleration)
        is_extended[is_extended] = np.any(
            plan.active[k[is_extended] + 1] != active[is_extended], axis=1
        )
        k = k[is_extended]
        states = states[is_extended]
        active = active[is_extended]
        S = S[is_extended]
        previous = states
        states = advance_states(
            plan.marionette, states, active, plan.planned_acceleration[k], plan.durations[k]
        )
        is_near = _near(plan, k + 1, states)
        k, previous, states, active, S = (
            k[is_near],
            previous[is_near],
            states[is_near],
            active[is_near],
            S[is_near],
        )
        if not len(k):
            break
        F, _ = _derivatives(plan, previous, active, k)
        S = plan.A[k] @ S @ np.linalg.inv(F)
        k = k + 1
        extensions.append(
            ExtendedReference(k, active, np.full(len(k), 1 + n_forward), states, plan.gains[k] @ S)
        )
    return extensions


def deviation(marionette: Marionette, node: StateArrays, x: StateArrays | State) -> Array:
    """(..., n_z) tangent vectors from one state to another: (dq_D, dv_D, dq_K, dv_K)."""
    table = marionette.coordinates
    indices_D = table.scalars_D, table.quaternions_D
    indices_K = table.scalars_K, table.quaternions_K
    return np.concatenate(
        [
            tangent.between(*indices_D, node.q_D, x.q_D, table.n_vD),
            x.v_D - node.v_D,
            tangent.between(*indices_K, node.q_K, x.q_K, table.n_vK),
            x.v_K - node.v_K,
        ],
        axis=-1,
    )


def _near(plan: PlanReference, k: Indices, states: StateArrays) -> MaskRows:
    """(n,) bool, whether states are near enough to nodes k."""
    z = deviation(plan.marionette, plan.nodes[k], states)
    # NaN gives False.
    return np.einsum("ni,ij,nj->n", z, plan.Q, z) < _TOLERANCES.max_distance**2


def _derivatives(
    plan: PlanReference,
    states: StateArrays,
    active: MaskRows,
    k: Indices,
    projection: Array | None = None,
) -> tuple[Array, Array]:
    return active_set_derivatives(
        plan.marionette, states, active, plan.planned_acceleration[k], plan.durations[k], projection
    )


def active_set_derivatives(
    marionette: Marionette,
    states: StateArrays,
    active: MaskRows,
    acceleration: Array,
    duration: Array,
    projection: Array | None = None,
) -> tuple[Array, Array]:
    """Derivatives under fixed active sets, A (m, n_z, n_z) and B (m, n_z, n_vK).

    Args:
        marionette, states, active, acceleration, duration: see :func:`advance_states`.
        projection: (m, n_z, n_z) projections of changes of the states; see
            :func:`fantoccini.control.problems.derivatives.taut_projection`.
    """

    def end_states(starts: StateArrays, acc_K: Array) -> StateArrays:
        n_changes = len(acc_K) // len(active)
        times = np.repeat(duration, n_changes)
        return advance_states(
            marionette, starts, np.repeat(active, n_changes, axis=0), acc_K, times
        )

    return central_differences(
        marionette, end_states, states, acceleration, projection, _TOLERANCES.difference
    )


def event_derivatives(
    marionette: Marionette,
    start: StateArrays,
    acceleration: Array,
    duration: float,
    active: MaskRows,
) -> tuple[Array, Array] | None:
    """A and B of one segment through its events, with the saltation matrix of every catch.

    Finite differences of the time-stepper are wrong by a factor of a hundred if a catch grazes or
    falls next to a node.

    Args:
        marionette: the puppet; none of its driven coordinates is a rotation.
        start: one state.
        acceleration: (n_vK,) accelerations of the driven coordinates.
        duration: duration of the segment [s].
        active: (n_strings,) bool, the active set at the start.

    Returns:
        (n_z, n_z) and (n_z, n_vK), over changes that keep taut strings taut; None if the run has no
        derivative: it stops, winches slip, or several rows are caught at once by chance.
    """
    taut = np.zeros(marionette.tree.n_rows, dtype=bool)
    taut[: len(active)] = active
    x = State(0.0, start.q_D, start.v_D, start.q_K, start.v_K, taut, start.slip)
    times = np.array([0.0, duration])
    inputs = Input.segments(marionette, times, start.q_K, start.v_K, acceleration[None])
    tolerance = _TOLERANCES.integration
    try:
        run = simulate(marionette, marionette.project(x), inputs, duration, effort=False)
        derivatives = interval_derivatives(marionette, run, inputs, rtol=tolerance, atol=tolerance)
    except FantocciniError:
        return None
    return (derivatives.A[0], derivatives.B[0]) if derivatives.differentiable else None


def advance_states(
    marionette: Marionette, start: StateArrays, active: MaskRows, acc_K: Array, duration: Array
) -> StateArrays:
    """The states after motion under fixed active sets: Eqs. 10 and 11 with these strings held.

    Limits are left out, and winches do not slip.

    Args:
        marionette: the puppet; none of its driven coordinates is a rotation.
        start: (n,) states.
        active: (n, n_strings) bool, the strings that are held.
        acc_K: (n, n_vK) accelerations of the driven coordinates.
        duration: (n,) durations [s]; negative for motion backwards in time.
    """
    table, dt = marionette.coordinates, duration[:, None] / _TOLERANCES.n_steps
    indices = table.scalars_D, table.quaternions_D
    q, v = start.q_D, start.v_D

    def driven_state(t: Array) -> tuple[Array, Array]:
        displacement = t * (start.v_K + 0.5 * t * acc_K)
        return tangent.moved(table.scalars_K, (), start.q_K, displacement), start.v_K + t * acc_K

    def acceleration(t: Array, change: Array, v: Array) -> Array:
        q_D = tangent.moved(*indices, q, change)
        return _acceleration(
            marionette, StateArrays(q_D, v, start.slip, *driven_state(t)), acc_K, active
        )

    for step in range(_TOLERANCES.n_steps):
        t = step * dt
        a1 = acceleration(t, np.zeros_like(v), v)
        a2 = acceleration(t + 0.5 * dt, 0.5 * dt * v, v + 0.5 * dt * a1)
        a3 = acceleration(t + 0.5 * dt, 0.5 * dt * (v + 0.5 * dt * a1), v + 0.5 * dt * a2)
        a4 = acceleration(t + dt, dt * (v + 0.5 * dt * a2), v + dt * a3)
        q = tangent.moved(*indices, q, dt * v + dt**2 / 6.0 * (a1 + a2 + a3))
        v = v + dt / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    return StateArrays(q, v, start.slip, *driven_state(duration[:, None]))


def _acceleration(
    marionette: Marionette, states: StateArrays, acc_K: Array, active: MaskRows
) -> Array:
    """(n, n_vD) acc_D with active strings held: G tau = hddot without tension."""
    values = marionette.library.evaluate(
        "dynamics",
        q_D=states.q_D,
        v_D=states.v_D,
        q_K=states.q_K,
        v_K=states.v_K,
        acc_K=acc_K,
        u_D=np.zeros_like(states.v_D),
        p=marionette.p,
    )
    n_strings = active.shape[1]
    identity, both_active = np.eye(n_strings), active[:, :, None] & active[:, None]
    G = np.where(both_active, values.G, identity * ~active[:, None])
    G = G + _TOLERANCES.compliance * np.trace(G, axis1=1, axis2=2)[:, None, None] * identity
    tension = np.linalg.solve(G, (active * (values.gamma + values.a0))[..., None])
    w = values.w0 - (tension.swapaxes(1, 2) @ values.W.swapaxes(1, 2))[:, 0]
    return marionette.library.evaluate("solve_factor", L=values.L, x=w).y
