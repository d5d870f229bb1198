"""Linearisation: derivatives of accelerations and tensions while the active set stays.

    M acc_D + M_DK acc_K + c - u_D + A_D^T tension = 0,   A_D acc_D + A_K acc_K + Adot v = 0

By the implicit function theorem, with r and hddot the left sides and d a change of state, input
or parameter:

    M dacc_D + A_D^T dtension = -r_d,   A_D dacc_D = -hddot_d      over the held rows

Contacts add their rows and forces, each point in its mode (``contact_rows``).

Changes of a configuration are tangent vectors, of the size of the velocities: a scalar adds, an
orientation turns by a rotation vector in the body's frame.

The first equation is that of the dynamic coordinates (D), driven by the accelerations acc_K of the
others (K: ends and lengths of strings); the second keeps taut strings and limits, the held rows, at
h = 0.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, ShortRepr, UnknownNameError
from fantoccini.dynamics.compiled import CompiledPuppet, Evaluation, forward_dynamics, vector
from fantoccini.dynamics.derivatives.contact_rows import HeldPoint, PointMode
from fantoccini.dynamics.derivatives.contact_state import FrozenModes, motion_with_contact, touches
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import State


@dataclass(frozen=True, eq=False, repr=False)
class Partials(ShortRepr):
    """Derivatives of one quantity, with a row for each of its entries.

    Attributes:
        q_D: (n, n_vD) derivatives by tangent vectors of the dynamic configuration [per rad or m].
        v_D: (n, n_vD) derivatives by the dynamic velocity.
        q_K: (n, n_vK) derivatives by tangent vectors of the driven configuration.
        v_K: (n, n_vK) derivatives by the driven velocity.
        acc_K: (n, n_vK) derivatives by the driven acceleration.
        u_D: (n, n_vD) derivatives by the user's forces.
        p: (n, n_p) derivatives by the parameters.
    """

    q_D: Array
    v_D: Array
    q_K: Array
    v_K: Array
    acc_K: Array
    u_D: Array
    p: Array

    @classmethod
    def from_columns(cls, columns: Array, widths: Iterable[int]) -> Partials:
        """Derivatives from all columns in one array."""
        return cls(*np.split(columns, np.cumsum(list(widths))[:-1], axis=1))


@dataclass(frozen=True, eq=False, repr=False)
class Linearisation(ShortRepr):
    """A puppet's accelerations and tensions near a state, with a fixed active set.

    As a linear system in z = (dq_D, dv_D, dq_K, dv_K), with tangent vectors dq, around a motion::

        zdot = A z + B dacc_K + B_u du_D + B_p dp

    Only z with A_D dq_D + A_K dq_K = 0 over the held rows, and the same for the rates, are small
    changes of the puppet, and those that keep contact points closed and, if sticking, at rest.
    Every held row adds two eigenvalues 0 to A.

    Attributes:
        x: the state.
        rows: names of the held strings and limits.
        acc_D: (n_vD,) acceleration there [rad/s^2 or m/s^2].
        tension: (n_rows,) forces of strings and limits there [N or N m].
        acc: derivatives of acc_D (n_vD, ...).
        tension_partials: derivatives of the tensions (n_rows, ...); 0 for rows that are not held.
        contacts: the points that push, in their modes.
        force_partials: derivatives of their forces (3 n, ...), in the world; of least norm where
            the law does not determine them, as the forces are.
        edges: contacts between two modes, such as a point that touches without force: the
            derivatives are then those of the modes taken, towards one side.
        coordinates: names and places of the coordinates.
    """

    x: State
    rows: tuple[str, ...]
    acc_D: Array
    tension: Array
    acc: Partials
    tension_partials: Partials
    contacts: tuple[HeldPoint, ...]
    force_partials: Partials
    edges: tuple[str, ...]
    coordinates: CoordinateTable

    @property
    def differentiable(self) -> bool:
        """Whether the derivative exists towards all sides: no contact is between two modes."""
        return not self.edges

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the entries of z: ``dq:elbow``, ``v:elbow``, then the driven ones."""
        t = self.coordinates
        return tuple(
            f"{kind}:{name}" for names in (t.v_D, t.v_K) for kind in ("dq", "v") for name in names
        )

    @property
    def A(self) -> Array:
        """Derivatives of zdot by z: (2 n_vD + 2 n_vK,) squared."""
        t = self.coordinates
        n, k = t.n_vD, t.n_vK
        A = np.zeros((2 * (n + k), 2 * (n + k)))
        A[:n, :n] = rotation_rate_blocks(t.quaternions_D, self.x.v_D)
        A[:n, n : 2 * n] = np.eye(n)
        parts = (self.acc.q_D, self.acc.v_D, self.acc.q_K, self.acc.v_K)
        A[n : 2 * n] = np.concatenate(parts, axis=1)
        A[2 * n : 2 * n + k, 2 * n : 2 * n + k] = rotation_rate_blocks(t.quaternions_K, self.x.v_K)
        A[2 * n : 2 * n + k, 2 * n + k :] = np.eye(k)
        return A

    @property
    def B(self) -> Array:
        """Derivatives of zdot by acc_K, the input of Eq. 12: (2 n_vD + 2 n_vK, n_vK)."""
        B = self._padded(self.acc.acc_K)
        B[len(B) - B.shape[1] :] = np.eye(B.shape[1])
        return B

    @property
    def B_u(self) -> Array:
        """Derivatives of zdot by the user's forces: (2 n_vD + 2 n_vK, n_vD)."""
        return self._padded(self.acc.u_D)

    @property
    def B_p(self) -> Array:
        """Derivatives of zdot by the parameters: (2 n_vD + 2 n_vK, n_p)."""
        return self._padded(self.acc.p)

    def _padded(self, acc: Array) -> Array:
        """Derivatives of zdot by a quantity that enters it through acc_D only."""
        n, k = self.coordinates.n_vD, self.coordinates.n_vK
        B = np.zeros((2 * (n + k), acc.shape[1]))
        B[n : 2 * n] = acc
        return B


