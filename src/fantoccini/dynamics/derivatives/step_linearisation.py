"""Linearisation of one step of the time-stepper, with the active set that the step finds.

With rate = dq_K/dt and mean = dv_K/dt over the step, damping and drag F implicit, and the rows in
Lambda > 0 (``cpp/fantoccini/timestepping/step.hpp``):

    (M + dt F) (v+ - v) + dt (c(q, v, q_K, rate) + M_DK mean - u_D) + A_D^T Lambda = 0
    A_D v+ + A_K rate + min(h/dt, recovery speed) = 0,      q+ = q moved by dt v+

with contacts in their modes beside the rows (``contact_rows``), are differentiated with M, A and c
at the step's start. It is the first step of a stepper: later in
a run c takes its velocity products half a step ahead, extrapolated from earlier steps, which are no
part of a state. That changes dv+ by dt^2/2 times the products' derivatives.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, StateError, check_positive, rotation
from fantoccini.dynamics.compiled import CompiledPuppet, Evaluation, Screws, vector
from fantoccini.dynamics.derivatives.contact_rows import ContactRows, HeldPoint
from fantoccini.dynamics.derivatives.kkt import KKTSystem
from fantoccini.dynamics.derivatives.linearisation import (
    Partials,
    derivatives_at,
    force_derivatives,
    row_derivatives_at,
    tension_derivatives,
)
from fantoccini.dynamics.derivatives.mode_system import solve_in_modes
from fantoccini.dynamics.derivatives.step_contacts import Contacts, step_contacts
from fantoccini.dynamics.steppers import Stepper
from fantoccini.kernel.runtime import contact_points
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import State

SHORTENED = 1e-9
"""Relative difference between the step's velocity and its equations' at which it was cut short."""
AT_CAP = 1.0 - 1e-9
"""Part of its largest tension from which a string counts as pulling with it."""


@dataclass(frozen=True, eq=False)
class StepLinearisation:
    """One step of the time-stepper and its derivatives, with the active set it found.

    As a discrete system in z = (dq_D, dv_D, dq_K, dv_K), with tangent vectors dq::

        z_next = A z + B dacc_K + B_u du_D + B_p dp

    where acc_K and u_D are constant over the step, as a stepper's are. Derivatives are exact for
    small changes consistent with all held rows and points; for others, such as tilting one of two
    flat soles, they are those of least squares.

    Attributes:
        x, x_next: the states before and after it.
        dt: its length [s].
        rows: names of the strings and limits held in it.
        tension: (n_rows,) impulses over dt [N or N m].
        A: (2 n_vD + 2 n_vK,) squared.
        B: (2 n_vD + 2 n_vK, n_vK) by the driven acceleration.
        B_u: (2 n_vD + 2 n_vK, n_vD) by the user's forces.
        B_p: (2 n_vD + 2 n_vK, n_p) by the parameters.
        pull: derivatives of ``tension`` (n_rows, ...); 0 for rows that are not held.
        contacts: the points that push, in their modes.
        push: derivatives of their forces (3 n, ...), in the world: of least norm where the law
            leaves them open, as the forces are.
        edges: what is between two modes, as a point that touches without force: A, B, B_u and B_p
            then are derivatives of the modes taken, towards one side.
        coordinates: names and places of the coordinates.
    """

    x: State
    x_next: State
    dt: float
    rows: tuple[str, ...]
    tension: Array
    A: Array
    B: Array
    B_u: Array
    B_p: Array
    pull: Partials
    contacts: tuple[HeldPoint, ...]
    push: Partials
    edges: tuple[str, ...]
    coordinates: CoordinateTable

    @property
    def sharp(self) -> bool:
        """Whether the derivative exists towards all sides: nothing is between two modes."""
        return not self.edges


def linearise_step(
    marionette: CompiledPuppet,
    x: State,
    acc_K: Array | None = None,
    u_D: Array | None = None,
    dt: float = 0.002,
) -> StepLinearisation:
    """The first time step from a state; see :meth:`Marionette.linearise_step`."""
    t = marionette.coordinates
    n, k, n_p = t.n_vD, t.n_vK, len(marionette.p)
    acc_K, u_D = vector("acc_K", acc_K, k), vector("u_D", u_D, n)
    check_positive(dt=dt)
    marionette.check_state(x)
    stepper = Stepper(marionette, x, "timestepping", marionette.run_options(dt=dt))
    x_next = stepper.advance(dt, acc_K, u_D=u_D)
    tension, upper = stepper.tension, np.minimum(marionette.upper, marionette.tension_cap)
    held = np.flatnonzero(marionette.two_sided | ((tension > 0.0) & (tension < AT_CAP * upper)))
    path = DrivenStep(t.quaternions_K, x.v_K, acc_K, dt)
    # The model as the step sees it: the mean velocity and acceleration of the inputs, M + dt F.
    start = x.replace(v_K=path.rate)
    at = Evaluation.of(marionette, start, path.mean, u_D, dt)
    touching = _Touching.of(marionette, stepper, at, start, x_next, dt)
    acc_D = at.back(at.w0 - at.W @ tension + touching.push(at))
    if np.max(np.abs(x.v_D + dt * acc_D - x_next.v_D), initial=0.0) > SHORTENED * (
        1.0 + np.max(np.abs(x_next.v_D), initial=0.0)
    ):
        raise StateError(
            "the step was cut short: strings are violated so far, or so fast, that the "
            "time-stepper scaled the velocities down"
        )
    found = derivatives_at(marionette, start, acc_D, path.mean, tension, dt)
    by = force_derivatives(marionette, found, tension)
    rate = _row_rates(marionette, start.replace(v_D=x.v_D + dt * acc_D), at, dt)
    dacc, dtension, dpush = touching.solve(at, held, by, rate[held])
    dpull = tension_derivatives(marionette, tension, held, dtension)
    # From (q_D, v_D, q_K, rate, mean, u_D, p) to (q_D, v_D, q_K, v_K, acc_K, u_D, p).
    chain = path.chain(n, n_p)
    dv = dt * dacc @ chain
    dv[:, n : 2 * n] += np.eye(n)
    dq = _carried(t.quaternions_D, dt * x_next.v_D, dt * dv, n)
    widths = [n, n, k, k, k, n, n_p]
    columns = Partials.of(np.concatenate([dq, dv, path.state(n, n_p)]), widths)
    return StepLinearisation(
        x=x,
        x_next=x_next,
        dt=dt,
        rows=tuple(marionette.tree.row_names[i] for i in held),
        tension=tension,
        A=np.concatenate([columns.q_D, columns.v_D, columns.q_K, columns.v_K], axis=1),
        B=columns.acc_K,
        B_u=columns.u_D,
        B_p=columns.p,
        pull=Partials.of(dpull @ chain, widths),
        contacts=touching.contacts.points,
        push=Partials.of(dpush @ chain, widths),
        edges=touching.contacts.edges,
        coordinates=t,
    )


@dataclass(frozen=True, eq=False)
class _Touching:
    """What touches in a step, and the links before it and with the velocities after it."""

    contacts: Contacts
    before: Screws | None
    after: Screws | None
    dt: float

    @classmethod
    def of(
        cls,
        marionette: CompiledPuppet,
        stepper: Stepper,
        at: Evaluation,
        start: State,
        end: State,
        dt: float,
    ) -> _Touching:
        if marionette.contacts is None:
            return cls(Contacts((), ()), None, None, dt)
        found = contact_points(stepper.contacts, marionette.contacts.names)
        found = found.at(len(stepper.samples) - 1)
        before, after = Screws(marionette, start), Screws(marionette, start.replace(v_D=end.v_D))
        kick = dt * at.back(at.w0)
        return cls(
            step_contacts(marionette, before, after, kick, start, found, dt), before, after, dt
        )

    def push(self, at: Evaluation) -> Array:
        """(n_vD,) F^-T of the forces of all points."""
        if self.after is None or not self.contacts.points:
            return np.zeros_like(at.w0)
        rows = ContactRows(self.after, self.contacts.points, self.dt)
        return -at.forth(rows.multipliers @ rows.forces)

    def solve(
        self, at: Evaluation, held: Indices, force: Array, rate: Array
    ) -> tuple[Array, Array, Array]:
        """Changes of acc_D, of the held rows' tensions and of the points' forces."""
        if self.before is None or self.after is None or not self.contacts.points:
            return *KKTSystem(at, held).solve(force, rate), np.zeros((0, force.shape[1]))
        points = self.contacts.points
        return solve_in_modes(at, held, force, rate, self._rows, points)

    def _rows(self, points: Sequence[HeldPoint]) -> tuple[ContactRows, Array]:
        """The points' rows, and their changes at fixed acc_D, over dt."""
        assert self.before is not None and self.after is not None
        rows = ContactRows(self.after, points, self.dt)
        struck = ContactRows(self.before, points, 0.0)
        return rows, (rows.velocity_by() + struck.bounce_by()) / self.dt


