"""Quadratic programs of stages, solved by an interior point method of Riccati recursions.

    min  sum over i of  1/2 [u_i; z_{i+1}]^T H_i [u_i; z_{i+1}] + g_i^T [...] + u_{i-1}^T D_i u_i
    z_{i+1} = A_i z_i + B_i u_i + e_i,   z_0 = 0,   bounds on all variables,
    low <= C_i [u_{i-1}; z_i; u_i; z_{i+1}] + elastic <= high

The compiled method is ``cpp/fantoccini/search/stage_program.hpp``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, riccati
from fantoccini.kernel.runtime import StagePrograms

UNBOUNDED = 1e30
"""A bound that is none."""
_MOST = 60
"""Iterations of the interior point method."""
_GOOD = 1e-5
"""Residuals of a last iterate that is taken where rounding prevents better ones."""


@dataclass(eq=False)
class StageProgram:
    """The numbers of a program with N stages of k inputs, n_z states and m elastic rows.

    Attributes:
        H: (N, k + n_z, k + n_z) symmetric, of (u_i, z_{i+1}).
        g: (N, k + n_z).
        cross: (N, k + n_z, k) of (u_{i-1}, z_i) with u_i; the first is not used but for z_0 = 0.
        A, B, e: of the dynamics.
        low, high: (N, k + n_z) bounds.
        C: (N, m, 2 (k + n_z)) rows of (u_{i-1}, z_i, u_i, z_{i+1}).
        row_low, row_high: (N, m) their bounds.
        elastic: (N, m) price of passing a row: of the first power, and of half the square.
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
        """(N, k, n_z) K_i of u_i = K_i z_i, where no bound is in force.

        Costs between the inputs of neighbouring stages are left out: programs should have none.
        """
        k = self.B.shape[2]
        Q = np.concatenate([0.0 * self.H[:1, k:, k:], self.H[:-1, k:, k:]])
        R, S, end = self.H[:, :k, :k], self.cross[:, k:], self.H[-1, k:, k:]
        return -riccati.gains(self.A, self.B, Q, R, end, S)[0]

    def with_constants(
        self, start: Array, Q: Array, q: Array, low: Array, high: Array, damping: float
    ) -> StageProgram:
        """The same where the last n_c states stay what further inputs of the first stage make them.

        They choose z_0 = start c as well. Those whose bounds leave no room stay 0.

        Args:
            start: (n_z, n_c) derivatives of z_0 by them.
            Q, q: (n_z, n_z) and (n_z,) of the cost of z_0.
            low, high: (n_c,) bounds.
            damping: of the Hessian.
        """
        N, n_z, k = self.B.shape
        n_c = start.shape[1]
        is_open = high > low
        start, of_c = start * is_open, k + np.arange(n_c)
        inner = np.concatenate([np.arange(k), k + n_c + np.arange(n_z)])
        s = k + n_c + n_z
        H, cross = np.zeros((N, s, s)), np.zeros((N, s, k + n_c))
        H[np.ix_(np.arange(N), inner, inner)] = self.H
        H[:, of_c, of_c] = 1.0
        H[0, of_c, of_c] = np.where(is_open, damping, 1.0)
        H[0, k : k + n_c, k : k + n_c] += start.T @ Q @ start
        across = start.T @ self.cross[0, k:]
        H[0, k : k + n_c, :k], H[0, :k, k : k + n_c] = across, across.T
        cross[:, inner, :k] = self.cross
        g, lowest, highest = (np.zeros((N, s)) for _ in range(3))
        g[:, inner], g[0, of_c] = self.g, start.T @ q
        lowest[:], highest[:] = -UNBOUNDED, UNBOUNDED
        lowest[:, inner], highest[:, inner] = self.low, self.high
        # Bounds that say the same in every stage would leave their multipliers open.
        lowest[:, s - n_c :], highest[:, s - n_c :] = -UNBOUNDED, UNBOUNDED
        lowest[0, s - n_c :] = np.where(is_open, low, -UNBOUNDED)
        highest[0, s - n_c :] = np.where(is_open, high, UNBOUNDED)
        B = np.zeros((N, n_z, k + n_c))
        B[..., :k], B[0, :, k:] = self.B, self.A[0] @ start
        C = np.zeros((N, self.C.shape[1], 2 * s))
        C[:, :, np.concatenate([inner, s + inner])] = self.C
        C[0, :, s + of_c] = (self.C[0, :, k : k + n_z] @ start).T
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
        passed: (N, m) how far rows are passed.
        gain: (k, n_z) how the best u_0 changes with z_0, bounds in force being kept to.
        solved: whether it is one.
        iterations: of the interior point method, factorisations each.
        gap: sum of the products of slacks and multipliers, in the unit of the cost: what it may
            cost more than the least.
    """

    u: Array
    z: Array
    costate: Array
    passed: Array
    gain: Array
    solved: bool
    iterations: int
    gap: float


class StageSolver:
    """Solves programs, again and again in the same memory.

    Args:
        tolerance: of the residuals; the mean product of slacks and multipliers may be ten times
            as large.
    """

    def __init__(self, tolerance: float = 1e-8) -> None:
        self.tolerance = tolerance
        self._programs = StagePrograms()

    def solve(
        self, program: StageProgram, unit: float = 1.0, *, barrier: float = 0.0, most: int = _MOST
    ) -> StageSolution:
        """The solution.

        Args:
            program: see :class:`StageProgram`.
            unit: of its cost; the tolerance is relative to it.
            barrier: product of slacks and multipliers, in that unit, at which it may end.
            most: factorisations.
        """
        n_z, k = program.B.shape[1:]
        s = k + n_z
        # Rows of z_{i+1} become those of what it comes from.
        before, after = program.C[..., :s], program.C[..., s : s + k]
        later = program.C[..., s + k :]
        C = np.concatenate([before, after], axis=2)
        shift = np.zeros(program.row_low.shape)
        if np.any(later):
            C[..., k:s] += later @ program.A
            C[..., s:] += later @ program.B
            shift = np.einsum("nmj,nj->nm", later, program.e)
        names = ("H", "g", "cross", "A", "B", "e", "low", "high")
        found = self._programs.solve(
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
            iterations=most,
        )
        near = max(found.primal, found.dual, 0.1 * found.gap) < _GOOD
        finite = bool(np.all(np.isfinite(found.u)) and np.all(np.isfinite(found.z)))
        costate = found.costate + np.einsum("nmj,nm->nj", later, found.force)
        z = np.concatenate([np.zeros((1, n_z)), found.z])
        return StageSolution(
            found.u,
            z,
            costate,
            found.passed,
            found.gain,
            (found.solved or near) and finite,
            found.iterations,
            unit * found.gap * _sides(program),
        )


def _sides(program: StageProgram) -> int:
    """How many slacks a program has: of its bounds, and of its rows with what passes them."""
    lows, highs = (program.low, program.row_low), (program.high, program.row_high)
    return int(
        sum(np.sum(low > -UNBOUNDED) for low in lows)
        + sum(np.sum(high < UNBOUNDED) for high in highs)
        + program.row_low.size
    )