def linearise(
    marionette: CompiledPuppet,
    x: State,
    acc_K: Array | None = None,
    u_D: Array | None = None,
    rows: Iterable[str] | None = None,
    contacts: Iterable[PointMode] | None = None,
) -> Linearisation:
    """Derivatives of acc_D and of the tensions; see :meth:`Marionette.linearise`."""
    table, n_p = marionette.coordinates, len(marionette.p)
    acc_K, u_D = vector("acc_K", acc_K, table.n_vK), vector("u_D", u_D, table.n_vD)
    evaluation = Evaluation.at_state(marionette, x, acc_K, u_D)
    point_modes, edges = tuple(contacts or ()), tuple[str, ...]()
    tension = np.zeros(marionette.tree.n_rows)
    in_contact = contacts is None and touches(marionette, x)
    if in_contact or (point_modes and rows is None):
        motion = motion_with_contact(marionette, x, acc_K, u_D)
        acc_D, tension = motion.acc_D, motion.tension
        if contacts is None:
            point_modes, edges = motion.contacts.points, motion.contacts.edges
    elif rows is None:
        acc_D, tension = forward_dynamics(marionette, x, acc_K, u_D)
    if rows is None:
        carries_tension = marionette.two_sided | (
            (tension > 0.0) & (tension < marionette.max_forces)
        )
        held: Indices = np.flatnonzero(carries_tension)
    else:
        held = named_rows(marionette, rows)
    frozen, pushing_points = FrozenModes(marionette, point_modes), list[HeldPoint]()
    if rows is not None or point_modes:
        acc_D, held_tension, pushing_points = frozen.accelerations_and_forces(
            evaluation, x, acc_K, held
        )
        tension = np.zeros(marionette.tree.n_rows)
        tension[held] = held_tension
    derivatives = derivatives_at(marionette, x, acc_D, acc_K, tension)
    force_by = force_derivatives(marionette, derivatives, tension)
    row_by = row_derivatives(derivatives)[held]
    dacc, dtension, dpush = frozen.solve(
        evaluation, x, (acc_D, acc_K), held, pushing_points, force_by, row_by
    )
    widths = [table.n_vD] * 2 + [table.n_vK] * 3 + [table.n_vD, n_p]
    return Linearisation(
        x=x,
        rows=tuple(marionette.tree.row_names[i] for i in held),
        acc_D=acc_D,
        tension=tension,
        acc=Partials.from_columns(dacc, widths),
        tension_partials=Partials.from_columns(
            tension_derivatives(marionette, tension, held, dtension), widths
        ),
        contacts=tuple(pushing_points),
        force_partials=Partials.from_columns(dpush, widths),
        edges=edges,
        coordinates=table,
    )


