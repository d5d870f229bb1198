"""The same programs of stages for solvers in CasADi (https://web.casadi.org)."""

from __future__ import annotations

import time
from typing import Any

import casadi
import numpy as np
from scipy import sparse

from fantoccini.base.arrays import Array
from fantoccini.control.optimal.quadratic import UNBOUNDED, StageProgram

OSQP = {"eps_abs": 1e-8, "eps_rel": 1e-8, "max_iter": 20000, "verbose": False}
"""Options; the tolerance is relative to the unit of the cost."""


class CasadiSolver:
    """Solves programs of one shape without rows, in the form of optimal control solvers.

    States include the previous inputs, which costs of jerks couple with the next ones.

    Args:
        name: ``hpipm`` or ``osqp``.
        program: a program of that shape.
        iterations: number for HPIPM, which makes all of them if rounding prevents its
            tolerances.
    """

    def __init__(self, name: str, program: StageProgram, iterations: int = 60):
        N, n_z, k = program.B.shape
        assert program.C.shape[1] == 0
        self._x, self._u, self._n = n_z + k, k, N
        P, _, A, *_ = self._made(program, 1.0)
        self._P, self._A = (casadi.Sparsity(*_pattern(a)) for a in (P, A))
        options: dict[str, Any] = {"osqp": OSQP}
        if name == "hpipm":
            options = {
                "hpipm": {"iter_max": iterations},
                "N": N,
                "nx": [0] + [self._x] * N,
                "nu": [k] * N + [0],
                "ng": [0] * (N + 1),
            }
        options |= {"print_time": False, "error_on_fail": False}
        self._solver = casadi.conic("s", name, {"h": self._P, "a": self._A}, options)

    def solve(self, program: StageProgram, unit: float = 1.0) -> tuple[Array, float]:
        """The inputs, and the solver's time [ms].

        Args:
            program: see :class:`StageProgram`.
            unit: unit of its cost.
        """
        P, c, A, b, low, high = self._made(program, unit)
        h = casadi.DM(self._P, P.data)
        a = casadi.DM(self._A, A.data)
        began = time.perf_counter()
        solution = self._solver(h=h, g=c, a=a, lba=b, uba=b, lbx=low, ubx=high)
        seconds = time.perf_counter() - began
        x = np.array(solution["x"]).ravel()
        x = np.concatenate([np.zeros(self._x), x[: self._n * (self._x + self._u) - self._x]])
        u = x.reshape(self._n, -1)[:, self._x :]
        return u, 1e3 * seconds

    def _made(self, program: StageProgram, unit: float) -> tuple[Any, ...]:
        """P, c, A, b, low, high of u_0, x_1, u_1, ... x_N with x = (z, previous u); x_0 = 0."""
        N, n_z, k = program.B.shape
        n_x, width = self._x, self._x + k
        of_x, of_u = np.arange(n_x), n_x + np.arange(k)
        size = N * width + n_x
        P = [np.zeros((width, width)) for _ in range(N)] + [np.zeros((n_x, n_x))]
        c, low, high = np.zeros(size), np.full(size, -np.inf), np.full(size, np.inf)
        blocks: list[list[Any]] = []
        for i in range(N):
            at = width * i
            P[i][np.ix_(of_u, of_u)] += program.H[i, :k, :k]
            P[i + 1][:n_z, :n_z] += program.H[i, k:, k:]
            # (u_{i-1}, z_i) with u_i; u_i with z_{i+1}, which has u_i as the input before.
            mixed = program.cross[i]
            before = np.concatenate([mixed[k:], mixed[:k]])
            P[i][np.ix_(of_x, of_u)] += before
            P[i][np.ix_(of_u, of_x)] += before.T
            P[i + 1][:n_z, n_z:n_x] += program.H[i, k:, :k]
            P[i + 1][n_z:n_x, :n_z] += program.H[i, :k, k:]
            c[at + of_u] += program.g[i, :k]
            c[at + width : at + width + n_z] += program.g[i, k:]
            low[at + of_u], high[at + of_u] = program.low[i, :k], program.high[i, :k]
            next_z = slice(at + width, at + width + n_z)
            low[next_z], high[next_z] = program.low[i, k:], program.high[i, k:]
            step = np.zeros((n_x, width + n_x))
            step[:n_z, :n_z], step[:n_z, n_x:width] = program.A[i], program.B[i]
            step[n_z:, n_x:width] = np.eye(k)
            step[:, width:] = -np.eye(n_x)
            blocks.append([at, step])
        rows, columns, values = [], [], []
        for i, (at, step) in enumerate(blocks):
            keep = np.ones(step.shape, dtype=bool)
            keep[:, width:] = np.eye(n_x, dtype=bool)
            r, q = np.nonzero(keep)
            rows.append(n_x * i + r)
            columns.append(at + q)
            values.append(step[r, q])
        A = _csc(rows, columns, values, (n_x * N, size))
        rows, columns, values = [], [], []
        for i, block in enumerate(P):
            r, q = (x.ravel() for x in np.indices(block.shape))
            rows.append(width * i + r)
            columns.append(width * i + q)
            values.append(block.ravel())
        H = _csc(rows, columns, values, (size, size))
        H.data /= unit
        b = -np.concatenate([program.e, np.zeros((N, k))], axis=1).ravel()
        low = np.where(low <= -UNBOUNDED, -np.inf, low)[n_x:]
        high = np.where(high >= UNBOUNDED, np.inf, high)[n_x:]
        return H[n_x:, n_x:], c[n_x:] / unit, A[:, n_x:], b, low, high


def _csc(
    rows: list[Array], columns: list[Array], values: list[Array], shape: tuple[int, int]
) -> Any:
    """A sparse matrix that keeps its zeros, so that all programs of one shape have one pattern."""
    i, j, a = (np.concatenate(x) for x in (rows, columns, values))
    order = np.lexsort((i, j))
    ends = np.searchsorted(j[order], np.arange(shape[1] + 1))
    return sparse.csc_matrix((a[order], i[order], ends), shape=shape)


def _pattern(a: Any) -> tuple[int, int, list[int], list[int]]:
    return (*a.shape, a.indptr.tolist(), a.indices.tolist())
