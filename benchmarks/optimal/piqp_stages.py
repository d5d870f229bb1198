"""The same programs of stages for PIQP's multistage interface (https://github.com/PREDICT-EPFL/piqp)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import piqp
from scipy import sparse

from fantoccini.base.arrays import Array, Indices
from fantoccini.control.optimal.quadratic import UNBOUNDED, StageProgram

_MAX_ITERATIONS = 40
"""Largest number of iterations of the interior point method."""


class PiqpSolver:
    """Solves many programs of one shape.

    Args:
        tolerance: tolerance of the residuals; the duality gap may be ten times as large.
    """

    def __init__(self, tolerance: float = 1e-8) -> None:
        self._tolerance = tolerance
        self._solver: piqp.SparseSolver | None = None
        self._shape: tuple[int, ...] = ()

    def solve(self, program: StageProgram, unit: float = 1.0) -> tuple[Array, int, bool]:
        """The inputs, the number of iterations, and whether the program is solved.

        Args:
            program: see :class:`StageProgram`.
            unit: unit of its cost; the tolerance is relative to it.
        """
        N, s = program.g.shape
        k, m = program.B.shape[2], program.C.shape[1]
        n_z, width = s - k, s + m
        shape = (N, k, n_z, m)
        P, c = self._hessian(program, width) / unit, np.zeros((N, width))
        c[:, :s], c[:, s:] = program.g / unit, program.elastic / unit
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
            settings.max_iter = _MAX_ITERATIONS
            solver.setup(*arguments)
        else:
            solver.update(*arguments)
        status = solver.solve()
        x = np.array(solver.result.x).reshape(N, width)
        return x[:, :k], int(solver.result.info.iter), status == piqp.PIQP_SOLVED

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
        offsets = np.arange(n_z)
        rows.append((at[:, None] + offsets).ravel())
        columns.append((first[:, None] + k + offsets).ravel())
        values.append(np.full(N * n_z, -1.0))
        i, j = (x.ravel() for x in np.mgrid[:n_z, :n_z])
        rows.append((at[1:, None] + i).ravel())
        columns.append((first[:-1, None] + k + j).ravel())
        values.append(program.A[1:, i, j].ravel())
        b = -program.e.ravel()
        return _csc(values, rows, columns, (N * n_z, N * width)), b

    def _rows(self, program: StageProgram, width: int) -> tuple[sparse.csc_matrix, Array]:
        """Rows twice, for the upper and the lower bounds, with their elastic parts."""
        N = len(program.C)
        n_z, k = program.B.shape[1:]
        s = n_z + k
        sides = [(1.0, program.row_high), (-1.0, -program.row_low)]
        finite = [np.flatnonzero(np.all(bound < UNBOUNDED, axis=0)) for _, bound in sides]
        per_stage = sum(map(len, finite))
        at, first, done = per_stage * np.arange(N), width * np.arange(N), 0
        rows: list[Indices] = []
        columns: list[Indices] = []
        values: list[Array] = []
        upper = np.zeros((N, per_stage))
        for (sign, bound), which in zip(sides, finite, strict=True):
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
    """A sparse matrix with explicit zeros, so that the pattern is constant."""
    at = (np.concatenate(rows), np.concatenate(columns))
    return sparse.csc_matrix((np.concatenate(values), at), shape=shape)