def named_rows(marionette: CompiledPuppet, names: Iterable[str]) -> Indices:
    """Indices of strings and limits, in order."""
    row_names = marionette.tree.row_names
    names = (names,) if isinstance(names, str) else tuple(names)
    for name in names:
        if name not in row_names:
            raise UnknownNameError("string or limit", name, row_names)
    return np.array(sorted(row_names.index(name) for name in set(names)), dtype=int)


def derivatives_at(
    marionette: CompiledPuppet, x: State, acc_D: Array, acc_K: Array, tension: Array
) -> dict[str, Array]:
    """All compiled derivatives at one state: name (``equations.derivatives``) -> values."""
    values: dict[str, Array | float] = {
        **marionette.at(x),
        "acc_D": acc_D,
        "acc_K": acc_K,
        "tension": tension,
        "dt": 0.0,
    }
    results: dict[str, Array] = {}
    for name in ("force_by_q", "force_by_v", "force_by_K", "rows_by"):
        results |= marionette.libraries.derivatives.at(name, values)
    return results


def row_derivatives_at(
    marionette: CompiledPuppet, x: State, v_D: Array | None = None
) -> dict[str, Array]:
    """Compiled derivatives of h and hdot at a state: name -> values.

    Args:
        marionette: the puppet.
        x: the state.
        v_D: (..., n_vD) other velocities there; the results are then (..., *shape).
    """
    values = marionette.at(x) | {"acc_D": np.zeros_like(x.v_D), "acc_K": np.zeros_like(x.v_K)}
    if v_D is not None:
        values["v_D"] = v_D
    return marionette.libraries.derivatives.at("rows_by", values)


def force_derivatives(
    marionette: CompiledPuppet, results: dict[str, Array], tension: Array
) -> Array:
    """Derivatives of r by q_D, v_D, q_K, v_K, acc_K, u_D and p, in one array."""
    n = len(results["r_q"])
    by_p = results["r_p"] + results["A_D"].T @ _slipping_by_p(marionette, tension)
    columns = (results["r_q"], results["r_v"], results["r_qK"], results["r_vK"], results["M_DK"])
    return np.concatenate([*columns, -np.eye(n), by_p], axis=1)


def row_derivatives(results: dict[str, Array]) -> Array:
    """Derivatives of hddot by q_D, v_D, q_K, v_K, acc_K, u_D and p, in one array."""
    names = ("hddot_q", "hddot_v", "hddot_qK", "hddot_vK", "A_K")
    zeros = np.zeros_like(results["hddot_v"])
    return np.concatenate([*(results[name] for name in names), zeros, results["hddot_p"]], axis=1)


def tension_derivatives(
    marionette: CompiledPuppet, tension: Array, held: Indices, dtension: Array
) -> Array:
    """Derivatives (n_rows, m) of all tensions, from those of the held rows."""
    derivatives = np.zeros((marionette.tree.n_rows, dtension.shape[1]))
    derivatives[:, derivatives.shape[1] - len(marionette.p) :] = _slipping_by_p(marionette, tension)
    derivatives[held] = dtension
    return derivatives


def _slipping_by_p(marionette: CompiledPuppet, tension: Array) -> Array:
    """Derivatives (n_rows, n_p) of the tensions of strings that slip, by the parameters."""
    out = np.zeros((len(tension), len(marionette.p)))
    cap_index = marionette.cap_parameters
    slipping = np.flatnonzero((cap_index >= 0) & (tension >= marionette.max_forces))
    out[slipping, cap_index[slipping]] = 1.0
    return out


def rotation_rate_blocks(quaternions: Iterable[tuple[int, int]], v: Array) -> Array:
    """Blocks -[w]x of every rotation (n_v, n_v): the rate of a small rotation in a turning frame.

    Args:
        quaternions: (q, v) indices of rotations.
        v: (n_v,) velocity.
    """
    blocks = np.zeros((len(v), len(v)))
    for _, start in quaternions:
        x, y, z = v[start : start + 3]
        blocks[start : start + 3, start : start + 3] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    return blocks
