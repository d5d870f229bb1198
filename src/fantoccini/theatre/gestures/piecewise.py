"""Piecewise quintic offsets of all driven coordinates over time.

A motion of n pieces has the times `breaks` (n + 1,) at which the pieces meet, and the coefficients
`coef` (n, n_vK, 6) in ascending powers of the time since the piece began. n_vK is the number of
driven velocities.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, Times, polynomial
from fantoccini.motion import Channel, pieces

_SPEED_PARTS = 16
"""Number of parts of a piece over which its speed is bounded separately."""
_BATCH = 1000
"""Number of pieces whose peaks are computed together, limited by memory."""


def evaluate(breaks: Times, coef: Array, t: float) -> tuple[Array, Array]:
    """(n_vK,) values and rates at a time; beyond the ends, of the first or last piece."""
    i = int(np.clip(np.searchsorted(breaks, t, side="right") - 1, 0, len(coef) - 1))
    value, rate, _ = polynomial.evaluate(coef[i], np.array(t - breaks[i]))
    return value, rate


def refine(breaks: Times, coef: Array, fine_breaks: Times) -> Array:
    """Coefficients on a finer clock, with the first and last values held before and after it."""
    end_coef = np.zeros((2, *coef.shape[1:]))
    end_coef[0, :, 0], end_coef[1, :, 0] = (
        evaluate(breaks, coef, breaks[0])[0],
        evaluate(breaks, coef, breaks[-1])[0],
    )
    empty_base = np.zeros(0)
    base = np.zeros((len(coef), 0))
    return Channel(breaks, coef, base, (end_coef[0], empty_base), (end_coef[1], empty_base)).on(
        fine_breaks
    )[0]


def add(first: tuple[Times, Array], second: tuple[Times, Array]) -> tuple[Times, Array]:
    """Sum of two motions on one clock."""
    breaks = pieces.refined_breaks(first[0], [second[0]])
    return breaks, refine(*first, breaks) + refine(
        pieces.snapped_to_breaks(second[0], breaks), second[1], breaks
    )


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
    for start in range(0, len(coef), _BATCH):
        batch = slice(start, start + _BATCH)
        largest[batch, 0] = _peak_speeds(h[batch], coef[batch])
        largest[batch, 1] = _peak_accelerations(h[batch], coef[batch])
    return largest


def _peak_speeds(h: Times, coef: Array) -> Array:
    part_durations = np.repeat(h / _SPEED_PARTS, _SPEED_PARTS)
    part_starts = np.tile(np.arange(_SPEED_PARTS), len(coef)) * part_durations
    rate_coef = np.zeros((len(part_durations), *coef.shape[1:]))
    rate_coef[..., :-1] = np.repeat(coef, _SPEED_PARTS, axis=0)[..., 1:] * np.arange(
        1.0, polynomial.N_COEF
    )
    control_points = polynomial.control_points(
        polynomial.shifted(rate_coef, part_starts), part_durations[:, None]
    )
    return np.max(
        np.max(np.abs(control_points), axis=-1).reshape(len(coef), _SPEED_PARTS, -1), axis=1
    )


def _peak_accelerations(h: Times, coef: Array) -> Array:
    a, b, c = 60.0 * coef[..., 5], 24.0 * coef[..., 4], 6.0 * coef[..., 3]  # a s^2 + b s + c
    discriminant_root = np.sqrt(np.maximum(b * b - 4.0 * a * c, 0.0))
    stable_root = -0.5 * (b + np.where(b < 0.0, -discriminant_root, discriminant_root))
    accelerations = np.zeros(coef.shape[:2])
    with np.errstate(divide="ignore", invalid="ignore"):
        extremum_times = [
            np.zeros_like(stable_root),
            np.broadcast_to(h[:, None], stable_root.shape),
            stable_root / a,
            c / stable_root,
        ]
    for s in extremum_times:
        clipped = np.clip(np.where(np.isfinite(s), s, 0.0), 0.0, h[:, None])
        accelerations = np.maximum(accelerations, np.abs(polynomial.evaluate(coef, clipped)[2]))
    return accelerations
