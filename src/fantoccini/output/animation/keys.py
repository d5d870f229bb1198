"""Where an animation has keys: as few as keep what is between them within a tolerance.

Between two keys a glTF player runs a cubic through the values and the rates at both, component by
component; it normalises a quaternion afterwards. The keys lie on a fine grid of samples. From each
the next one is as far ahead as the tolerance lets it be.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from fantoccini.base import Array, Indices, Times

_JUMP = 0.01
"""A rate that jumps by more than this share of the largest one is two tangents of one key."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A translation or an orientation at the samples of a grid.

    Attributes:
        t: (T,) times [s]; an impact is two samples at one time.
        x: (T, n) values; unit quaternions have no jumps of sign.
        v: (T, n) their rates.
        tolerance: (T,) of values [m or 1].
        unit: the values are quaternions.
    """

    t: Times
    x: Array
    v: Array
    tolerance: Array
    unit: bool

    @property
    def still(self) -> bool:
        """Whether it never leaves its first value."""
        return bool(np.all(np.abs(self.x - self.x[0]) < 0.01 * self.tolerance[:, None]))


@dataclass(frozen=True, eq=False)
class Keys:
    """Samples of a curve that are keys.

    Attributes:
        before, after: (K,) the sample whose rate arrives, and the one whose rate leaves; they
            differ at an impact.
    """

    before: Indices
    after: Indices

    def evaluate(self, curve: Curve, t: Times) -> Array:
        """(m, n) what a player shows at times [s]."""
        times = curve.t[self.before]
        k = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
        a, b = self.after[k], self.before[k + 1]
        return _shown(curve, a, b, t)

    def halved(self, curve: Curve, at: Indices) -> Keys:
        """With a key in the middle of every span that holds one of the samples."""
        k = np.unique(np.searchsorted(self.before, at, side="right") - 1)
        k = k[(k >= 0) & (k < len(self.before) - 1)]
        middle = (self.after[k] + self.before[k + 1]) // 2
        middle = middle[(middle > self.after[k]) & (middle < self.before[k + 1])]
        t = curve.t[middle]
        first, last = (np.searchsorted(curve.t, t, side=side) for side in ("left", "right"))
        both = np.append(self.before, first), np.append(self.after, last - 1)
        order = np.argsort(both[0])
        return Keys(both[0][order], both[1][order])


def cubic_keys(curve: Curve) -> Keys:
    """The keys of a curve, found from each to the next."""
    first, last = (np.searchsorted(curve.t, curve.t, side=side) for side in ("left", "right"))
    last -= 1
    before, after, stride = [0], [int(last[0])], 8
    for end in np.unique(np.append(first[_jumps(curve)], first[-1])):
        while before[-1] < end:
            at = after[-1]
            to = _farthest(partial(_error, curve, at), at, int(end), stride, 4)
            stride = to - at
            before.append(int(first[to]))
            after.append(int(last[to]))
    return Keys(np.array(before), np.array(after))


def linear_keys(t: Times, x: Array, tolerance: float, unit: bool = False) -> Indices:
    """(K,) samples between which straight lines keep values (T, n) within a tolerance."""
    kept, last, stride = [0], len(t) - 1, 8

    def error(at: int, to: int) -> float:
        s = ((t[at + 1 : to] - t[at]) / max(t[to] - t[at], 1e-12))[:, None]
        shown = x[at] + s * (x[to] - x[at])
        if unit:
            shown /= np.linalg.norm(shown, axis=1, keepdims=True)
        return float(np.max(np.abs(shown - x[at + 1 : to]), initial=0.0) / tolerance)

    while kept[-1] < last:
        at = kept[-1]
        to = _farthest(partial(error, at), at, last, stride, 2)
        stride = to - at
        # Of several samples at one time a line can have only one.
        kept.append(int(np.searchsorted(t, t[to], side="right")) - 1)
    return np.array(kept)


def _jumps(curve: Curve) -> Indices:
    """The samples before impacts that the curve shows."""
    twice = np.flatnonzero(np.diff(curve.t) <= 0.0)
    if not len(twice):
        return twice
    jump = np.max(np.abs(curve.v[twice + 1] - curve.v[twice]), axis=1)
    return twice[jump > _JUMP * np.max(np.abs(curve.v))]


def _farthest(error: Callable[[int], float], at: int, end: int, stride: int, power: int) -> int:
    """About the last sample up to which the error is below 1; the next one always will do.

    The error grows as the distance to the power of the order of the curve; from the error at one
    distance the next is guessed.
    """
    good, bad = at + 1, end + 1
    to = min(at + max(stride, 2), end)
    while good < to < bad:
        found = error(to)
        if found <= 1.0:
            good = to
        else:
            bad = to
        guess = at + int((to - at) * min(0.97 * max(found, 1e-9) ** (-1.0 / power), 4.0))
        if bad - good <= 1 + (good - at) // 32:
            break
        to = min(max(guess, good + 1), bad - 1)
    return good


def _error(curve: Curve, at: int, to: int) -> float:
    """The largest error between two keys, in tolerances."""
    inside = slice(at + 1, to)
    shown = _shown(curve, np.array([at]), np.array([to]), curve.t[inside])
    away = shown - curve.x[inside]
    errors = np.sqrt(np.einsum("ij,ij->i", away, away)) / curve.tolerance[inside]
    return float(np.max(errors, initial=0.0))


def _shown(curve: Curve, a: Indices, b: Indices, t: Times) -> Array:
    """(m, n) the cubics from samples ``a`` to samples ``b``, at times [s]."""
    start, h = curve.t[a], curve.t[b] - curve.t[a]
    s = ((t - start) / np.where(h > 0.0, h, 1.0))[:, None]
    h = h[:, None]
    ss = s * s
    sss = ss * s
    x = (
        (2 * sss - 3 * ss + 1) * curve.x[a]
        + h * (sss - 2 * ss + s) * curve.v[a]
        + (3 * ss - 2 * sss) * curve.x[b]
        + h * (sss - ss) * curve.v[b]
    )
    if curve.unit:
        x /= np.sqrt(np.einsum("ij,ij->i", x, x))[:, None]
    return x
