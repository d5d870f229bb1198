"""Piecewise quintic offsets of all driven velocities: coef (n, n_vK, 6) between breaks (n + 1,)."""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, Times, polynomial
from fantoccini.motion import Channel, pieces

_PARTS = 16
"""Parts of a piece over which its speed is bounded."""
_AT_ONCE = 1000
"""Pieces whose peaks are found at once, for memory."""


def at(breaks: Times, coef: Array, t: float) -> tuple[Array, Array]:
    """(n_vK,) values and rates at a time; of the first or last piece at the ends."""
    i = int(np.clip(np.searchsorted(breaks, t, side="right") - 1, 0, len(coef) - 1))
    value, rate, _ = polynomial.evaluate(coef[i], np.array(t - breaks[i]))
    return value, rate


def on(breaks: Times, coef: Array, clock: Times) -> Array:
    """The same on a finer clock, with its first and last values held before and after it."""
    held = np.zeros((2, *coef.shape[1:]))
    held[0, :, 0], held[1, :, 0] = at(breaks, coef, breaks[0])[0], at(breaks, coef, breaks[-1])[0]
    nothing = np.zeros(0)
    empty = np.zeros((len(coef), 0))
    return Channel(breaks, coef, empty, (held[0], nothing), (held[1], nothing)).on(clock)[0]


def added(a: tuple[Times, Array], b: tuple[Times, Array]) -> tuple[Times, Array]:
    """The sum of two motions on one clock."""
    clock = pieces.refined(a[0], [b[0]])
    return clock, on(*a, clock) + on(pieces.snap(b[0], clock), b[1], clock)


def faster(coef: Array, factor: float) -> Array:
    """Coefficients of p(factor t)."""
    return coef * factor ** np.arange(polynomial.N_COEF)


def peaks(breaks: Times, coef: Array) -> Array:
    """(n, 2, n_vK) largest speeds and accelerations of every piece.

    Speeds are bounded by Bezier's control points, which is at most some 1e-3 too much;
    accelerations are exact: a cubic is largest at its ends or where its derivative is 0.
    """
    found = np.empty((len(coef), 2, coef.shape[1]))
    h = np.diff(breaks)
    for first in range(0, len(coef), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        found[part, 0] = _fastest(h[part], coef[part])
        found[part, 1] = _hardest(h[part], coef[part])
    return found


def _fastest(h: Times, coef: Array) -> Array:
    short = np.repeat(h / _PARTS, _PARTS)
    starts = np.tile(np.arange(_PARTS), len(coef)) * short
    rates = np.zeros((len(short), *coef.shape[1:]))
    rates[..., :-1] = np.repeat(coef, _PARTS, axis=0)[..., 1:] * np.arange(1.0, polynomial.N_COEF)
    points = polynomial.control_points(polynomial.shifted(rates, starts), short[:, None])
    return np.max(np.max(np.abs(points), axis=-1).reshape(len(coef), _PARTS, -1), axis=1)


def _hardest(h: Times, coef: Array) -> Array:
    a, b, c = 60.0 * coef[..., 5], 24.0 * coef[..., 4], 6.0 * coef[..., 3]  # a s^2 + b s + c
    root = np.sqrt(np.maximum(b * b - 4.0 * a * c, 0.0))
    q = -0.5 * (b + np.where(b < 0.0, -root, root))
    most = np.zeros(coef.shape[:2])
    with np.errstate(divide="ignore", invalid="ignore"):
        times = [np.zeros_like(q), np.broadcast_to(h[:, None], q.shape), q / a, c / q]
    for s in times:
        inside = np.clip(np.where(np.isfinite(s), s, 0.0), 0.0, h[:, None])
        most = np.maximum(most, np.abs(polynomial.evaluate(coef, inside)[2]))
    return most
