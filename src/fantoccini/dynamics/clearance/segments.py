"""Distances of many segments from segments, boxes and ellipsoids; curves of slack strings."""

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


def between_segments(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> tuple[Array, Array]:
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
    crossing = determinant > _TOLERANCES.min_determinant * (uu * vv)
    s = np.where(crossing, (uv * wv - vv * wu) / np.where(crossing, determinant, 1.0), 0.0)
    # The nearest point of the other line, moved into its segment; then the point nearest to that.
    t = np.clip((uv * np.clip(s, 0.0, 1.0) + wv) / vv, 0.0, 1.0)
    s = np.clip((uv * t - wu) / uu, 0.0, 1.0)
    gap = w + s[:, None] * u - t[:, None] * v
    return np.sqrt(dot(gap, gap)), s


def from_box(a: Vec3, b: Vec3, half: Vec3) -> tuple[Array, Array]:
    """Distances min |x - y|, x = a + t (b - a) on a segment, y in a box about the origin.

    Half the derivative of the squared distance along the segment increases and is piecewise linear,
    with breaks where the segment meets a face's plane: its zero lies between two of these.

    Args:
        a, b: (n, 3) ends of the segment in the box's frame [m].
        half: (n, 3) half edges [m].

    Returns:
        Distances (n,) [m], 0 where they meet, and t (n,).
    """
    d = b - a

    def outside(t: Array) -> Vec3:
        x = a + t[:, None] * d
        return x - np.clip(x, -half, half)

    low, high = np.zeros(len(a)), np.ones(len(a))
    at_low, at_high = dot(outside(low), d), dot(outside(high), d)
    moves = np.abs(d) > _TOLERANCES.min_length
    step = np.where(moves, d, 1.0)
    for k, side in itertools.product(range(3), (-1.0, 1.0)):
        t = (side * half[:, k] - a[:, k]) / step[:, k]
        inner = moves[:, k] & (t > low) & (t < high)
        there = dot(outside(t), d)
        before, after = inner & (there < 0.0), inner & (there >= 0.0)
        low, at_low = np.where(before, t, low), np.where(before, there, at_low)
        high, at_high = np.where(after, t, high), np.where(after, there, at_high)
    turns = (at_low < 0.0) & (at_high > 0.0)
    zero = low - at_low * (high - low) / np.where(turns, at_high - at_low, 1.0)
    t = np.where(turns, zero, np.where(at_low < 0.0, high, low))
    gap = outside(t)
    return np.sqrt(dot(gap, gap)), t


def from_ellipsoid(a: Vec3, b: Vec3, half: Vec3) -> tuple[Array, Array]:
    """Lower bounds of the distances of segments from ellipsoids, exact where they touch.

        rho (rho - 1) / |A^-2 x|,   rho = |A^-1 x|,   A = diag(half)

    with x the point of the segment of least rho: the gap between the planes through x and on the
    ellipsoid that are square to the gradient of rho there. These planes separate the two.

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


def hanging(start: Vec3, end: Vec3, length: Array) -> Vec3:
    """Points along slack strings, which hang as catenaries.

    Args:
        start, end: (n, 3) ends [m].
        length: (n,) lengths of the strings, larger than the distance of the ends [m].

    Returns:
        Points (n, N_CHORDS + 1, 3) in equal horizontal steps [m]. They are close together where
        the curve bends, so that no chord is farther from it than w / N_CHORDS, with w the
        horizontal distance of the ends.
    """
    along = end - start
    a, low, high = catenary(along, length)
    first, last = np.arcsinh(low / a), np.arcsinh(high / a)
    steps = np.linspace(0.0, 1.0, N_CHORDS + 1)
    height = np.cosh(first[:, None] + (last - first)[:, None] * steps)
    points = start[:, None] + steps[:, None] * along[:, None]
    points[..., 2] = start[:, None, 2] + a[:, None] * (height - height[:, :1])
    points[:, -1] = end
    return points
