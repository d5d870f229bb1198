"""Piecewise quintic offsets of all driven velocities: coef (n, n_vK, 6) between breaks (n + 1,)."""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, Times, polynomial
from fantoccini.motion import Channel, pieces

_SPEED_PARTS = 16
"""Number of parts of a piece over which its speed is bounded separately."""
_BATCH = 1000
"""Number of pieces whose peaks are computed together, limited by memory."""


def at(breaks: Times, coef: Array, t: float) -> tuple[Array, Array]:
    """(n_vK,) values and rates at a time; beyond the ends, of the first or last piece."""
    i = int(np.clip(np.searchsorted(breaks, t, side="right") - 1, 0, len(coef) - 1))
    value, rate, _ = polynomial.evaluate(coef[i], np.array(t - breaks[i]))
    return value, rate


def on(breaks: Times, coef: Array, clock: Times) -> Array:
    """Coefficients on a finer clock, with the first and last values held before and after it."""
    held = np.zeros((2, *coef.shape[1:]))
    held[0, :, 0], held[1, :, 0] = at(breaks, coef, breaks[0])[0], at(breaks, coef, breaks[-1])[0]
    nothing = np.zeros(0)
    empty = np.zeros((len(coef), 0))
    return Channel(breaks, coef, empty, (held[0], nothing), (held[1], nothing)).on(clock)[0]


def added(a: tuple[Times, Array], b: tuple[Times, Array]) -> tuple[Times, Array]:
    """Sum of two motions on one clock."""
    clock = pieces.refined_breaks(a[0], [b[0]])
    return clock, on(*a, clock) + on(pieces.snapped_to_breaks(b[0], clock), b[1], clock)


def faster(coef: Array, factor: float) -> Array:
    """Coefficients of p(factor t)."""
    return coef * factor ** np.arange(polynomial.N_COEF)


def peaks(breaks: Times, coef: Array) -> Array:
    """(n, 2, n_vK) largest speeds and accelerations of every piece.

    Speeds are bounded by Bezier control points, which overestimate them by at most about 1e-3;
    accelerations are exact: a cubic is largest at its ends or where its derivative is 0.
    """
    largest = np.empty((len(coef), 2, coef.shape[1]))
    h = np.diff(breaks)
    for first in range(0, len(coef), _BATCH):
        part = slice(first, first + _BATCH)
        largest[part, 0] = _peak_speeds(h[part], coef[part])
        largest[part, 1] = _peak_accelerations(h[part], coef[part])
    return largest


def _peak_speeds(h: Times, coef: Array) -> Array:
    short = np.repeat(h / _SPEED_PARTS, _SPEED_PARTS)
    starts = np.tile(np.arange(_SPEED_PARTS), len(coef)) * short
    rates = np.zeros((len(short), *coef.shape[1:]))
    rates[..., :-1] = np.repeat(coef, _SPEED_PARTS, axis=0)[..., 1:] * np.arange(
        1.0, polynomial.N_COEF
    )
    points = polynomial.control_points(polynomial.shifted(rates, starts), short[:, None])
    return np.max(np.max(np.abs(points), axis=-1).reshape(len(coef), _SPEED_PARTS, -1), axis=1)


def _peak_accelerations(h: Times, coef: Array) -> Array:
    a, b, c = 60.0 * coef[..., 5], 24.0 * coef[..., 4], 6.0 * coef[..., 3]  # a s^2 + b s + c
    root = np.sqrt(np.maximum(b * b - 4.0 * a * c, 0.0))
    q = -0.5 * (b + np.where(b < 0.0, -root, root))
    accelerations = np.zeros(coef.shape[:2])
    with np.errstate(divide="ignore", invalid="ignore"):
        times = [np.zeros_like(q), np.broadcast_to(h[:, None], q.shape), q / a, c / q]
    for s in times:
        inside = np.clip(np.where(np.isfinite(s), s, 0.0), 0.0, h[:, None])
        accelerations = np.maximum(accelerations, np.abs(polynomial.evaluate(coef, inside)[2]))
    return accelerations
