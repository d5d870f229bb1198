"""The equations of motion with rows and contacts that are held in their modes, factorised.

    (M + Z^T Z) x + B^T y = -force,   C x = -rate

C are the rows that are held and B the forces that hold them; they differ where solids slide. Z is
what friction does because it turns with the velocity.
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

SHIFT = 0.1
"""Force that is shared otherwise, relative to the largest, to see whether motions depend on it."""
DEPENDS = 1e-6
"""Change of a derivative by which it depends on that, relative to the largest by its quantity."""
ROUNDING = 1e-8
"""Derivatives by one quantity that are rounding, relative to the largest of all."""

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
        at: the model.
        held: indices of the strings and limits that are held.
        force: (n_vD, m) changes of the forces without contact, at fixed acc_D and tensions.
        rate: (len(held), m) those of the rows.
        rows: points -> their rows, and (k, m) how these change at fixed acc_D.
        points: those that are held.

    Raises:
        StateError: friction jams, or the motion depends on how redundant points share their force.
    """
    own, change = rows(points)
    system = ModeSystem(at, held, own)
    acc, y = system.solve(force + own.force_by(), np.concatenate([rate, change]))
    if len(system.idle) and any(point.mode is ContactMode.SLIDE for point in points):
        shifted = _shared_otherwise(points, system.idle[:, len(held) :])
        other, change = rows(shifted)
        again = ModeSystem(at, held, other)
        found, _ = again.solve(force + other.force_by(), np.concatenate([rate, change]))
        size = np.max(np.abs(acc), axis=0)
        most = DEPENDS * np.maximum(size, ROUNDING * np.max(size, initial=0.0))
        if np.any(np.max(np.abs(found - acc), axis=0) > most):
            raise StateError(
                f"{own.names} slide on more points than the law can share force among, and how a "
                "motion near by turns depends on the shares: it has no derivative"
            )
    n = len(held)
    return acc, y[:n], own.push_by(y[n:], acc)


def _shared_otherwise(points: Sequence[HeldPoint], idle: Array) -> list[HeldPoint]:
    """The points with other forces that do the same."""
    size = max(float(np.linalg.norm(point.force)) for point in points)
    shift = SHIFT * size * np.sum(idle * np.cos(np.arange(len(idle)))[:, None], axis=0)
    out, first = [], 0
    for point in points:
        k = len(point.directions)
        more = point.pushes.T @ shift[first : first + k]
        out.append(dataclasses.replace(point, force=point.force + more))
        first += k
    return out


class ModeSystem:
    """At one state.

    Args:
        at: the model there.
        held: indices of the strings and limits that are held.
        contacts: the points that are held.

    Raises:
        StateError: friction jams: no forces keep the modes.
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
        kept = s > DEPENDENT_ROWS * np.max(s, initial=0.0)
        own = np.linalg.svd(self._C, compute_uv=False)
        if np.sum(kept) < np.sum(own > np.sqrt(DEPENDENT_ROWS) * np.max(own, initial=0.0)):
            raise StateError(
                f"friction jams at {contacts.names}: no forces keep these modes, so that "
                "derivatives do not exist"
            )
        self._u, self._s, self._v = u[:, : len(s)][:, kept], s[kept], vt[: len(s)][kept].T
        self.idle = vt[np.sum(kept) :]
        """(redundant, k) forces that do nothing."""

    @property
    def held(self) -> Array:
        """(n_vD, k) F^-T C^T."""
        return self._C

    def solve(self, force: Array, rate: Array) -> tuple[Array, Array]:
        """x (n_vD, m) and y (k, m), the shortest where several are solutions.

        Redundant rows may contradict one another in states where redundant points do not stay
        closed; x is then the least-squares solution.

        Args:
            force: (n_vD, m).
            rate: (k, m): of rows, then of contacts.
        """
        free = -self._inverse @ self._at.forth(force.T).T
        right = self._C.T @ free + rate
        y = self._v @ ((self._u.T @ right) / self._s[:, None])
        w = free - self._inverse @ self._B @ y
        return self._at.back(w.T).T, y


def _into(at: Evaluation, rows: Array) -> Array:
    """(n_vD, k) F^-T of rows (k, n_vD), of which there may be none."""
    return at.forth(rows).T if len(rows) else rows.T
