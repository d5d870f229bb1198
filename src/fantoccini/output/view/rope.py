"""The curve of a slack string: a catenary of the string's own length.

A massless string has no shape when slack; pictures give it that of a thread of the same length. The
form in arc length ``s`` from the lowest point does not overflow, and becomes a vertical fold when
the ends coincide:

    x(s) = a asinh(s / a),   z(s) = sqrt(a^2 + s^2) - a,   a = w / (2 u),   sinh(u) / u = r

with ``w`` the horizontal distance of the ends, ``v`` their difference in height, ``L`` the length
and ``r = sqrt(L^2 - v^2) / w``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class _Tolerances(NamedTuple):
    """Relative lengths below which a case is degenerate, and Newton's accuracy."""

    straight: float = 1e-9
    """Surplus length per span below which the string is straight: the sag is invisible."""
    vertical: float = 1e-12  # Width per length below which the curve's direction is arbitrary
    fold: float = 1e-9
    """Width per length that two legs of a fold keep: closer ones look like one line."""
    newton: float = 1e-15  # Last step per u: rounding
    max_steps: int = 60


_TOLERANCES = _Tolerances()


def hanging(start: np.ndarray, end: np.ndarray, length: float, n: int = 48) -> np.ndarray:
    """Points along a thread that hangs between two points.

    Args:
        start, end: (3,) ends [m].
        length: of the thread [m]; up to the span's it gives a straight line.
        n: number of points, at least 2; a third of them lie about the lowest point.

    Returns:
        (n, 3) points [m]; the first and last are the ends.
    """
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    along = end - start
    span = float(np.linalg.norm(along))
    steps = np.linspace(0.0, 1.0, n)
    if not length > span * (1.0 + _TOLERANCES.straight) or not np.isfinite(length):
        return start + steps[:, None] * along
    height = float(along[2])
    width = float(np.hypot(along[0], along[1]))
    ahead = along[:2] / width if width > _TOLERANCES.vertical * length else np.array([1.0, 0.0])

    wide = max(width, _TOLERANCES.fold * length)
    u = _half_angle(wide, length, span)
    a = wide / (2.0 * u)
    middle = height / np.tanh(u)
    s = _samples(0.5 * (middle - length), 0.5 * (middle + length), a, n)

    x = a * (np.arcsinh(s / a) - np.arcsinh(s[0] / a))
    root = np.sqrt(a * a + s * s)
    z = (s - s[0]) * (s + s[0]) / (root + root[0])
    points = np.column_stack([start[0] + ahead[0] * x, start[1] + ahead[1] * x, start[2] + z])
    points[-1] = end
    return points


def path(points: np.ndarray, length: float, n: int = 48) -> np.ndarray:
    """Points along a slack string that runs through several points.

    Its surplus length is shared among the segments in proportion to their spans.

    Args:
        points: (k, 3) points of the string [m].
        length: of the whole string [m].
        n: number of points on each segment.

    Returns:
        (m, 3) points [m].
    """
    points = np.asarray(points, dtype=float)
    spans = np.linalg.norm(np.diff(points, axis=0), axis=1)
    total = float(spans.sum())
    share = spans / total if total > 0.0 else np.full(len(spans), 1.0 / len(spans))
    parts = [
        hanging(a, b, length * f, n)[0 if k == 0 else 1 :]
        for k, (a, b, f) in enumerate(zip(points[:-1], points[1:], share, strict=True))
    ]
    return np.concatenate(parts)


def _half_angle(width: float, length: float, span: float) -> float:
    """Solves ln(sinh(u) / u) = ln r by Newton's method.

    The left side is convex and increasing: after the first step all iterates lie right of the root.
    """
    log_r = 0.5 * np.log1p((length - span) * (length + span) / (width * width))
    # The first estimate is close for tight threads, the second for folds.
    u = max(np.sqrt(6.0 * log_r), log_r + np.log1p(log_r) + 1.0)
    for _ in range(_TOLERANCES.max_steps):
        step = (_log_sinhc(u) - log_r) / _log_sinhc_derivative(u)
        u -= step
        if abs(step) <= _TOLERANCES.newton * u:
            break
    return float(u)


def _log_sinhc(u: float) -> float:
    if u < 0.05:
        return u * u * (1.0 / 6.0 - u * u * (1.0 / 180.0 - u * u / 2835.0))
    return u + np.log1p(-np.exp(-2.0 * u)) - np.log(2.0 * u)


def _log_sinhc_derivative(u: float) -> float:
    if u < 0.05:
        return u * (1.0 / 3.0 - u * u * (1.0 / 45.0 - 2.0 * u * u / 945.0))
    return 1.0 / np.tanh(u) - 1.0 / u


def _samples(first: float, last: float, a: float, n: int) -> np.ndarray:
    """n arc lengths from first to last: even ones, and ones at even slopes about the lowest."""
    bent = n // 3 | 1 if n >= 6 else 0
    even = np.linspace(first, last, n - bent)
    near = np.clip(a * np.tan(np.linspace(-1.4, 1.4, bent)), first, last)
    return np.sort(np.concatenate([even, near]))
