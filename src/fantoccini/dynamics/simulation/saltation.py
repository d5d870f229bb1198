"""Small changes of the state across an impulse: the saltation matrix.

A change dz of the state moves the time of the impulse, h = 0, by dt = -dh / hdot-. With the impulse
v+ = R(q, v-) of Eqs. 13-15 and f = (v_D, acc_D),

    dz+ = dR (dz- + f- dt) - f+ dt,

for changes of the state alone, the saltation matrix is dR + (f+ - dR f-) (-dh/dz) / hdot-. dR comes
from the impulse's own equations, over the rows that are struck or held afterwards and, for solids
that touch, over points in their modes:

    M (v+ - v-) + A_D^T Lambda - U^T X = 0,   hdot+ = -e max(hdot-, 0),
    u_n+ = e max(-u_n-, 0),   X = x_n n where u_T+ = 0, else x_n (n - mu u_T+/|u_T+|)

These rows and points are determined by :mod:`fantoccini.dynamics.simulation.catch` and
:mod:`fantoccini.dynamics.simulation.impact`.

h is the gap of a string, path length minus string length, and a row a string or a limit with its
gap; - and + mark values before and after the impulse. D stands for the dynamic coordinates, K for
the driven ones. U are the derivatives of the contact velocities u, X their impulses. A twist is a
velocity of a link, linear and angular; a screw is the twist per unit of one joint velocity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, SimulationError, Status
from fantoccini.base.documents import Parameter
from fantoccini.dynamics.compiled import Evaluation, Screws
from fantoccini.dynamics.derivatives import (
    ContactRows,
    HeldPoint,
    KKTSystem,
    row_derivatives_at,
    solve_in_modes,
)
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation.contact_pieces import TIME_AGREEMENT, state_and_input_changes
from fantoccini.dynamics.simulation.input_piece import InputVariation
from fantoccini.kernel.contract import WINCH_AT
from fantoccini.motion import State

VELOCITY_ERROR = 1e-4
"""Largest accepted difference between the equations' and the run's velocities after an impulse,
relative to 1 + |v|."""
RELATIVE_ROUNDING = 1e-9
"""Impulses and speeds that count as rounding, relative to the largest."""


@dataclass(frozen=True, eq=False)
class Passage:
    """An event of a run and its saltation matrix: a catch, an impact, or sliding that stops.

    Attributes:
        t: time [s].
        rows: names of the strings and limits caught, of the parts that touch, as ``foot|floor``, or
            of those that stop sliding on one another.
        speed: closing speed of the gap that decides the time [m/s or rad/s]; 0 for a point that
            stops.
        jump: (2 n_vD, 2 n_vD) saltation matrix: changes of (q_D, v_D) from before to after.
        differentiable: whether the derivative exists: one string comes taut, or one point touches,
            or several that always do so together, and no other is at its bound by chance.
            Otherwise ``jump`` holds for changes that keep the sequence of events.
    """

    t: float
    rows: tuple[str, ...]
    speed: float
    jump: Array
    differentiable: bool


def normal_speed(screws: Screws, point: HeldPoint) -> float:
    """Speed at which a point's gap opens [m/s]."""
    a, b = point.touch.links
    twist = screws.twist(a) - screws.twist(b)
    return float(point.touch.normal @ (twist[:3] + np.cross(twist[3:], point.touch.point)))


class Guard:
    """Guard of an impact: the gap whose closing decides its time.

    Args:
        by: (n_columns,) changes of -gap.
        speed: closing speed [m/s or rad/s].
    """

    def __init__(self, by: Array, speed: float):
        self._gap_by, self.speed = by, speed

    @classmethod
    def of_point(cls, screws: Screws, point: HeldPoint) -> Guard:
        a, b = point.touch.links
        gap = point.touch.by_twist[0] @ (screws.pose_by(a) - screws.pose_by(b))
        return cls(-gap, -normal_speed(screws, point))

    @classmethod
    def of_row(cls, results: dict[str, Array], row: int, speed: float) -> Guard:
        """Guard of a string or limit; ``results`` from :func:`row_derivatives_at`."""
        A_D, A_K = results["A_D"][row], results["A_K"][row]
        by = [A_D, 0.0 * A_D, A_K, np.zeros(2 * len(A_K)), 0.0 * A_D, results["h_p"][row]]
        return cls(np.concatenate(by), float(speed))

    def time_change(self, D: Array) -> Array:
        """Change (1, m) of the time [s]."""
        return np.asarray(-(self._gap_by @ D)[None] / self.speed)


