"""Quintic pieces: p(s) = c_0 + c_1 s + ... + c_5 s^5, s the time since the piece began.

Arrays of coefficients have the powers, ascending, on the last axis: (..., 6).

A quintic is a polynomial of degree 5; its coefficients are often called `coef`.
"""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import ArrayLike

from fantoccini.base.arrays import Array

N_COEF = 6
"""Coefficients of a quintic."""

MINIMUM_JERK = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
"""(6,) coefficients of a move from rest at 0 to rest at 1 in a time of 1."""
_MINIMUM_JERK_MAXIMA = 1.875, 5.7735
"""Largest speed and acceleration of a minimum-jerk move by 1 in a time of 1."""

_TO_BEZIER = np.array(
    [[comb(i, k) / comb(N_COEF - 1, k) for k in range(N_COEF)] for i in range(N_COEF)]
)
"""Maps coefficients of powers of s / h to Bezier's control points."""

_MIN_SPEED = 1e-200
"""Speeds up to this count as 0, since their reciprocals overflow [1/s times the value's unit]."""


Motion = tuple[ArrayLike, ArrayLike, ArrayLike]
"""Value, first and second derivative."""


def hermite(h: Array, start: Motion, end: Motion) -> Array:
    """The quintic with given value, first and second derivative at both ends.

    Args:
        h: (...) durations [s], > 0.
        start, end: (value, first, second derivative), each (...).

    Returns:
        (..., 6) coefficients, ascending.
    """
    h = np.asarray(h, dtype=float)
    q0, v0, a0 = (np.asarray(x, dtype=float) for x in start)
    q1, v1, a1 = (np.asarray(x, dtype=float) for x in end)
    # End values minus those of the start's parabola, in units of the value.
    d = q1 - q0 - h * (v0 + 0.5 * h * a0)
    e = h * (v1 - v0 - h * a0)
    f = h * h * (a1 - a0)
    pieces = [
        q0,
        v0,
        0.5 * a0,
        (10 * d - 4 * e + 0.5 * f) / h**3,
        (-15 * d + 7 * e - f) / h**4,
        (6 * d - 3 * e + 0.5 * f) / h**5,
    ]
    return np.stack(np.broadcast_arrays(*pieces), axis=-1)


def minimum_jerk(s: Array) -> tuple[Array, Array, Array]:
    """10 s^3 - 15 s^4 + 6 s^5, from rest at 0 to rest at 1, with first and second derivative."""
    position = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    return position, 30.0 * s**2 * (1.0 - s) ** 2, 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)


def minimum_jerk_duration(
    distance: Array | float, speed: Array | float, acceleration: Array | float = np.inf
) -> float:
    """Shortest duration of minimum-jerk moves that keep within bounds [s].

    Args:
        distance: distances [m or rad].
        speed, acceleration: bounds of speed and acceleration.
    """
    max_speed, max_acceleration = _MINIMUM_JERK_MAXIMA
    return max(
        float(np.max(max_speed * distance / speed, initial=0.0)),
        float(np.max(np.sqrt(max_acceleration * distance / acceleration), initial=0.0)),
    )


def evaluate(coef: Array, s: Array) -> tuple[Array, Array, Array]:
    """Value, first and second derivative.

    Args:
        coef: (..., 6) coefficients, ascending.
        s: (...) time since the piece began [s]; broadcasts against the leading axes.

    Returns:
        Three arrays (...).
    """
    s = np.asarray(s, dtype=float)
    p = np.zeros(np.broadcast_shapes(coef.shape[:-1], s.shape))
    first, second = p, p
    for k in range(N_COEF - 1, -1, -1):
        second = second * s + 2 * first
        first = first * s + p
        p = p * s + coef[..., k]
    return p, first, second


def control_points(coef: Array, h: Array) -> Array:
    """Bezier's control points, whose smallest and largest bound all values on 0 <= s <= h.

    Args:
        coef: (..., 6) coefficients, ascending.
        h: (...) durations [s]; broadcasts against the leading axes.

    Returns:
        (..., 6).
    """
    powers = coef * np.asarray(h, dtype=float)[..., None] ** np.arange(N_COEF)
    return powers @ _TO_BEZIER.T


