"""Moments at which a motion is nearest to places, each in its window and some in order.

min over t_1 <= t_2 <= ... of sum_k |off_k(t_k)|^2,   low_k <= t_k <= high_k

A touch is a point of a body that should pass a place; off_k(t) is the vector between them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.optimize import brentq

from fantoccini.base import Array, Times

OffsetFunction: TypeAlias = Callable[[int, Times], Array]
"""(n, 3) offsets of the k-th touch from its place at given times [m]."""
_SPREAD_WEIGHT = 1e-10
"""Weight of a small cost that prefers the middle of the window among equally near moments [m^2]."""
_DIFFERENCE = 1e-6
"""Step of finite differences of time [s]."""


@dataclass(frozen=True)
class Window:
    """Time window of a touch [s]; with `in_turn`, the touch must not precede the one before it."""

    low: float
    high: float
    in_turn: bool


def nearest_times(offsets: OffsetFunction, windows: Sequence[Window], step: float) -> Times:
    """Moments at which the points are nearest to their places.

    If a point is at rest, so that all moments are equally near, touches are spread evenly in their
    order.

    Args:
        offsets: see :data:`OffsetFunction`.
        windows: windows of the touches.
        step: spacing of the times at which distances are compared first [s].

    Returns:
        (T,) moments [s].
    """
    times = np.zeros(len(windows))
    first = 0
    for k in range(1, len(windows) + 1):
        if k == len(windows) or not windows[k].in_turn:
            times[first:k] = _ordered_times(offsets, windows, range(first, k), step)
            first = k
    return times


def _ordered_times(
    offsets: OffsetFunction, windows: Sequence[Window], touches: range, step: float
) -> Times:
    """(n,) moments of touches that must follow one another, by dynamic programming."""
    times: list[Times] = []
    path_costs: list[Array] = []
    for k in touches:
        low, high = windows[k].low, windows[k].high
        t = np.linspace(low, high, max(9, int(np.ceil((high - low) / step)) + 1))
        middle = (k + 1) / (len(windows) + 1)
        fraction = np.linspace(0.0, 1.0, len(t)) - middle
        cost = np.sum(np.square(offsets(k, t)), axis=1) + _SPREAD_WEIGHT * np.square(fraction)
        if times:
            previous = np.searchsorted(times[-1], t, side="right") - 1
            lowest = np.minimum.accumulate(path_costs[-1])
            cost += np.where(previous >= 0, lowest[previous], np.inf)
        times.append(t)
        path_costs.append(cost)
    selected, latest = [], np.inf
    for t, cost in zip(reversed(times), reversed(path_costs), strict=True):
        index = int(np.argmin(np.where(t <= latest, cost, np.inf)))
        latest = t[index]
        selected.append((latest, t[1] - t[0]))
    refined, earliest = np.zeros(len(touches)), -np.inf
    for j, (k, (t, spacing)) in enumerate(zip(touches, reversed(selected), strict=True)):
        low = max(windows[k].low, earliest)
        refined[j] = _refine(offsets, k, t, spacing, low, max(low, windows[k].high))
        earliest = refined[j]
    return refined


def _refine(
    offsets: OffsetFunction, k: int, t: float, spacing: float, low: float, high: float
) -> float:
    """The moment near t [s] at which the distance is smallest, between low and high."""
    a, b = max(t - spacing, low), min(t + spacing, high)
    if a >= b:
        t = min(max(t, low), high)
    else:
        slopes = _slope(offsets, k, a), _slope(offsets, k, b)
        if slopes[0] < 0.0 < slopes[1]:
            t = brentq(lambda time: _slope(offsets, k, time), a, b, xtol=1e-13)
        elif slopes[0] >= 0.0 and slopes[1] >= 0.0 and any(slopes):
            t = a
        elif slopes[0] <= 0.0 and slopes[1] <= 0.0 and any(slopes):
            t = b
        else:  # the point is at rest, or its distance has a maximum between a and b
            t = min((a, min(max(t, a), b), b), key=lambda x: _cost(offsets, k, x, t))
    return float(t)


def _cost(offsets: OffsetFunction, k: int, time: float, middle: float) -> float:
    """Squared distance at a time [m^2], with a small preference for times near ``middle``."""
    square = float(np.sum(np.square(offsets(k, np.array([time])))))
    return square + _SPREAD_WEIGHT * (time - middle) ** 2


def _slope(offsets: OffsetFunction, k: int, time: float) -> float:
    """Derivative of half the squared distance with respect to time."""
    previous, current, following = offsets(
        k, np.array([time - _DIFFERENCE, time, time + _DIFFERENCE])
    )
    return float(current @ (following - previous))