@dataclass(frozen=True, eq=False)
class Saltation:
    """An impulse of a run, and small changes across it.

    Attributes:
        marionette: the puppet.
        before: state before the impulse.
        at: the model at this state.
        rows: rows struck, or held afterwards.
        points: contact points that take part.
        restitution: (n_rows,) restitution of the rows that close.
        velocity_jump: (n_vD,) change of velocity v+ - v-.
        impulse: (n_rows,) impulses Lambda.
        guards: gaps that close; the fastest decides the time.
        names: names of the rows and parts that close.
        edges: rows and points at their bound by chance, in words.
    """

    marionette: Marionette
    before: State
    at: Evaluation
    rows: Indices
    points: Sequence[HeldPoint]
    restitution: Array
    velocity_jump: Array
    impulse: Array
    guards: Sequence[Guard]
    names: tuple[str, ...]
    edges: Sequence[str]

    @property
    def after(self) -> State:
        """State after the impulse, from its equations."""
        return self.before.replace(v_D=self.before.v_D + self.velocity_jump)

    def check(self, v_D: Array, subject: str) -> None:
        """Raises SimulationError unless the velocities after the impulse are ``v_D``."""
        error = np.abs(self.after.v_D - v_D) / (1.0 + np.abs(v_D))
        if np.max(error, initial=0.0) > VELOCITY_ERROR:
            raise SimulationError(
                Status.NOT_SETTLED, f"the {subject}, as when restitutions are scaled down"
            )

    def across_impulse(
        self, Z: Array, input_change: InputVariation, acc: tuple[Array, Array], acc_K: Array
    ) -> tuple[Array, Passage]:
        """Changes after the impulse, at a fixed time, and the impulse with its saltation matrix.

        Args:
            Z: (2 n_vD, m) changes before the impulse.
            input_change: changes of inputs and parameters.
            acc: acc_D before and after the impulse.
            acc_K: (n_vK,) driven acceleration before the impulse.
        """
        m, n = Z.shape[1], len(Z)
        widened = np.concatenate([Z, np.eye(n)], axis=1)
        widened_after = self._changes_after(widened, input_change.widened(n), acc, acc_K)
        changes = state_and_input_changes(Z, input_change)
        time_changes = np.array([guard.time_change(changes)[0] for guard in self.guards])
        spread = float(np.max(np.abs(time_changes - time_changes[:1]), initial=0.0))
        is_simultaneous = spread <= TIME_AGREEMENT * float(
            np.max(np.abs(time_changes), initial=1e-9)
        )
        differentiable = len(time_changes) > 0 and is_simultaneous and not self.edges
        speed = max((guard.speed for guard in self.guards), default=0.0)
        return widened_after[:, :m], Passage(
            self.before.t, self.names, speed, widened_after[:, m:], differentiable
        )

    def _changes_after(
        self, Z: Array, input_change: InputVariation, acc: tuple[Array, Array], acc_K: Array
    ) -> Array:
        """Changes after the impulse, at a fixed time; see :meth:`across_impulse`."""
        x, n, marionette = self.before, len(self.before.v_D), self.marionette
        D = state_and_input_changes(Z, input_change)
        time_change = np.zeros((1, Z.shape[1]))
        if self.guards:
            time_change = max(self.guards, key=lambda guard: guard.speed).time_change(D)
        q_D, v_D = Z[:n] + x.v_D[:, None] * time_change, Z[n:] + acc[0][:, None] * time_change
        q_K, v_K = (
            input_change.q_K + x.v_K[:, None] * time_change,
            input_change.v_K + acc_K[:, None] * time_change,
        )
        p = input_change.p
        D = state_and_input_changes(
            np.concatenate([q_D, v_D]),
            InputVariation(q_K, v_K, input_change.acc_K, input_change.u_D, p),
        )
        before, after = (row_derivatives_at(marionette, state) for state in (x, self.after))
        speed_change = rate_change(before, q_D, q_K, v_K, p) + before["A_D"] @ v_D
        rate_after = rate_change(after, q_D, q_K, v_K, p) + after["A_D"] @ v_D
        rate_after += self.restitution[:, None] * speed_change
        rate_after += restitution_change(marionette, self.at) @ p
        force = force_change(marionette, x, self.velocity_jump, self.impulse, q_D, q_K, p)
        velocity_jump = self._solve(force, rate_after[self.rows], D)
        q_D = q_D - self.after.v_D[:, None] * time_change
        return np.concatenate([q_D, v_D + velocity_jump - acc[1][:, None] * time_change])

    def _solve(self, force: Array, rate: Array, D: Array) -> Array:
        """Changes (n_vD, m) of the kick."""
        if not self.points:
            return KKTSystem(self.at, self.rows).solve(force, rate)[0]

        screws_before = Screws(self.marionette, self.before, changes=D)
        screws_after = Screws(self.marionette, self.after, changes=D)

        def rows(points: Sequence[HeldPoint]) -> tuple[ContactRows, Array]:
            held, struck = (
                ContactRows(screws_after, points, 1.0),
                ContactRows(screws_before, points, 0.0),
            )
            return held, held.velocity_by() + struck.bounce_by()

        return solve_in_modes(self.at, self.rows, force, rate, rows, self.points)[0]