def shifted(coef: Array, d: Array) -> Array:
    """The same polynomials written about a later origin: p(s + d) (a Taylor shift, by Horner).

    Args:
        coef: (n, m, 6) coefficients.
        d: (n,) shifts [s].

    Returns:
        (n, m, 6).
    """
    shifted_coef, d = np.array(coef), np.asarray(d)[:, None]
    for lowest in range(N_COEF - 1):
        for k in range(N_COEF - 2, lowest - 1, -1):
            shifted_coef[..., k] += d * shifted_coef[..., k + 1]
    return shifted_coef


def monotone_slopes(t: Array, values: Array) -> Array:
    """Slopes at waypoints that never overshoot; at rest at both ends.

    The slope between two secants of equal sign is Fritsch and Butland's weighted harmonic mean, at
    most twice the smaller secant: with these slopes a quintic without acceleration at its ends is
    monotone (its derivative is at least 2 - 30 (s(1-s))^2 > 0 times the secant).

    Args:
        t: (n,) times [s], increasing.
        values: (n,) values.

    Returns:
        (n,) slopes.
    """
    h = np.diff(t)
    secant = np.diff(values) / h
    slopes = np.zeros(len(t))
    slopes[1:-1] = mean_speed(h, np.abs(secant)) * np.sign(secant[:-1])
    slopes[1:-1][secant[:-1] * secant[1:] <= 0] = 0.0
    return slopes


def mean_speed(h: Array, speed: Array) -> Array:
    """Weighted harmonic mean of neighbouring speeds, at most twice the smaller one.

    Args:
        h: (n,) durations [s].
        speed: (n,) speeds >= 0.

    Returns:
        (n - 1,) speeds at the points between.
    """
    before, after = speed[:-1], speed[1:]
    w_before, w_after = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
    moving = (before > _MIN_SPEED) & (after > _MIN_SPEED)
    safe_before, safe_after = np.where(moving, before, 1.0), np.where(moving, after, 1.0)
    mean = (w_before + w_after) / (w_before / safe_before + w_after / safe_after)
    return np.where(moving, np.minimum(mean, 2 * np.minimum(before, after)), 0.0)


def monotone_slopes_along(t: Array, values: Array, change: Array) -> tuple[Array, bool]:
    """The one-sided derivative d/ds of :func:`monotone_slopes` at values + s change, for s -> 0+.

    The slope is homogeneous of degree 1 in the two secants. It is smooth except where its bound
    becomes active and where a secant is 0; there the derivative depends on the direction.

    Args:
        t: (n,) times [s], increasing.
        values: (n,) values.
        change: (n,) direction, a change of the values.

    Returns:
        (n,) derivatives of the slopes, and whether all changing slopes are smooth.
    """
    h = np.diff(t)
    secant, rate = np.diff(values) / h, np.diff(change) / h
    slopes, smooth = np.zeros(len(t)), True
    for j in range(1, len(t) - 1):
        pair = slice(j - 1, j + 1)
        if np.any(rate[pair] != 0.0):
            slopes[j], is_smooth = _slope_along(h[pair], secant[pair], rate[pair])
            smooth &= is_smooth
    return slopes, bool(smooth)


def _slope_along(h: Array, secant: Array, rate: Array) -> tuple[float, bool]:
    """The one-sided derivative of the slope between two secants (2,), and whether it is smooth."""
    at_rest = np.abs(secant) <= _MIN_SPEED
    if np.all(at_rest):  # homogeneous: only the rates count
        reverses = rate[0] * rate[1] <= 0
        return 0.0 if reverses else float(np.sign(rate[0]) * mean_speed(h, np.abs(rate))[0]), False
    weight = np.array([2 * h[1] + h[0], h[1] + 2 * h[0]])
    share = weight / weight.sum()
    if np.any(at_rest):
        i = int(np.argmax(at_rest))
        # Near 0 the mean is the small secant divided by its relative weight.
        rises = rate[i] * secant[1 - i] > 0
        return float(min(1.0 / share[i], 2.0) * rate[i]) if rises else 0.0, False
    if np.sign(secant[0]) != np.sign(secant[1]):
        return 0.0, True
    sign, speed = np.sign(secant[0]), np.abs(secant)
    mean, bound = 1.0 / np.sum(share / speed), 2 * np.min(speed)
    mean_rate = mean**2 * np.sum(share * sign * rate / speed**2)
    bound_rate = 2 * sign * rate[np.argmin(speed)]
    if mean == bound:
        return float(sign * min(mean_rate, bound_rate)), False
    return float(sign * (mean_rate if mean < bound else bound_rate)), True