def _row_rates(marionette: CompiledPuppet, x: State, at: Evaluation, dt: float) -> Array:
    """Derivatives of (A_D v+ + A_K rate + min(h/dt, recovery speed)) / dt at fixed acc_D.

    By q_D, v_D, q_K, rate, mean, u_D and p, in one array; ``x`` has v+ and the rate.
    """
    found = row_derivatives_at(marionette, x)
    rate = np.where(marionette.two_sided, np.abs(at.h), at.h) / dt
    recovers = rate < marionette.run_options().recovery_speed
    gap = np.where(recovers, 1.0 / dt, 0.0)[:, None]
    none = np.zeros_like(found["A_K"]), np.zeros_like(found["A_D"])
    columns = (
        found["hdot_q"] + gap * found["A_D"],
        found["A_D"],
        found["hdot_qK"] + gap * found["A_K"],
        found["A_K"],
        *none,
        found["hdot_p"] + gap * found["h_p"],
    )
    return np.concatenate(columns, axis=1) / dt


def _carried(quaternions: Iterable[tuple[int, int]], move: Array, dmove: Array, n_dq: int) -> Array:
    """Change of the tangent vector at q moved by ``move``: Exp(-move) dq + J_r(move) dmove.

    Args:
        quaternions: (q, v) places of rotations; scalars add.
        move: (n,) tangent vector.
        dmove: (n, m) its change.
        n_dq: number of columns of dq, which are the first ones.
    """
    out = dmove.copy()
    carry = np.eye(len(move), n_dq)
    for _, v in quaternions:
        here = slice(v, v + 3)
        out[here] = rotation.right_jacobian(move[here]) @ dmove[here]
        carry[here, here] = rotation.matrix(rotation.exp(-move[here]))
    out[:, :n_dq] += carry
    return out


