"""Least squares over a chain of states that share some parameters.

    min  1/2 sum_s |r_s + J_s dx_s + K_s dtheta|^2 + 1/2 |dx_s+1 - A_s dx_s - B_s dtheta + e_s|^2_W

The normal equations are block tridiagonal in the states, with a border for the parameters. States
are eliminated one by one (the Riccati recursion of a smoother), which leaves a small system.

dx_s is the change of the first state of segment s, a piece of the record that is simulated on its
own, and dtheta that of the unknown parameters; r_s are the residuals of its samples and e_s the
jump to the next segment.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from fantoccini.base import Array

MAX_MOVE = (0.1, 1.0)
"""Largest change of a configuration and of a velocity in one step of a search [rad or m, and per
second]."""


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Normal equations for S states of m numbers each and P parameters.

    Attributes:
        H: (S, m, m) blocks of the states.
        coupling: (S - 1, m, m) blocks between a state and the next.
        border: (S, m, P) blocks between states and parameters.
        T: (P, P) block of the parameters.
        g, h: (S, m), (P,) gradient of the cost.
    """

    H: Array
    coupling: Array
    border: Array
    T: Array
    g: Array
    h: Array

    def step(self, damping: Array, parameter_damping: float) -> tuple[Array, Array]:
        """(S, m), (P,) the step of Levenberg and Marquardt.

        Args:
            damping: (S,) damping of the states.
            parameter_damping: damping of the parameters.
        """
        reduced = self._reduced(damping)
        T = self.T + parameter_damping * np.diag(np.diag(self.T))
        T = T - np.einsum("smp,smq->pq", self.border, reduced[..., 1:])
        h = self.h - np.einsum("smp,sm->p", self.border, reduced[..., 0])
        theta = -linalg.lstsq(T, h)[0] if len(h) else np.zeros(0)
        return -reduced[..., 0] - reduced[..., 1:] @ theta, theta

    def without_parameters(self) -> NormalEquations:
        """The normal equations of the states alone, with fixed parameters."""
        empty = np.zeros(0)
        return NormalEquations(
            self.H, self.coupling, self.border[..., :0], empty[:, None], self.g, empty
        )

    def information(self) -> Array:
        """(P, P) Fisher information of the parameters, with the states unknown."""
        reduced = self._reduced(np.zeros(len(self.g)))
        F = self.T - np.einsum("smp,smq->pq", self.border, reduced[..., 1:])
        return np.asarray(0.5 * (F + F.T))

    def _reduced(self, damping: Array) -> Array:
        """(S, m, 1 + P) the states' inverse block matrix times gradient and border."""
        S, m = self.g.shape
        damping_weights = np.repeat(1.0 / np.square(MAX_MOVE), m // 2)
        rhs = np.concatenate([self.g[..., None], self.border], axis=2)
        factors: list[Array] = []
        couplings: list[Array] = []
        for s in range(S):
            D = self.H[s] + damping[s] * np.diag(damping_weights)
            if s:
                coupling = _solve_cholesky(factors[-1], self.coupling[s - 1])
                couplings.append(coupling)
                D = D - self.coupling[s - 1].T @ coupling
                rhs[s] -= coupling.T @ rhs[s - 1]
            factor, info = linalg.lapack.dpotrf(D, lower=1)
            if info:
                raise np.linalg.LinAlgError(f"the normal equations of segment {s} are singular")
            factors.append(factor)
        for s in range(S)[::-1]:
            rhs[s] = _solve_cholesky(factors[s], rhs[s])
            if s < S - 1:
                rhs[s] -= couplings[s] @ rhs[s + 1]
        return rhs


def _solve_cholesky(factor: Array, rhs: Array) -> Array:
    """Solution from a Cholesky factor; calls LAPACK, as the matrices are small and many."""
    solution: Array = linalg.lapack.dpotrs(factor, rhs, lower=1)[0]
    return solution
