"""Extensions of a plan beyond its catches and releases, for a puppet with another active set.

The active set is the set of taut strings. Under one active set the motion is smooth and can be
extended beyond the plan's part of it, with the plan's inputs: active strings are held, as wires if
need be, the others are left out. A puppet that is caught early or late is compared with such an
extension, not with the plan's state at that time ("reference spreading": Rijnen, Saccon and
Nijmeijer)::

    early:  K from Riccati's recursion, with A and B of the active set, continued into the plan
    late:   K = K_k S,   S = A_k-1 F^-1

where F are derivatives under the old active set, A_k-1 those through the event. S predicts the
deviation from the plan once the puppet has had its event too: the saltation, taken to the node.
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
    """Numerics of extensions."""

    steps: int = 10
    """Runge-Kutta steps of a segment."""
    apart: float = 1e-5
    """Step of central differences [rad, m and their rates]."""
    compliance: float = 1e-9
    """Compliance of strings, relative to the trace of G, so that they may be redundant."""
    integration: float = 1e-6
    """rtol and atol of derivatives through events."""
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
        durations: (m,) of the segments [s].
        planned: (m, n_vK) accelerations [m/s^2 or rad/s^2].
        A, B: (m, n_z, n_z), (m, n_z, n_vK) derivatives of the segments.
        gains: (m, n_vK, n_z).
        P: (m + 1, n_z, n_z) of the cost to go.
        Q: (n_z, n_z) weights of deviations.
        R: weights of the accelerations that may be nonzero.
        moves: (n_vK,) bool, which these are.
    """

    marionette: Marionette
    nodes: StateArrays
    active: MaskRows
    durations: Array
    planned: Array
    A: Array
    B: Array
    gains: Array
    P: Array
    Q: Array
    R: Array
    moves: MaskRows


@dataclass(frozen=True, eq=False)
class ExtendedReference:
    """Reference states and gains for other active sets than the plan's. Made by :meth:`of`.

    Attributes:
        segment: (e,) in which the reference is used.
        active: (e, n_strings) bool, the active set.
        late: (e,) segments since the plan left that active set; negative where it has yet to enter
            it.
        nodes: (e,) states in place of the plan's.
        gains: (e, n_vK, n_z).
    """

    segment: Indices
    active: MaskRows
    late: Indices
    nodes: StateArrays
    gains: Array

    @classmethod
    def of(cls, reference: PlanReference, window: int) -> ExtendedReference:
        """Extends every active set of a plan beyond its part of it.

        Args:
            reference: the plan.
            window: how far, in segments.
        """
        events = np.flatnonzero(np.any(reference.active[1:] != reference.active[:-1], axis=1))
        none = events[:0]
        parts = [cls(none, reference.active[:0], none, reference.nodes[:0], reference.gains[:0])]
        with np.errstate(all="ignore"):  # what is extended too far is left out below
            parts += _early(reference, events, window) + _late(reference, events, window)
        nodes = [part.nodes.parts for part in parts]
        return cls(
            np.concatenate([part.segment for part in parts]),
            np.concatenate([part.active for part in parts]),
            np.concatenate([part.late for part in parts]),
            StateArrays(**{name: np.concatenate([a[name] for a in nodes]) for name in nodes[0]}),
            np.concatenate([part.gains for part in parts]),
        )

    def nearest(self, k: int, active: MaskRows) -> int | None:
        """Index of the nearest reference with an active set; None where there is none.

        Args:
            k: the segment.
            active: (n_strings,) bool.
        """
        found = np.flatnonzero((self.segment == k) & np.all(self.active == active, axis=1))
        return int(found[np.argmin(np.abs(self.late[found]))]) if len(found) else None


