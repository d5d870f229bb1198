"""Moments at which a motion is nearest to places, each in its window and some in turn.

min over t_1 <= t_2 <= ... of sum |off_k(t_k)|^2,   low_k <= t_k <= high_k
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.optimize import brentq

from fantoccini.base import Array, Times

Off: TypeAlias = Callable[[int, Times], Array]
"""(n, 3) how far the k-th touch is off its place at some times [m]."""
_EVEN = 1e-10
"""Of the square of a share of the window, by which equally near moments are told apart [m^2]."""
_STEP = 1e-6
"""Of differences of time [s]."""


@dataclass(frozen=True)
class Window:
    """When a touch may be [s]; `in_turn` if no earlier than the one before."""

    low: float
    high: float
    in_turn: bool


def nearest(off: Off, windows: Sequence[Window], step: float) -> Times:
    """The moments of least distance.

    Where a point stands still, so that all moments are as near, touches are spread evenly, in the
    order that they have.

    Args:
        off: see :data:`Off`.
        windows: of the touches.
        step: between the times that are looked at first [s].

    Returns:
        (T,) times.
    """
    found = np.zeros(len(windows))
    first = 0
    for k in range(1, len(windows) + 1):
        if k == len(windows) or not windows[k].in_turn:
            found[first:k] = _chain(off, windows, range(first, k), step)
            first = k
    return found


def _chain(off: Off, windows: Sequence[Window], chain: range, step: float) -> Times:
    """(n,) times of touches that come one after another: dynamic programming."""
    times: list[Times] = []
    ways: list[Array] = []
    for k in chain:
        low, high = windows[k].low, windows[k].high
        t = np.linspace(low, high, max(9, int(np.ceil((high - low) / step)) + 1))
        middle = (k + 1) / (len(windows) + 1)
        share = np.linspace(0.0, 1.0, len(t)) - middle
        cost = np.sum(np.square(off(k, t)), axis=1) + _EVEN * np.square(share)
        if times:
            before = np.searchsorted(times[-1], t, side="right") - 1
            least = np.minimum.accumulate(ways[-1])
            cost += np.where(before >= 0, least[before], np.inf)
        times.append(t)
        ways.append(cost)
    chosen, latest = [], np.inf
    for t, cost in zip(reversed(times), reversed(ways), strict=True):
        place = int(np.argmin(np.where(t <= latest, cost, np.inf)))
        latest = t[place]
        chosen.append((latest, t[1] - t[0]))
    out, earliest = np.zeros(len(chain)), -np.inf
    for j, (k, (t, gap)) in enumerate(zip(chain, reversed(chosen), strict=True)):
        low = max(windows[k].low, earliest)
        out[j] = _refined(off, k, t, gap, low, max(low, windows[k].high))
        earliest = out[j]
    return out


def _refined(off: Off, k: int, t: float, gap: float, low: float, high: float) -> float:
    """The stationary moment near a time, or the end of low to high that is nearest."""
    a, b = max(t - gap, low), min(t + gap, high)
    if a >= b:
        t = min(max(t, low), high)
    else:
        slopes = _slope(off, k, a), _slope(off, k, b)
        if slopes[0] < 0.0 < slopes[1]:
            t = brentq(lambda time: _slope(off, k, time), a, b, xtol=1e-13)
        elif slopes[0] >= 0.0 and slopes[1] >= 0.0 and any(slopes):
            t = a
        elif slopes[0] <= 0.0 and slopes[1] <= 0.0 and any(slopes):
            t = b
        else:  # it stands still, or is farthest between
            t = min((a, min(max(t, a), b), b), key=lambda x: _square(off, k, x, t))
    return float(t)


def _square(off: Off, k: int, time: float, middle: float) -> float:
    square = float(np.sum(np.square(off(k, np.array([time])))))
    return square + _EVEN * (time - middle) ** 2


def _slope(off: Off, k: int, time: float) -> float:
    """Of half the square of the distance by time."""
    before, now, after = off(k, np.array([time - _STEP, time, time + _STEP]))
    return float(now @ (after - before))
