"""Distances of arrays of segments from segments, boxes, ellipsoids; curves of slack strings.

A segment is a straight line with two ends. A slack string hangs as a catenary, the curve of a heavy
chain.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Vec3, catenary

N_CHORDS = 12
"""Number of segments that replace the curve of a slack string."""


@dataclass(frozen=True)
class _Tolerances:
    """Thresholds of degenerate cases."""

    min_length: float = 1e-12
    """Length below which a segment counts as a point [m]."""
    min_determinant: float = 1e-12
    """Squared sine of an angle below which segments count as parallel."""


_TOLERANCES = _Tolerances()


def dot(x: Vec3, y: Vec3) -> Array:
    """Scalar products (...) of vectors (..., 3)."""
    return np.einsum("...i,...i->...", x, y)


def segment_distance(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> tuple[Array, Array]:
    """Distances of segments: min |a + s (b - a) - c - t (d - c)|, 0 <= s, t <= 1.

    Args:
        a, b: (n, 3) ends of the first segment [m].
        c, d: (n, 3) ends of the second segment [m].

    Returns:
        Distances (n,) [m], and s (n,).
    """
    u, v, w = b - a, d - c, a - c
    tiny = _TOLERANCES.min_length**2
    uu, vv, uv = dot(u, u) + tiny, dot(v, v) + tiny, dot(u, v)
    wu, wv = dot(w, u), dot(w, v)
    determinant = uu * vv - uv * uv
    is_skew = determinant > _TOLERANCES.min_determinant * (uu * vv)  # not parallel
    s = np.where(is_skew, (uv * wv - vv * wu) / np.where(is_skew, determinant, 1.0), 0.0)
    # The point of segment c-d nearest to that on a-b; then the point of a-b nearest to it.
    t = np.clip((uv * np.clip(s, 0.0, 1.0) + wv) / vv, 0.0, 1.0)
    s = np.clip((uv * t - wu) / uu, 0.0, 1.0)
    gap = w + s[:, None] * u - t[:, None] * v
    return np.sqrt(dot(gap, gap)), s


def distance_from_box(a: Vec3, b: Vec3, half: Vec3) -> tuple[Array, Array]:
    """Distances min |x - y|, x = a + t (b - a) on a segment, y in a box about the origin.

    The derivative of the squared distance by t increases and is piecewise linear. Its breaks are
    where the segment meets the plane of a face; its zero lies between two neighbouring breaks.

    Args:
        a, b: (n, 3) ends of the segment in the box's frame [m].
        half: (n, 3) half edges [m].

    Returns:
        Distances (n,) [m], 0 where they meet, and t (n,).
    """
    d = b - a

    def vector_from_box(t: Array) -> Vec3:
        x = a + t[:, None] * d
        return x - np.clip(x, -half, half)

    def half_derivative(t: Array) -> Array:
        return dot(vector_from_box(t), d)

    # Bracket of the zero, and the derivative at its ends.
    low, high = np.zeros(len(a)), np.ones(len(a))
    slope_low, slope_high = half_derivative(low), half_derivative(high)
    crosses_planes = np.abs(d) > _TOLERANCES.min_length
    divisor = np.where(crosses_planes, d, 1.0)
    for k, side in itertools.product(range(3), (-1.0, 1.0)):
        t = (side * half[:, k] - a[:, k]) / divisor[:, k]
        is_inside = crosses_planes[:, k] & (t > low) & (t < high)
        slope = half_derivative(t)
        is_below, is_above = is_inside & (slope < 0.0), is_inside & (slope >= 0.0)
        low, slope_low = np.where(is_below, t, low), np.where(is_below, slope, slope_low)
        high, slope_high = np.where(is_above, t, high), np.where(is_above, slope, slope_high)
    has_zero = (slope_low < 0.0) & (slope_high > 0.0)
    zero = low - slope_low * (high - low) / np.where(has_zero, slope_high - slope_low, 1.0)
    t = np.where(has_zero, zero, np.where(slope_low < 0.0, high, low))
    gap = vector_from_box(t)
    return np.sqrt(dot(gap, gap)), t


def distance_bound_from_ellipsoid(a: Vec3, b: Vec3, half: Vec3) -> tuple[Array, Array]:
    """Lower bounds of the distances of segments from ellipsoids, exact where they touch.

        rho (rho - 1) / |A^-2 x|,   rho = |A^-1 x|,   A = diag(half)

    with x the point of the segment at which rho is smallest. The bound is the gap between two
    planes normal to the gradient of rho at x: one through x, one tangent to the ellipsoid. They
    separate the two.

    Args:
        a, b: (n, 3) ends of the segment in the ellipsoid's frame [m].
        half: (n, 3) half axes [m].

    Returns:
        Bounds (n,) [m], negative where they overlap, and t (n,) of x = a + t (b - a).
    """
    x, d = a / half, (b - a) / half
    t = np.clip(-dot(x, d) / np.maximum(dot(d, d), _TOLERANCES.min_length**2), 0.0, 1.0)
    x += t[:, None] * d
    rho = np.maximum(np.sqrt(dot(x, x)), _TOLERANCES.min_length)
    slope = np.maximum(np.sqrt(dot(x / half, x / half)), rho / half.max(axis=1))
    return rho * (rho - 1.0) / slope, t


def slack_curves(start: Vec3, end: Vec3, length: Array) -> Vec3:
    """Points along slack strings, which hang as catenaries.

    Args:
        start, end: (n, 3) ends [m].
        length: (n,) lengths of the strings, larger than the distance of the ends [m].

    Returns:
        Points (n, N_CHORDS + 1, 3) in equal horizontal steps [m]. No chord is farther from the
        curve than w / N_CHORDS, with w the horizontal distance of the ends.
    """
    chord = end - start
    a, arc_start, arc_end = catenary(chord, length)
    u_start, u_end = np.arcsinh(arc_start / a), np.arcsinh(arc_end / a)
    shares = np.linspace(0.0, 1.0, N_CHORDS + 1)
    height = np.cosh(u_start[:, None] + (u_end - u_start)[:, None] * shares)
    points = start[:, None] + shares[:, None] * chord[:, None]
    points[..., 2] = start[:, None, 2] + a[:, None] * (height - height[:, :1])
    points[:, -1] = end
    return points