def _early(plan: PlanReference, events: Indices, window: int) -> list[ExtendedReference]:
    """Active sets before the events, in segments ``events``, that begin them."""
    parts, k, active = [], events, plan.active[events + 1]
    at, P = plan.nodes[events + 1], plan.P[events + 1]
    for back in range(window):
        goes = k >= 0
        goes[goes] = np.any(plan.active[k[goes]] != active[goes], axis=1)
        k, at, P, active = k[goes], at[goes], P[goes], active[goes]
        at = extended(plan.marionette, at, active, plan.planned[k], -plan.durations[k])
        near = _near(plan, k, at)
        k, at, P, active = k[near], at[near], P[near], active[near]
        if not len(k):
            break
        onto = taut_projection(plan.marionette, at, active)
        A, B = _derivatives(plan, at, active, k, onto)
        gains = np.zeros_like(plan.gains[k])
        gains[:, plan.moves], P = riccati.step(A, B[:, :, plan.moves], plan.Q, plan.R, P)
        parts.append(ExtendedReference(k, active, np.full(len(k), -1 - back), at, gains))
        k = k - 1
    return parts


def _late(plan: PlanReference, events: Indices, window: int) -> list[ExtendedReference]:
    """Active sets after the events that end them."""
    parts, k, active, at = [], events, plan.active[events], plan.nodes[events]
    S = np.tile(np.eye(len(plan.Q)), (len(k), 1, 1))
    for on in range(window):
        goes = k + 1 < len(plan.planned)
        goes[goes] = np.any(plan.active[k[goes] + 1] != active[goes], axis=1)
        k, at, active, S = k[goes], at[goes], active[goes], S[goes]
        before = at
        at = extended(plan.marionette, at, active, plan.planned[k], plan.durations[k])
        near = _near(plan, k + 1, at)
        k, before, at, active, S = k[near], before[near], at[near], active[near], S[near]
        if not len(k):
            break
        F, _ = _derivatives(plan, before, active, k)
        S = plan.A[k] @ S @ np.linalg.inv(F)
        k = k + 1
        parts.append(ExtendedReference(k, active, np.full(len(k), 1 + on), at, plan.gains[k] @ S))
    return parts


def away(marionette: Marionette, node: StateArrays, x: StateArrays | State) -> Array:
    """(..., n_z) tangent vectors from states to others: (dq_D, dv_D, dq_K, dv_K)."""
    table = marionette.coordinates
    places_D = table.scalars_D, table.quaternions_D
    places_K = table.scalars_K, table.quaternions_K
    return np.concatenate(
        [
            tangent.between(*places_D, node.q_D, x.q_D, table.n_vD),
            x.v_D - node.v_D,
            tangent.between(*places_K, node.q_K, x.q_K, table.n_vK),
            x.v_K - node.v_K,
        ],
        axis=-1,
    )


def _near(plan: PlanReference, k: Indices, at: StateArrays) -> MaskRows:
    """(n,) bool, whether states are near enough to nodes k."""
    z = away(plan.marionette, plan.nodes[k], at)
    # False where it is not a number.
    return np.einsum("ni,ij,nj->n", z, plan.Q, z) < _TOLERANCES.max_distance**2


def _derivatives(
    plan: PlanReference, at: StateArrays, active: MaskRows, k: Indices, onto: Array | None = None
) -> tuple[Array, Array]:
    return active_set_derivatives(
        plan.marionette, at, active, plan.planned[k], plan.durations[k], onto
    )


def active_set_derivatives(
    marionette: Marionette,
    at: StateArrays,
    active: MaskRows,
    acceleration: Array,
    duration: Array,
    onto: Array | None = None,
) -> tuple[Array, Array]:
    """Derivatives under fixed active sets, A (m, n_z, n_z) and B (m, n_z, n_vK).

    Args:
        marionette, at, active, acceleration, duration: see :func:`extended`.
        onto: (m, n_z, n_z) projections of changes of the states; see
            :func:`fantoccini.control.problems.derivatives.taut_projection`.
    """

    def end(near: StateArrays, acc_K: Array) -> StateArrays:
        each = len(acc_K) // len(active)
        times = np.repeat(duration, each)
        return extended(marionette, near, np.repeat(active, each, axis=0), acc_K, times)

    return central_differences(marionette, end, at, acceleration, onto, _TOLERANCES.apart)


