"""Quadratic programs of stages, solved by an interior point method with Riccati recursions.

    min  sum over i of  1/2 [u_i; z_{i+1}]^T H_i [u_i; z_{i+1}] + g_i^T [...] + u_{i-1}^T D_i u_i
    z_{i+1} = A_i z_i + B_i u_i + e_i,   z_0 = 0,   bounds on all variables,
    low <= C_i [u_{i-1}; z_i; u_i; z_{i+1}] + elastic <= high

The compiled method is ``cpp/fantoccini/search/stage_program.hpp``.

u_i are the inputs of stage i and z_{i+1} the state at its end. A row is a line of C_i with its two
bounds; it is elastic, that is, it may be violated at a price. The gap of the solver is its duality
gap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, riccati
from fantoccini.kernel.runtime import StagePrograms

UNBOUNDED = 1e30
"""Value for a missing bound."""
_MAX_ITERATIONS = 60
"""Largest number of iterations of the interior point method."""
_MAX_RESIDUAL = 1e-5
"""Largest residuals of an accepted last iterate, if rounding prevents smaller ones."""


@dataclass(eq=False)
class StageProgram:
    """Matrices and bounds of a program with N stages of k inputs, n_z states and m elastic rows.

    Attributes:
        H: (N, k + n_z, k + n_z) symmetric Hessian for (u_i, z_{i+1}).
        g: (N, k + n_z) gradient.
        cross: (N, k + n_z, k) D_i, products of (u_{i-1}, z_i) with u_i; in the first stage only
            those with z_0, if z_0 is free.
        A, B, e: matrices and offsets of the dynamics.
        low, high: (N, k + n_z) bounds.
        C: (N, m, 2 (k + n_z)) rows for (u_{i-1}, z_i, u_i, z_{i+1}).
        row_low, row_high: (N, m) bounds of the rows.
        elastic: (N, m) price p of a violation v, with the cost p (v + v^2 / 2).
    """

    H: Array
    g: Array
    cross: Array
    A: Array
    B: Array
    e: Array
    low: Array
    high: Array
    C: Array
    row_low: Array
    row_high: Array
    elastic: Array

    @property
    def gains(self) -> Array:
        """(N, k, n_z) gains K_i of u_i = K_i z_i, without active bounds.

        Programs must have no costs between the inputs of neighbouring stages; they are ignored.
        """
        k = self.B.shape[2]
        Q = np.concatenate([0.0 * self.H[:1, k:, k:], self.H[:-1, k:, k:]])
        R, S, end = self.H[:, :k, :k], self.cross[:, k:], self.H[-1, k:, k:]
        return -riccati.gains(self.A, self.B, Q, R, end, S)[0]

    def with_constants(
        self, start: Array, Q: Array, q: Array, low: Array, high: Array, damping: float
    ) -> StageProgram:
        """The same program with n_c constants as last states, set by inputs of the first stage.

        The constants also set z_0 = start c. Those whose bounds coincide stay 0.

        Args:
            start: (n_z, n_c) derivatives of z_0 with respect to the constants.
            Q, q: (n_z, n_z) and (n_z,) terms of the cost of z_0.
            low, high: (n_c,) bounds of the constants.
            damping: damping of the Hessian.
        """
        N, n_z, k = self.B.shape
        n_c = start.shape[1]
        is_open = high > low
        start, constants = start * is_open, k + np.arange(n_c)
        kept_columns = np.concatenate([np.arange(k), k + n_c + np.arange(n_z)])
        s = k + n_c + n_z
        H, cross = np.zeros((N, s, s)), np.zeros((N, s, k + n_c))
        H[np.ix_(np.arange(N), kept_columns, kept_columns)] = self.H
        H[:, constants, constants] = 1.0
        H[0, constants, constants] = np.where(is_open, damping, 1.0)
        H[0, k : k + n_c, k : k + n_c] += start.T @ Q @ start
        coupling = start.T @ self.cross[0, k:]
        H[0, k : k + n_c, :k], H[0, :k, k : k + n_c] = coupling, coupling.T
        cross[:, kept_columns, :k] = self.cross
        g, lowest, highest = (np.zeros((N, s)) for _ in range(3))
        g[:, kept_columns], g[0, constants] = self.g, start.T @ q
        lowest[:], highest[:] = -UNBOUNDED, UNBOUNDED
        lowest[:, kept_columns], highest[:, kept_columns] = self.low, self.high
        # The same bounds in every stage would not determine their multipliers.
        lowest[:, s - n_c :], highest[:, s - n_c :] = -UNBOUNDED, UNBOUNDED
        lowest[0, s - n_c :] = np.where(is_open, low, -UNBOUNDED)
        highest[0, s - n_c :] = np.where(is_open, high, UNBOUNDED)
        B = np.zeros((N, n_z, k + n_c))
        B[..., :k], B[0, :, k:] = self.B, self.A[0] @ start
        C = np.zeros((N, self.C.shape[1], 2 * s))
        C[:, :, np.concatenate([kept_columns, s + kept_columns])] = self.C
        C[0, :, s + constants] = (self.C[0, :, k : k + n_z] @ start).T
        return StageProgram(
            H,
            g,
            cross,
            self.A,
            B,
            self.e,
            lowest,
            highest,
            C,
            self.row_low,
            self.row_high,
            self.elastic,
        )


@dataclass(frozen=True, eq=False)
class StageSolution:
    """The solution of a program.

    Attributes:
        u: (N, k) changes of the inputs.
        z: (N + 1, n_z) changes of the states.
        costate: (N, n_z) multipliers of the dynamics.
        violation: (N, m) violations of the rows.
        gain: (k, n_z) derivative of the best u_0 with respect to z_0, with the active bounds kept.
        solved: whether it is accurate enough.
        iterations: iterations of the interior point method, with one factorisation each.
        gap: duality gap, the sum of the products of slacks and multipliers, in the unit of the
            cost.
    """

    u: Array
    z: Array
    costate: Array
    violation: Array
    gain: Array
    solved: bool
    iterations: int
    gap: float


class StageSolver:
    """A solver of programs, one after another in the same memory.

    Args:
        tolerance: tolerance of the residuals; the mean product of slacks and multipliers may be ten
            times as large.
    """

    def __init__(self, tolerance: float = 1e-8) -> None:
        self.tolerance = tolerance
        self._programs = StagePrograms()

    def solve(
        self,
        program: StageProgram,
        unit: float = 1.0,
        *,
        barrier: float = 0.0,
        max_iterations: int = _MAX_ITERATIONS,
    ) -> StageSolution:
        """The solution of a program.

        Args:
            program: see :class:`StageProgram`.
            unit: unit of its cost; the tolerance is relative to it.
            barrier: mean product of slacks and multipliers at which it may end, in that unit.
            max_iterations: largest number of factorisations.
        """
        n_z, k = program.B.shape[1:]
        s = k + n_z
        # Rows of z_{i+1} become rows of (u_{i-1}, z_i, u_i) by the dynamics.
        previous, current = program.C[..., :s], program.C[..., s : s + k]
        following = program.C[..., s + k :]
        C = np.concatenate([previous, current], axis=2)
        shift = np.zeros(program.row_low.shape)
        if np.any(following):
            C[..., k:s] += following @ program.A
            C[..., s:] += following @ program.B
            shift = np.einsum("nmj,nj->nm", following, program.e)
        names = ("H", "g", "cross", "A", "B", "e", "low", "high")
        result = self._programs.solve(
            {name: getattr(program, name) for name in names}
            | {
                "C": C,
                "row_low": program.row_low - shift,
                "row_high": program.row_high - shift,
                "price": program.elastic,
            },
            unit=unit,
            unbounded=UNBOUNDED,
            tolerance=self.tolerance,
            barrier=barrier,
            iterations=max_iterations,
        )
        is_close = max(result.primal, result.dual, 0.1 * result.gap) < _MAX_RESIDUAL
        is_finite = bool(np.all(np.isfinite(result.u)) and np.all(np.isfinite(result.z)))
        costate = result.costate + np.einsum("nmj,nm->nj", following, result.force)
        z = np.concatenate([np.zeros((1, n_z)), result.z])
        return StageSolution(
            result.u,
            z,
            costate,
            result.passed,
            result.gain,
            (result.solved or is_close) and is_finite,
            result.iterations,
            unit * result.gap * _n_slacks(program),
        )


def _n_slacks(program: StageProgram) -> int:
    """Number of slacks of a program: of its bounds, rows and violations."""
    lower_bounds, upper_bounds = (program.low, program.row_low), (program.high, program.row_high)
    return int(
        sum(np.sum(low > -UNBOUNDED) for low in lower_bounds)
        + sum(np.sum(high < UNBOUNDED) for high in upper_bounds)
        + program.row_low.size
    )
