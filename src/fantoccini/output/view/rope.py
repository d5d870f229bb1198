"""Curve of a slack string: a catenary of the string's length.

A massless string has no shape when slack; pictures show a thread of the same length
(:func:`fantoccini.base.catenary`).

A catenary is the curve of a heavy chain that hangs between two points.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fantoccini.base import catenary


class _Tolerances(NamedTuple):
    """Relative lengths below which a curve is degenerate."""

    straight: float = 1e-9
    """Excess length relative to the span below which the string is straight: no visible sag."""
    vertical: float = 1e-12
    """Width relative to the length below which the curve's direction is arbitrary."""


_TOLERANCES = _Tolerances()


def hanging_curve(start: np.ndarray, end: np.ndarray, length: float, n: int = 48) -> np.ndarray:
    """Points along a thread that hangs between two points.

    Args:
        start, end: (3,) ends [m].
        length: length of the thread [m]; up to the span it gives a straight line.
        n: number of points, at least 2; a third of them lie around the lowest point.

    Returns:
        (n, 3) points [m]; the first and last are the ends.
    """
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    offset = end - start
    span = float(np.linalg.norm(offset))
    steps = np.linspace(0.0, 1.0, n)
    if not length > span * (1.0 + _TOLERANCES.straight) or not np.isfinite(length):
        return start + steps[:, None] * offset
    width = float(np.hypot(offset[0], offset[1]))
    direction = (
        offset[:2] / width if width > _TOLERANCES.vertical * length else np.array([1.0, 0.0])
    )

    a, first, last = (float(value) for value in catenary(offset, length))
    s = _samples(first, last, a, n)

    x = a * (np.arcsinh(s / a) - np.arcsinh(s[0] / a))
    root = np.sqrt(a * a + s * s)
    z = (s - s[0]) * (s + s[0]) / (root + root[0])
    points = np.column_stack(
        [start[0] + direction[0] * x, start[1] + direction[1] * x, start[2] + z]
    )
    points[-1] = end
    return points


def slack_curve(points: np.ndarray, length: float, n: int = 48) -> np.ndarray:
    """Points along a slack string that runs through several points.

    Its excess length is shared among the segments in proportion to their spans.

    Args:
        points: (k, 3) points of the string [m].
        length: length of the whole string [m].
        n: number of points on each segment.

    Returns:
        (m, 3) points [m].
    """
    points = np.asarray(points, dtype=float)
    spans = np.linalg.norm(np.diff(points, axis=0), axis=1)
    total = float(spans.sum())
    shares = spans / total if total > 0.0 else np.full(len(spans), 1.0 / len(spans))
    curves = [
        hanging_curve(a, b, length * f, n)[0 if k == 0 else 1 :]
        for k, (a, b, f) in enumerate(zip(points[:-1], points[1:], shares, strict=True))
    ]
    return np.concatenate(curves)


def _samples(first: float, last: float, a: float, n: int) -> np.ndarray:
    """n arc lengths: some evenly spaced, and some at evenly spaced slopes near the lowest point."""
    n_bend = n // 3 | 1 if n >= 6 else 0
    even = np.linspace(first, last, n - n_bend)
    bend = np.clip(a * np.tan(np.linspace(-1.4, 1.4, n_bend)), first, last)
    return np.sort(np.concatenate([even, bend]))
