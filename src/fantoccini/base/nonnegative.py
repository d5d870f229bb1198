"""Least squares with unknowns that are not negative."""

from __future__ import annotations

import numpy as np

from fantoccini.base.arrays import Array

TOLERANCE = 1e-14
"""Gradient, and relative change of the sum of squares, at which a solution counts as the least."""
ITERATIONS_PER_UNKNOWN = 10
"""Maximum number of changes of the active set for each unknown."""


def nonnegative_least_squares(A: Array, b: Array) -> tuple[Array, float]:
    """x of min |A x - b| with x >= 0, and that norm.

    By an active set with bounds on variables. SciPy's ``nnls`` may end far from the minimum where
    columns depend on one another, as those of a box's four corners do, and does not report it.

    Args:
        A: (m, n), of rank below n as well.
        b: (m,).

    Returns:
        x (n,) and |A x - b|.
    """
    from scipy.optimize import lsq_linear  # slow to import

    if A.shape[1] == 0:
        return np.zeros(0), float(np.linalg.norm(b))
    max_iterations = ITERATIONS_PER_UNKNOWN * A.shape[1]
    result = lsq_linear(A, b, (0.0, np.inf), method="bvls", tol=TOLERANCE, max_iter=max_iterations)
    x = np.maximum(result.x, 0.0)  # some are -1e-17
    return x, float(np.linalg.norm(A @ x - b))