def event_derivatives(
    marionette: Marionette,
    start: StateArrays,
    acceleration: Array,
    duration: float,
    active: MaskRows,
) -> tuple[Array, Array] | None:
    """A and B of one segment through its events, with the saltation matrix of every catch.

    Differences of the time-stepper are wrong by a factor of a hundred where a catch grazes or falls
    next to a node.

    Args:
        marionette: the puppet; none of its driven coordinates is a rotation.
        start: one state.
        acceleration: (n_vK,) of the driven coordinates.
        duration: [s].
        active: (n_strings,) bool, the active set at the start.

    Returns:
        (n_z, n_z) and (n_z, n_vK), over changes that leave taut strings taut; None where the run
        has no derivative: it stops, winches slip, or rows are caught at once by chance.
    """
    taut = np.zeros(marionette.tree.n_rows, dtype=bool)
    taut[: len(active)] = active
    x = State(0.0, start.q_D, start.v_D, start.q_K, start.v_K, taut, start.slip)
    times = np.array([0.0, duration])
    inputs = Input.segments(marionette, times, start.q_K, start.v_K, acceleration[None])
    tolerance = _TOLERANCES.integration
    try:
        run = simulate(marionette, marionette.project(x), inputs, duration, effort=False)
        by = interval_derivatives(marionette, run, inputs, rtol=tolerance, atol=tolerance)
    except FantocciniError:
        return None
    return (by.A[0], by.B[0]) if by.sharp else None


def extended(
    marionette: Marionette, at: StateArrays, active: MaskRows, acc_K: Array, duration: Array
) -> StateArrays:
    """The states reached under fixed active sets: Eqs. 10 and 11 with their strings held.

    Limits are left out, and winches do not slip.

    Args:
        marionette: the puppet; none of its driven coordinates is a rotation.
        at: (n,) states.
        active: (n, n_strings) bool, the strings that are held.
        acc_K: (n, n_vK) of the driven coordinates.
        duration: (n,) [s]; negative for backwards in time.
    """
    table, dt = marionette.coordinates, duration[:, None] / _TOLERANCES.steps
    places = table.scalars_D, table.quaternions_D
    q, v = at.q_D, at.v_D

    def driven(t: Array) -> tuple[Array, Array]:
        moved = t * (at.v_K + 0.5 * t * acc_K)
        return tangent.moved(table.scalars_K, (), at.q_K, moved), at.v_K + t * acc_K

    def rate(t: Array, turn: Array, v: Array) -> Array:
        q_D = tangent.moved(*places, q, turn)
        return _acceleration(marionette, StateArrays(q_D, v, at.slip, *driven(t)), acc_K, active)

    for step in range(_TOLERANCES.steps):
        t = step * dt
        a1 = rate(t, np.zeros_like(v), v)
        a2 = rate(t + 0.5 * dt, 0.5 * dt * v, v + 0.5 * dt * a1)
        a3 = rate(t + 0.5 * dt, 0.5 * dt * (v + 0.5 * dt * a1), v + 0.5 * dt * a2)
        a4 = rate(t + dt, dt * (v + 0.5 * dt * a2), v + dt * a3)
        q = tangent.moved(*places, q, dt * v + dt**2 / 6.0 * (a1 + a2 + a3))
        v = v + dt / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    return StateArrays(q, v, at.slip, *driven(duration[:, None]))


def _acceleration(marionette: Marionette, at: StateArrays, acc_K: Array, active: MaskRows) -> Array:
    """(n, n_vD) acc_D with active strings held: G tau = hddot without tension."""
    found = marionette.library.evaluate(
        "dynamics",
        q_D=at.q_D,
        v_D=at.v_D,
        q_K=at.q_K,
        v_K=at.v_K,
        acc_K=acc_K,
        u_D=np.zeros_like(at.v_D),
        p=marionette.p,
    )
    strings = active.shape[1]
    unit, both = np.eye(strings), active[:, :, None] & active[:, None]
    G = np.where(both, found.G, unit * ~active[:, None])
    G = G + _TOLERANCES.compliance * np.trace(G, axis1=1, axis2=2)[:, None, None] * unit
    tension = np.linalg.solve(G, (active * (found.gamma + found.a0))[..., None])
    w = found.w0 - (tension.swapaxes(1, 2) @ found.W.swapaxes(1, 2))[:, 0]
    return marionette.library.evaluate("back", L=found.L, x=w).y
