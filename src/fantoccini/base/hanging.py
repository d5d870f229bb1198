"""Catenaries: curves of threads that hang between two points.

    x(s) = a asinh(s / a),   z(s) = sqrt(a^2 + s^2) - a,   a = w / (2 u),   sinh(u) / u = r

with s the arc length from the lowest point, w the ends' horizontal distance, v their difference in
height, L the length and r = sqrt(L^2 - v^2) / w. The form in arc length does not overflow, and
becomes a vertical fold when the ends coincide.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fantoccini.base.arrays import Array, Vec3

_MIN_RELATIVE_WIDTH = 1e-9
"""Smallest width per length [1]: the legs of a narrower fold look like one line."""
_MAX_NEWTON_STEPS = 60
_RELATIVE_TOLERANCE = 1e-9
"""Last Newton step, relative to u; the remaining error, its square, is below rounding."""


def catenary(between: Vec3, length: ArrayLike) -> tuple[Array, Array, Array]:
    """The curve of a thread: a, and the arc lengths s of both ends.

    Args:
        between: (..., 3) vector from the first end to the last [m].
        length: (...) length of the thread, greater than the distance of the ends [m].

    Returns:
        Three arrays (...) [m].
    """
    L = np.asarray(length, dtype=float)
    horizontal = np.hypot(between[..., 0], between[..., 1])
    width, span = (
        np.maximum(horizontal, _MIN_RELATIVE_WIDTH * L),
        np.sqrt(np.sum(between * between, axis=-1)),
    )
    u = _half_angle(0.5 * np.log1p((L - span) * (L + span) / (width * width)))
    middle = between[..., 2] / np.tanh(u)
    return width / (2.0 * u), 0.5 * (middle - L), 0.5 * (middle + L)


def _half_angle(log_r: Array) -> Array:
    """Solves ln(sinh(u) / u) = ln r by Newton's method.

    The left side is convex and increasing: after the first step all iterates lie right of the root.
    """
    # The first estimate is close for tight threads, the second for folds.
    u = np.maximum(np.sqrt(6.0 * log_r), log_r + np.log1p(log_r) + 1.0)
    for _ in range(_MAX_NEWTON_STEPS):
        value, slope = _log_sinhc(u)
        step = (value - log_r) / slope
        u = u - step
        if np.all(np.abs(step) <= _RELATIVE_TOLERANCE * u):
            break
    return np.asarray(u)


def _log_sinhc(u: Array) -> tuple[Array, Array]:
    """ln(sinh(u) / u), and its slope; power series for small u."""
    is_small, uu = u < 0.05, u * u
    return (
        np.where(
            is_small,
            uu * (1.0 / 6.0 - uu * (1.0 / 180.0 - uu / 2835.0)),
            u + np.log1p(-np.exp(-2.0 * u)) - np.log(2.0 * u),
        ),
        np.where(
            is_small,
            u * (1.0 / 3.0 - uu * (1.0 / 45.0 - 2.0 * uu / 945.0)),
            1.0 / np.tanh(u) - 1.0 / u,
        ),
    )
