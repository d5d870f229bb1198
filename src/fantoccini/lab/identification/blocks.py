"""Least squares over a chain of states that share some parameters.

    min  1/2 sum_s |r_s + J_s dx_s + K_s dtheta|^2 + 1/2 |dx_s+1 - A_s dx_s - B_s dtheta + e_s|^2_W

The normal equations are block tridiagonal in the states, with a border of the parameters: states
are eliminated one by one (the Riccati recursion of a smoother), which leaves a small system.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from fantoccini.base import Array

LARGEST_MOVE = (0.1, 1.0)
"""Of a configuration and of a velocity, in one move of a search [rad or m, and per second]."""


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations of S states of m numbers and P parameters.

    Attributes:
        H: (S, m, m) of every state.
        next: (S - 1, m, m) between a state and the next.
        border: (S, m, P) between states and parameters.
        T: (P, P) of the parameters.
        g, h: (S, m), (P,) the cost's gradient.
    """

    H: Array
    next: Array
    border: Array
    T: Array
    g: Array
    h: Array

    def step(self, damping: Array, shared: float) -> tuple[Array, Array]:
        """(S, m), (P,) the move that reduces the cost, with Levenberg and Marquardt's damping.

        Args:
            damping: (S,) of every state.
            shared: of the parameters.
        """
        reduced = self._reduced(damping)
        T = self.T + shared * np.diag(np.diag(self.T))
        T = T - np.einsum("smp,smq->pq", self.border, reduced[..., 1:])
        h = self.h - np.einsum("smp,sm->p", self.border, reduced[..., 0])
        theta = -linalg.lstsq(T, h)[0] if len(h) else np.zeros(0)
        return -reduced[..., 0] - reduced[..., 1:] @ theta, theta

    def of_states(self) -> Normal:
        """Those of the states alone, with the parameters held."""
        none = np.zeros(0)
        return Normal(self.H, self.next, self.border[..., :0], none[:, None], self.g, none)

    def information(self) -> Array:
        """(P, P) of the parameters: the Fisher information with the states free."""
        reduced = self._reduced(np.zeros(len(self.g)))
        F = self.T - np.einsum("smp,smq->pq", self.border, reduced[..., 1:])
        return np.asarray(0.5 * (F + F.T))

    def _reduced(self, damping: Array) -> Array:
        """(S, m, 1 + P) the states' inverse times gradient and border."""
        S, m = self.g.shape
        scale = np.repeat(1.0 / np.square(LARGEST_MOVE), m // 2)
        right = np.concatenate([self.g[..., None], self.border], axis=2)
        factors: list[Array] = []
        below: list[Array] = []
        for s in range(S):
            D = self.H[s] + damping[s] * np.diag(scale)
            if s:
                share = _solved(factors[-1], self.next[s - 1])
                below.append(share)
                D = D - self.next[s - 1].T @ share
                right[s] -= share.T @ right[s - 1]
            factor, info = linalg.lapack.dpotrf(D, lower=1)
            if info:
                raise np.linalg.LinAlgError(f"the normal equations of segment {s} are singular")
            factors.append(factor)
        for s in range(S)[::-1]:
            right[s] = _solved(factors[s], right[s])
            if s < S - 1:
                right[s] -= below[s] @ right[s + 1]
        return right


def _solved(factor: Array, right: Array) -> Array:
    """Of a Cholesky factor; LAPACK's own, as the matrices are small and many."""
    found: Array = linalg.lapack.dpotrs(factor, right, lower=1)[0]
    return found