def string_restitution(marionette: Marionette, evaluation: Evaluation) -> Array:
    """Restitution (n_rows,) of the rows that close."""
    out = np.zeros(len(evaluation.hdot))
    out[: len(marionette.tree.strings)] = marionette.winches[:, WINCH_AT["restitution"]]
    out[evaluation.hdot <= 0.0] = 0.0
    return out


def force_change(
    marionette: Marionette,
    before: State,
    velocity_jump: Array,
    impulse: Array,
    q_D: Array,
    q_K: Array,
    p: Array,
) -> Array:
    """Change of M (v+ - v-) + A_D^T Lambda at fixed v+ - v- and Lambda.

    It is the residual of the equations of motion at rest with the kick as acc_D, less that of
    gravity and springs.
    """
    x = before.replace(v_D=np.zeros_like(before.v_D), v_K=np.zeros_like(before.v_K))
    values = marionette.at(x) | {
        "acc_D": np.stack([velocity_jump, np.zeros_like(velocity_jump)]),
        "acc_K": x.v_K,
        "tension": np.stack([impulse, np.zeros_like(impulse)]),
        "dt": np.array(0.0),
    }
    library = marionette.libraries.derivatives
    results = library.at("force_by_q", values) | library.at("force_by_K", values)
    partials = {name: part[0] - part[1] for name, part in results.items()}
    return partials["r_q"] @ q_D + partials["r_qK"] @ q_K + partials["r_p"] @ p


def restitution_change(marionette: Marionette, evaluation: Evaluation) -> Array:
    """Derivative (n_rows, n_p) of e max(hdot-, 0) by the parameters."""
    out = np.zeros((marionette.tree.n_rows, len(marionette.p)))
    for i, string in enumerate(marionette.tree.strings):
        if isinstance(string.restitution, Parameter):
            column = marionette.parameter_index[string.restitution.parameter]
            out[i, column] = max(evaluation.hdot[i], 0.0)
    return out


def rate_change(results: dict[str, Array], q_D: Array, q_K: Array, v_K: Array, p: Array) -> Array:
    """Changes (n_rows, m) of hdot at fixed v_D; ``results`` from :func:`row_derivatives_at`."""
    return (
        results["hdot_q"] @ q_D
        + results["hdot_qK"] @ q_K
        + results["A_K"] @ v_K
        + results["hdot_p"] @ p
    )
