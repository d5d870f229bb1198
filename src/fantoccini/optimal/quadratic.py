"""Quadratic programs of stages, solved by PIQP's interior point method for them.

    min  sum over i of  1/2 [u_i; z_{i+1}]^T H_i [u_i; z_{i+1}] + g_i^T [...] + u_{i-1}^T D_i u_i
    z_{i+1} = A_i z_i + B_i u_i + e_i,   z_0 = 0,   bounds on all variables,
    low <= C_i [u_{i-1}; z_i; u_i; z_{i+1}] + elastic <= high

A stage's variables are (u_i, z_{i+1}, elastic parts).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import piqp
from scipy import sparse

from fantoccini.arrays import Array, Indices

UNBOUNDED = 1e30
"""What PIQP takes for no bound."""
_MOST = 40
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

    def with_free_interval(
        self, later: Array, slope: float, low: float, high: float, damping: float
    ) -> StageProgram:
        """The same where all intervals are longer by the last input of the first stage.

        It becomes a last state, which later stages hand on.

        Args:
            later: (N, n_z) derivatives of the ends by the length of the intervals.
            slope: of the cost.
            low, high: bounds of the change [s].
            damping: of the Hessian.
        """
        N, n_z, k = self.B.shape
        s = k + n_z
        inner = np.concatenate([np.arange(k), k + 1 + np.arange(n_z)])
        H, cross = np.zeros((N, s + 2, s + 2)), np.zeros((N, s + 2, k + 1))
        H[np.ix_(np.arange(N), inner, inner)] = self.H
        H[:, k, k], H[:, -1, -1] = 1.0, damping
        H[0, k, k] = damping
        cross[:, inner, :k] = self.cross
        g, lowest, highest = (np.zeros((N, s + 2)) for _ in range(3))
        g[:, inner], g[0, k] = self.g, slope
        lowest[:], highest[:] = -UNBOUNDED, UNBOUNDED
        lowest[:, inner], highest[:, inner] = self.low, self.high
        if high > low:
            lowest[:, -1], highest[:, -1] = low, high
        else:
            H[0, k, k], g[0, k] = 1.0, 0.0
        A, B = np.zeros((N, n_z + 1, n_z + 1)), np.zeros((N, n_z + 1, k + 1))
        A[:, :n_z, :n_z], A[:, :n_z, -1], A[:, -1, -1] = self.A, later, 1.0
        B[:, :n_z, :k] = self.B
        if high > low:
            B[0, :n_z, k], B[0, -1, k] = later[0], 1.0
        of_rows = np.concatenate([inner, s + 2 + inner])
        C = np.zeros((N, self.C.shape[1], 2 * (s + 2)))
        C[:, :, of_rows] = self.C
        return StageProgram(
            H, g, cross, A, B, np.pad(self.e, ((0, 0), (0, 1))), lowest, highest, C, self.row_low,
            self.row_high, self.elastic,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class StageSolution:
    """The solution of a program.

    Attributes:
        u: (N, k) changes of the inputs.
        z: (N + 1, n_z) changes of the states.
        costate: (N, n_z) multipliers of the dynamics.
        passed: (N, m) how far rows are passed.
        solved: whether it is one.
        feasible: False where the program has none.
        iterations: of the interior point method.
    """

    u: Array
    z: Array
    costate: Array
    passed: Array
    solved: bool
    feasible: bool
    iterations: int


class StageSolver:
    """Solves programs of one shape again and again.

    Args:
        tolerance: of the residuals; the gap of duality may be ten times as large.
    """

    def __init__(self, tolerance: float = 1e-6) -> None:
        self._tolerance = tolerance
        self._solver: piqp.SparseSolver | None = None
        self._shape: tuple[int, ...] = ()

    def solve(self, program: StageProgram) -> StageSolution:
        """The solution."""
        N, s = program.g.shape
        k, m = program.B.shape[2], program.C.shape[1]
        n_z, width = s - k, s + m
        shape = (N, k, n_z, m)
        P, c = self._hessian(program, width), np.zeros((N, width))
        c[:, :s], c[:, s:] = program.g, program.elastic
        A, b = self._dynamics(program, width)
        low, high = np.zeros((N, width)), np.full((N, width), UNBOUNDED)
        low[:, :s], high[:, :s] = program.low, program.high
        G, upper = self._rows(program, width) if m else (None, None)
        solver = self._solver
        arguments = (P, c.ravel(), A, b, G, None, upper, low.ravel(), high.ravel())
        if solver is None or shape != self._shape:
            solver = self._solver = piqp.SparseSolver()
            self._shape = shape
            solver.settings.kkt_solver = piqp.sparse_multistage
            settings, tolerance = solver.settings, self._tolerance
            settings.eps_abs = settings.eps_rel = tolerance
            settings.eps_duality_gap_abs = settings.eps_duality_gap_rel = 10.0 * tolerance
            settings.max_iter = _MOST
            solver.setup(*arguments)
        else:
            solver.update(*arguments)
        status = solver.solve()
        x = np.array(solver.result.x).reshape(N, width)
        y = np.array(solver.result.y)
        z = np.concatenate([np.zeros((1, n_z)), x[:, k:s]])
        info = solver.result.info
        near = info.primal_res_rel < _GOOD and info.dual_res_rel < _GOOD
        ended = status == piqp.PIQP_SOLVED or (status == piqp.PIQP_MAX_ITER_REACHED and near)
        return StageSolution(
            x[:, :k], z, y.reshape(N, n_z), x[:, s:],
            ended and bool(np.all(np.isfinite(x))), status != piqp.PIQP_PRIMAL_INFEASIBLE,
            int(info.iter),
        )  # fmt: skip

    def _hessian(self, program: StageProgram, width: int) -> sparse.csc_matrix:
        N, s = program.g.shape
        k = program.B.shape[2]
        m = width - s
        first = width * np.arange(N)
        i, j = np.triu_indices(s)
        rows = [(first[:, None] + i).ravel()]
        columns = [(first[:, None] + j).ravel()]
        values = [program.H[:, i, j].ravel()]
        i, j = (x.ravel() for x in np.mgrid[:s, :k])
        rows.append((first[:-1, None] + i).ravel())
        columns.append((first[1:, None] + j).ravel())
        values.append(program.cross[1:, i, j].ravel())
        if m:
            i = s + np.arange(m)
            rows.append((first[:, None] + i).ravel())
            columns.append(rows[-1])
            values.append(program.elastic.ravel())
        return _csc(values, rows, columns, (N * width, N * width))

    def _dynamics(self, program: StageProgram, width: int) -> tuple[sparse.csc_matrix, Array]:
        N, n_z, k = program.B.shape
        at, first = n_z * np.arange(N), width * np.arange(N)
        i, j = (x.ravel() for x in np.mgrid[:n_z, :k])
        rows, columns = [(at[:, None] + i).ravel()], [(first[:, None] + j).ravel()]
        values = [program.B[:, i, j].ravel()]
        one = np.arange(n_z)
        rows.append((at[:, None] + one).ravel())
        columns.append((first[:, None] + k + one).ravel())
        values.append(np.full(N * n_z, -1.0))
        i, j = (x.ravel() for x in np.mgrid[:n_z, :n_z])
        rows.append((at[1:, None] + i).ravel())
        columns.append((first[:-1, None] + k + j).ravel())
        values.append(program.A[1:, i, j].ravel())
        b = -program.e.ravel()
        return _csc(values, rows, columns, (N * n_z, N * width)), b

    def _rows(self, program: StageProgram, width: int) -> tuple[sparse.csc_matrix, Array]:
        """Rows twice: below the upper bound and above the lower one, less the elastic part."""
        N = len(program.C)
        n_z, k = program.B.shape[1:]
        s = n_z + k
        sides = [(1.0, program.row_high), (-1.0, -program.row_low)]
        kept = [np.flatnonzero(np.all(bound < UNBOUNDED, axis=0)) for _, bound in sides]
        per_stage = sum(map(len, kept))
        at, first, done = per_stage * np.arange(N), width * np.arange(N), 0
        rows: list[Indices] = []
        columns: list[Indices] = []
        values: list[Array] = []
        upper = np.zeros((N, per_stage))
        for (sign, bound), which in zip(sides, kept, strict=True):
            own = done + np.arange(len(which))
            upper[:, own] = bound[:, which]
            i, j = (x.ravel() for x in np.mgrid[: len(which), :s])
            rows.append((at[:, None] + own[i]).ravel())
            columns.append((first[:, None] + j).ravel())
            values.append((sign * program.C[:, which[i], s + j]).ravel())
            rows.append((at[1:, None] + own[i]).ravel())
            columns.append((first[:-1, None] + j).ravel())
            values.append((sign * program.C[1:, which[i], j]).ravel())
            rows.append((at[:, None] + own).ravel())
            columns.append((first[:, None] + s + which).ravel())
            values.append(np.full(N * len(which), -1.0))
            done += len(which)
        G = _csc(values, rows, columns, (per_stage * N, N * width))
        return G, upper.ravel()


def _csc(
    values: Sequence[Array],
    rows: Sequence[Indices],
    columns: Sequence[Indices],
    shape: tuple[int, int],
) -> sparse.csc_matrix:
    """With the zeros that are among the values, so that the pattern stays."""
    at = (np.concatenate(rows), np.concatenate(columns))
    return sparse.csc_matrix((np.concatenate(values), at), shape=shape)
