"""Equations of motion with held rows, factorised.

A row is a string or a joint limit; A_D are the derivatives of held rows by the dynamic coordinates,
and n_vD is the number of these velocities. (KKT: Karush, Kuhn and Tucker.)
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.dynamics.compiled import Evaluation

DEPENDENT_ROWS = 1e-9
"""Singular value of W, relative to the largest, below which rows depend on one another."""


class KKTSystem:
    """KKT matrix [M, A_D^T; A_D, 0] over held rows at one state, factorised.

    Args:
        evaluation: the model at the state.
        rows: indices of the held rows.
    """

    def __init__(self, evaluation: Evaluation, rows: Indices):
        self._at, self._W = evaluation, evaluation.W[:, rows]
        u, s, vt = np.linalg.svd(self._W, full_matrices=False)
        significant = s > DEPENDENT_ROWS * np.max(s, initial=0.0)
        self._u, self._s, self._v = u[:, significant], s[significant], vt[significant].T

    @cached_property
    def _inverse_mass_rows(self) -> Array:
        """Matrix M^-1 A_D^T (n_vD, len(rows))."""
        return self._at.solve_factor(self._W.T).T

    def solve(self, force: Array, rate: Array) -> tuple[Array, Array]:
        """Solution x (n_vD, m), y (len(rows), m) of M x + A_D^T y = -force and A_D x = -rate.

        y has least norm if rows depend on one another.

        Args:
            force: (n_vD, m) right-hand sides of the first equation, negated.
            rate: (len(rows), m) right-hand sides of the second equation, negated.
        """
        w = -self._at.solve_factor_transposed(force.T).T
        projected = self._u.T @ w + (self._v.T @ rate) / self._s[:, None]
        y = self._v @ (projected / self._s[:, None])
        return self._at.solve_factor((w - self._W @ y).T).T, y

    def least_move(self, rate: Array) -> Array:
        """Solution x (n_vD, m) of A_D x = -rate, the smallest in the metric of M.

        Args:
            rate: (len(rows), m) right-hand sides, negated.
        """
        y = self._v @ ((self._v.T @ rate) / (self._s * self._s)[:, None])
        return -(self._inverse_mass_rows @ y)
