"""Factorised equations of motion at a state, for taut strings and contacts that keep their modes.

    (M + Z^T Z) x + B^T y = -force,   C x = -rate

Held rows are the strings and limits that stay taut, and the directions in which contact points do
not move. C are their Jacobians, and B those of the forces that hold them; the two differ where
solids slide. Z is the effect of friction whose direction turns with the velocity.

A contact point is open, sticks or slides: its mode. x are dynamic accelerations acc_D and y the
forces of the held rows; M is the inertia matrix.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from fantoccini.base import Array, Indices, StateError
from fantoccini.dynamics.compiled import Evaluation
from fantoccini.dynamics.derivatives.contact_rows import (
    ContactMode,
    ContactRows,
    HeldPoint,
    HeldRows,
)
from fantoccini.dynamics.derivatives.kkt import DEPENDENT_ROWS

FORCE_SHIFT = 0.1
"""Change of the redundant forces, relative to the largest force, in the test whether motions depend
on them."""
MIN_DEPENDENCE = 1e-6
"""Smallest change of a derivative that counts as dependence, relative to the largest derivative
with respect to the same quantity."""
ROUNDING = 1e-8
"""Rounding error of the derivatives by one quantity, relative to the largest of all."""

RowsOfPoints = Callable[[Sequence[HeldPoint]], tuple[ContactRows, Array]]


def solve_in_modes(
    evaluation: Evaluation,
    held: Indices,
    force: Array,
    rate: Array,
    rows_of_points: RowsOfPoints,
    points: Sequence[HeldPoint],
) -> tuple[Array, Array, Array]:
    """Changes of acc_D (n_vD, m), of tensions (len(held), m) and of forces (3 points, m).

    Args:
        evaluation: the puppet's model, evaluated at the state.
        held: indices of the strings and limits that are held.
        force: (n_vD, m) changes of the forces without contact, at fixed acc_D and tensions.
        rate: (len(held), m) changes of the held rows.
        rows_of_points: callback that returns the rows of points, and their changes (k, m) at fixed
            acc_D.
        points: the held points.

    Raises:
        StateError: friction jams, or the motion depends on how redundant points share their force.
    """
    contact_rows, point_rates = rows_of_points(points)
    system = ModeSystem(evaluation, held, contact_rows)
    acc, y = system.solve(force + contact_rows.force_by(), np.concatenate([rate, point_rates]))
    if len(system.redundant) and any(point.mode is ContactMode.SLIDE for point in points):
        shifted_points = _with_shifted_forces(points, system.redundant[:, len(held) :])
        shifted_contacts, point_rates = rows_of_points(shifted_points)
        shifted_system = ModeSystem(evaluation, held, shifted_contacts)
        shifted_acc, _ = shifted_system.solve(
            force + shifted_contacts.force_by(), np.concatenate([rate, point_rates])
        )
        largest = np.max(np.abs(acc), axis=0)
        tolerance = MIN_DEPENDENCE * np.maximum(largest, ROUNDING * np.max(largest, initial=0.0))
        if np.any(np.max(np.abs(shifted_acc - acc), axis=0) > tolerance):
            raise StateError(
                f"{contact_rows.names} slide on more points than the law can share force among, "
                "and "
                "nearby motions depend on the shares, so that there is no derivative"
            )
    n = len(held)
    return acc, y[:n], contact_rows.push_by(y[n:], acc)


def _with_shifted_forces(points: Sequence[HeldPoint], redundant: Array) -> list[HeldPoint]:
    """The points with other forces that have the same effect at this state."""
    largest = max(float(np.linalg.norm(point.force)) for point in points)
    shift = (
        FORCE_SHIFT
        * largest
        * np.sum(redundant * np.cos(np.arange(len(redundant)))[:, None], axis=0)
    )
    shifted, first_multiplier = [], 0
    for point in points:
        k = len(point.directions)
        change = point.pushes.T @ shift[first_multiplier : first_multiplier + k]
        shifted.append(dataclasses.replace(point, force=point.force + change))
        first_multiplier += k
    return shifted


class ModeSystem:
    """Factorised equations of motion at one state.

    Attributes:
        redundant: (r, k) combinations of forces without effect.

    Args:
        evaluation: the puppet's model, evaluated at the state.
        held: indices of the strings and limits that are held.
        contacts: rows of the held points.

    Raises:
        StateError: friction jams, so that no forces keep the modes.
    """

    def __init__(self, evaluation: Evaluation, held: Indices, contacts: HeldRows):
        rows, forces, drags = contacts.rows, contacts.forces, contacts.drags
        self._at, self._names = evaluation, contacts.names
        string_rows = evaluation.W[:, held]
        self._C = np.concatenate([string_rows, _scaled(evaluation, rows)], axis=1)
        self._B = np.concatenate([string_rows, _scaled(evaluation, forces)], axis=1)
        Z = _scaled(evaluation, drags)
        self._inverse = np.linalg.inv(np.eye(len(string_rows)) + Z @ Z.T)
        u, s, vt = np.linalg.svd(self._C.T @ self._inverse @ self._B)
        significant = s > DEPENDENT_ROWS * np.max(s, initial=0.0)
        s_C = np.linalg.svd(self._C, compute_uv=False)
        if np.sum(significant) < np.sum(s_C > np.sqrt(DEPENDENT_ROWS) * np.max(s_C, initial=0.0)):
            raise StateError(
                f"friction jams at {contacts.names}: no forces keep these modes, so that "
                "derivatives do not exist"
            )
        self._u, self._s, self._v = (
            u[:, : len(s)][:, significant],
            s[significant],
            vt[: len(s)][significant].T,
        )
        self.redundant = vt[np.sum(significant) :]

    @property
    def held(self) -> Array:
        """(n_vD, k) matrix F^-T C^T of the held rows, with M = F^T F."""
        return self._C

    def solve(self, force: Array, rate: Array) -> tuple[Array, Array]:
        """Solution x (n_vD, m) and y (k, m), of least norm if it is not unique.

        If redundant points cannot all stay closed, their rows are inconsistent, and x is the
        least-squares solution.

        Args:
            force: (n_vD, m) right-hand sides of the first equation, negated.
            rate: (k, m) right-hand sides of the strings and limits, then of contacts, negated.
        """
        unconstrained = -self._inverse @ self._at.solve_factor_transposed(force.T).T
        right_side = self._C.T @ unconstrained + rate
        y = self._v @ ((self._u.T @ right_side) / self._s[:, None])
        w = unconstrained - self._inverse @ self._B @ y
        return self._at.solve_factor(w.T).T, y


def _scaled(evaluation: Evaluation, rows: Array) -> Array:
    """(n_vD, k) product F^-T rows^T, for rows (k, n_vD); k may be 0."""
    return evaluation.solve_factor_transposed(rows).T if len(rows) else rows.T