class DrivenStep:
    """The driven coordinates over a step at constant acceleration.

    Args:
        quaternions: (q, v) places of their rotations.
        v_K, acc_K: (n_vK,) at the start; the rotation vector's for rotations.
        dt: the step [s].
    """

    def __init__(self, quaternions: Iterable[tuple[int, int]], v_K: Array, acc_K: Array, dt: float):
        self._quaternions, self.dt, k = tuple(quaternions), dt, len(v_K)
        self._move = dt * v_K + 0.5 * dt * dt * acc_K
        end, by_v, by_a = v_K + dt * acc_K, np.eye(k), dt * np.eye(k)
        for _, v in self._quaternions:
            here = slice(v, v + 3)
            phi, speed = self._move[here], end[here].copy()
            J = rotation.right_jacobian(phi)
            bend = np.stack(
                [rotation.right_jacobian_rate(phi, e) @ speed for e in np.eye(3)], axis=1
            )
            end[here] = J @ speed
            by_v[here, here] = dt * bend + J
            by_a[here, here] = 0.5 * dt * dt * bend + dt * J
        self.rate = self._move / dt
        self.mean = (end - v_K) / dt
        self._end_by_v, self._end_by_a = by_v, by_a

    def mean_by(self, here: slice) -> tuple[Array, Array]:
        """Derivatives of some of ``mean`` by the same v_K and acc_K."""
        by_v, by_a = self._end_by_v[here, here], self._end_by_a[here, here]
        return (by_v - np.eye(len(by_v))) / self.dt, by_a / self.dt

    def chain(self, n: int, n_p: int) -> Array:
        """d(q_D, v_D, q_K, rate, mean, u_D, p) by (q_D, v_D, q_K, v_K, acc_K, u_D, p)."""
        k, dt = len(self.rate), self.dt
        out = np.eye(3 * n + 3 * k + n_p)
        v, a = slice(2 * n + k, 2 * n + 2 * k), slice(2 * n + 2 * k, 2 * n + 3 * k)
        out[v, a] = 0.5 * dt * np.eye(k)
        out[a, v], out[a, a] = self.mean_by(slice(0, k))
        return out

    def state(self, n: int, n_p: int) -> Array:
        """d(q_K, v_K) after the step by (q_D, v_D, q_K, v_K, acc_K, u_D, p)."""
        k, dt = len(self.rate), self.dt
        move, speed = np.zeros((k, 3 * n + 3 * k + n_p)), np.zeros((k, 3 * n + 3 * k + n_p))
        v, a = slice(2 * n + k, 2 * n + 2 * k), slice(2 * n + 2 * k, 2 * n + 3 * k)
        move[:, v], move[:, a] = dt * np.eye(k), 0.5 * dt * dt * np.eye(k)
        speed[:, v], speed[:, a] = self._end_by_v, self._end_by_a
        moved = _carried(self._quaternions, self._move, move[:, 2 * n :], k)
        return np.concatenate([np.concatenate([np.zeros((k, 2 * n)), moved], axis=1), speed])
