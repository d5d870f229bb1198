"""Feedback gains along a motion, from the program of its last step, by Riccati's recursion.

K_i = -(R + B^T P B)^-1 (S^T + B^T P A),   P <- Q + A^T P A + (S + A^T P B) K
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array
from fantoccini.control.optimal.quadratic import StageProgram


def riccati_gains(program: StageProgram) -> Array:
    """(N, k, n_z) K_i of u_i = K_i z_i, where no bound is in force.

    Costs between the inputs of neighbouring stages are left out: programs should have none.
    """
    N, n_z, k = program.B.shape
    gains = np.zeros((N, k, n_z))
    P = program.H[-1, k:, k:]
    for i in reversed(range(N)):
        A, B, S = program.A[i], program.B[i], program.cross[i, k:]
        PB = P @ B
        R = program.H[i, :k, :k] + B.T @ PB
        gains[i] = -np.linalg.solve(R, S.T + PB.T @ A)
        Q = program.H[i - 1, k:, k:] if i else 0.0
        P = Q + A.T @ P @ A + (S + A.T @ PB) @ gains[i]
        P = 0.5 * (P + P.T)
    return gains
