"""Choice of an animation's keys: as few as keep the values between them within a tolerance.

Between two keys a glTF player evaluates a cubic through the values and rates at both, component by
component, and then normalises quaternions. Keys lie on a fine grid of samples. Each next key is as
far ahead as the tolerance allows.

An impact is a sudden change of velocity, at which a curve has a kink.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from fantoccini.base import Array, Indices, Times

_MIN_JUMP = 0.01
"""Jump of a rate, relative to the largest rate, above which a key gets two tangents."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A translation or an orientation at the samples of a grid.

    Attributes:
        t: (T,) times [s]; an impact has two samples at one time.
        x: (T, n) values; quaternions do not change sign from sample to sample.
        v: (T, n) rates of the values.
        tolerance: (T,) tolerance of the values [m or 1].
        is_quaternion: the values are quaternions.
    """

    t: Times
    x: Array
    v: Array
    tolerance: Array
    is_quaternion: bool

    @property
    def constant(self) -> bool:
        """Whether the curve is constant, within 1 % of the tolerance."""
        return bool(np.all(np.abs(self.x - self.x[0]) < 0.01 * self.tolerance[:, None]))


@dataclass(frozen=True, eq=False)
class Keys:
    """Samples of a curve that are keys.

    Attributes:
        before, after: (K,) samples with the rates before and after the key; they differ at an
            impact.
    """

    before: Indices
    after: Indices

    def evaluate(self, curve: Curve, t: Times) -> Array:
        """(m, n) values that a player shows at times (m,) [s]."""
        times = curve.t[self.before]
        k = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
        a, b = self.after[k], self.before[k + 1]
        return _evaluate_cubics(curve, a, b, t)

    def refined(self, curve: Curve, samples: Indices) -> Keys:
        """The keys, with another one amid each span that contains one of the samples."""
        k = np.unique(np.searchsorted(self.before, samples, side="right") - 1)
        k = k[(k >= 0) & (k < len(self.before) - 1)]
        middle = (self.after[k] + self.before[k + 1]) // 2
        middle = middle[(middle > self.after[k]) & (middle < self.before[k + 1])]
        t = curve.t[middle]
        first, last = (np.searchsorted(curve.t, t, side=side) for side in ("left", "right"))
        indices = np.append(self.before, first), np.append(self.after, last - 1)
        order = np.argsort(indices[0])
        return Keys(indices[0][order], indices[1][order])


def cubic_keys(curve: Curve) -> Keys:
    """Keys of a curve as cubics, chosen one after the other."""
    first, last = (np.searchsorted(curve.t, curve.t, side=side) for side in ("left", "right"))
    last -= 1
    before, after, stride = [0], [int(last[0])], 8
    for jump in np.unique(np.append(first[_jumps(curve)], first[-1])):
        while before[-1] < jump:
            start = after[-1]
            end = _farthest_sample(partial(_error, curve, start), start, int(jump), stride, 4)
            stride = end - start
            before.append(int(first[end]))
            after.append(int(last[end]))
    return Keys(np.array(before), np.array(after))


def linear_keys(t: Times, x: Array, tolerance: float, is_quaternion: bool = False) -> Indices:
    """(K,) samples between which linear interpolation keeps values (T, n) within a tolerance."""
    keys, last, stride = [0], len(t) - 1, 8

    def error(start: int, end: int) -> float:
        s = ((t[start + 1 : end] - t[start]) / max(t[end] - t[start], 1e-12))[:, None]
        values = x[start] + s * (x[end] - x[start])
        if is_quaternion:
            values /= np.linalg.norm(values, axis=1, keepdims=True)
        return float(np.max(np.abs(values - x[start + 1 : end]), initial=0.0) / tolerance)

    while keys[-1] < last:
        start = keys[-1]
        end = _farthest_sample(partial(error, start), start, last, stride, 2)
        stride = end - start
        # A linear key can use only one of several samples at the same time.
        keys.append(int(np.searchsorted(t, t[end], side="right")) - 1)
    return np.array(keys)


def _jumps(curve: Curve) -> Indices:
    """Samples before the impacts at which the curve's rate jumps."""
    impacts = np.flatnonzero(np.diff(curve.t) <= 0.0)
    if not len(impacts):
        return impacts
    jump = np.max(np.abs(curve.v[impacts + 1] - curve.v[impacts]), axis=1)
    return impacts[jump > _MIN_JUMP * np.max(np.abs(curve.v))]


def _farthest_sample(
    error: Callable[[int], float], start: int, end: int, stride: int, power: int
) -> int:
    """Approximately the last sample to which the error is at most 1; at least the next one.

    The error is assumed to grow as the given power of the distance, from which the next trial
    is predicted.
    """
    accepted, rejected = start + 1, end + 1
    trial = min(start + max(stride, 2), end)
    while accepted < trial < rejected:
        value = error(trial)
        if value <= 1.0:
            accepted = trial
        else:
            rejected = trial
        predicted = start + int(
            (trial - start) * min(0.97 * max(value, 1e-9) ** (-1.0 / power), 4.0)
        )
        if rejected - accepted <= 1 + (accepted - start) // 32:
            break
        trial = min(max(predicted, accepted + 1), rejected - 1)
    return accepted


def _error(curve: Curve, start: int, end: int) -> float:
    """Largest error between two keys, in units of the tolerance."""
    inside = slice(start + 1, end)
    values = _evaluate_cubics(curve, np.array([start]), np.array([end]), curve.t[inside])
    offsets = values - curve.x[inside]
    errors = np.sqrt(np.einsum("ij,ij->i", offsets, offsets)) / curve.tolerance[inside]
    return float(np.max(errors, initial=0.0))


def _evaluate_cubics(curve: Curve, a: Indices, b: Indices, t: Times) -> Array:
    """(m, n) values of the cubics from samples ``a`` to samples ``b``, at times (m,) [s]."""
    start, h = curve.t[a], curve.t[b] - curve.t[a]
    s = ((t - start) / np.where(h > 0.0, h, 1.0))[:, None]
    h = h[:, None]
    s2 = s * s
    s3 = s2 * s
    x = (
        (2 * s3 - 3 * s2 + 1) * curve.x[a]
        + h * (s3 - 2 * s2 + s) * curve.v[a]
        + (3 * s2 - 2 * s3) * curve.x[b]
        + h * (s3 - s2) * curve.v[b]
    )
    if curve.is_quaternion:
        x /= np.sqrt(np.einsum("ij,ij->i", x, x))[:, None]
    return x
