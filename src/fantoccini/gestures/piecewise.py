"""Piecewise quintic offsets of all driven velocities: coef (n, n_vK, 6) between breaks (n + 1,)."""

from __future__ import annotations

import numpy as np

from fantoccini.arrays import Array, Times
from fantoccini.motion import pieces, polynomial
from fantoccini.motion.channel import Channel

_PARTS = 8
"""Parts of a piece over which its extremes are bounded."""


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
    """(n, 2, n_vK) bounds of the largest speeds and accelerations of every piece.

    They are a few per mille above them: a polynomial lies between the least and the largest of
    Bezier's control points.
    """
    h = np.repeat(np.diff(breaks) / _PARTS, _PARTS)
    starts = np.tile(np.arange(_PARTS), len(coef)) * h
    cut = polynomial.shifted(np.repeat(coef, _PARTS, axis=0), starts)
    powers = np.arange(1.0, polynomial.N_COEF)
    first = np.zeros_like(cut)
    first[..., :-1] = cut[..., 1:] * powers
    second = np.zeros_like(cut)
    second[..., :-2] = cut[..., 2:] * (powers[1:] * powers[:-1])
    both = np.stack([first, second], axis=1)
    sizes = np.max(np.abs(polynomial.control_points(both, h[:, None, None])), axis=-1)
    return np.max(sizes.reshape(len(coef), _PARTS, 2, -1), axis=1)
