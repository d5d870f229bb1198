"""Equations of motion with held rows and with contacts in their modes, factorised.

    (M + Z^T Z) x + B^T y = -force,   C x = -rate

C are the held rows and B the forces that hold them; they differ where solids slide. Z is the effect
of friction that turns with the velocity.
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
"""Shift of redundant forces, relative to the largest, that tests whether motions depend on them."""
MIN_DEPENDENCE = 1e-6
"""Change of a derivative that counts as dependence, relative to the largest by its quantity."""
ROUNDING = 1e-8
"""Rounding error of the derivatives by one quantity, relative to the largest of all."""

Rows = Callable[[Sequence[HeldPoint]], tuple[ContactRows, Array]]


def solve_in_modes(
    at: Evaluation,
    held: Indices,
    force: Array,
    rate: Array,
    rows: Rows,
    points: Sequence[HeldPoint],
) -> tuple[Array, Array, Array]:
    """Changes of acc_D (n_vD, m), of tensions (len(held), m) and of forces (3 points, m).

    Args:
        at: the model at the state.
        held: indices of the strings and limits that are held.
        force: (n_vD, m) changes of the forces without contact, at fixed acc_D and tensions.
        rate: (len(held), m) changes of the held rows.
        rows: callback: points -> their rows, and changes (k, m) of these at fixed acc_D.
        points: the held points.

    Raises:
        StateError: friction jams, or the motion depends on how redundant points share their force.
    """
    own, change = rows(points)
    system = ModeSystem(at, held, own)
    acc, y = system.solve(force + own.force_by(), np.concatenate([rate, change]))
    if len(system.idle) and any(point.mode is ContactMode.SLIDE for point in points):
        shifted = _with_shifted_forces(points, system.idle[:, len(held) :])
        other, change = rows(shifted)
        again = ModeSystem(at, held, other)
        shifted_acc, _ = again.solve(force + other.force_by(), np.concatenate([rate, change]))
        size = np.max(np.abs(acc), axis=0)
        tolerance = MIN_DEPENDENCE * np.maximum(size, ROUNDING * np.max(size, initial=0.0))
        if np.any(np.max(np.abs(shifted_acc - acc), axis=0) > tolerance):
            raise StateError(
                f"{own.names} slide on more points than the law can share force among, and how a "
                "motion near by turns depends on the shares: it has no derivative"
            )
    n = len(held)
    return acc, y[:n], own.push_by(y[n:], acc)


def _with_shifted_forces(points: Sequence[HeldPoint], idle: Array) -> list[HeldPoint]:
    """The points with other forces of the same effect."""
    size = max(float(np.linalg.norm(point.force)) for point in points)
    shift = FORCE_SHIFT * size * np.sum(idle * np.cos(np.arange(len(idle)))[:, None], axis=0)
    out, first = [], 0
    for point in points:
        k = len(point.directions)
        more = point.pushes.T @ shift[first : first + k]
        out.append(dataclasses.replace(point, force=point.force + more))
        first += k
    return out


class ModeSystem:
    """Factorised equations of motion at one state.

    Args:
        at: the model at the state.
        held: indices of the strings and limits that are held.
        contacts: rows of the held points.

    Raises:
        StateError: friction jams, so that no forces keep the modes.
    """

    def __init__(self, at: Evaluation, held: Indices, contacts: HeldRows):
        rows, forces, drags = contacts.rows, contacts.forces, contacts.drags
        self._at, self._names = at, contacts.names
        W = at.W[:, held]
        self._C = np.concatenate([W, _into(at, rows)], axis=1)
        self._B = np.concatenate([W, _into(at, forces)], axis=1)
        Z = _into(at, drags)
        self._inverse = np.linalg.inv(np.eye(len(W)) + Z @ Z.T)
        u, s, vt = np.linalg.svd(self._C.T @ self._inverse @ self._B)
        significant = s > DEPENDENT_ROWS * np.max(s, initial=0.0)
        own = np.linalg.svd(self._C, compute_uv=False)
        if np.sum(significant) < np.sum(own > np.sqrt(DEPENDENT_ROWS) * np.max(own, initial=0.0)):
            raise StateError(
                f"friction jams at {contacts.names}: no forces keep these modes, so that "
                "derivatives do not exist"
            )
        self._u, self._s, self._v = (
            u[:, : len(s)][:, significant],
            s[significant],
            vt[: len(s)][significant].T,
        )
        self.idle = vt[np.sum(significant) :]
        """Forces (redundant, k) without effect."""

    @property
    def held(self) -> Array:
        """Matrix F^-T C^T (n_vD, k)."""
        return self._C

    def solve(self, force: Array, rate: Array) -> tuple[Array, Array]:
        """Solution x (n_vD, m) and y (k, m), of least norm if it is not unique.

        Redundant rows may contradict one another in states where redundant points do not stay
        closed; x is then the least-squares solution.

        Args:
            force: (n_vD, m) right-hand sides of the first equation, negated.
            rate: (k, m) right-hand sides of rows, then of contacts, negated.
        """
        free = -self._inverse @ self._at.solve_factor_transposed(force.T).T
        right = self._C.T @ free + rate
        y = self._v @ ((self._u.T @ right) / self._s[:, None])
        w = free - self._inverse @ self._B @ y
        return self._at.solve_factor(w.T).T, y


def _into(at: Evaluation, rows: Array) -> Array:
    """Rows (k, n_vD) multiplied by F^-T: (n_vD, k); k may be 0."""
    return at.solve_factor_transposed(rows).T if len(rows) else rows.T
