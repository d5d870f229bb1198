"""Tempo: beats on the time of a performance."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from fantoccini.base import check_positive


class Range(NamedTuple):
    """Bounds of a tempo and of the taps that give it [s, 1/min]."""

    slowest: float = 30.0
    fastest: float = 240.0
    taps: int = 6  # The last ones give the tempo
    pause: float = 2.2  # After it a tap is the first again: just over a beat of the slowest


RANGE = Range()
_AT_ONCE = 1e-9
"""Time before a beat at which it is still to come [s]."""


class Tempo:
    """Beats in a minute, and when they are.

    Attributes:
        bpm: beats a minute.

    Args:
        bpm: from 30 to 240.
    """

    def __init__(self, bpm: float = 90.0):
        check_positive(bpm=bpm)
        self.bpm = float(min(max(bpm, RANGE.slowest), RANGE.fastest))
        self._origin, self._first = 0.0, 0.0  # beat number `first` is at the time `origin`
        self._taps: deque[float] = deque(maxlen=RANGE.taps)

    @property
    def beat(self) -> float:
        """Duration of a beat [s]."""
        return 60.0 / self.bpm

    def beats(self, t: float) -> float:
        """Beats until a time [s]; whole numbers are on the beat."""
        return self._first + (t - self._origin) / self.beat

    def next(self, t: float) -> float:
        """The time of the first beat from a time on [s]."""
        left = math.ceil(self.beats(t) - _AT_ONCE) - self.beats(t)
        return t + max(0.0, left) * self.beat

    def set(self, bpm: float, t: float) -> None:
        """Changes the tempo at a time; the beat goes on from there."""
        check_positive(bpm=bpm)
        self._first, self._origin = self.beats(t), t
        self.bpm = float(min(max(bpm, RANGE.slowest), RANGE.fastest))

    def tap(self, t: float, clock: float) -> None:
        """A tap at the time ``t`` of the performance is on a beat; from the second on they count.

        Args:
            t: of the performance [s].
            clock: of whoever taps [s]: intervals do not count how fast the performance is.
        """
        if self._taps and clock - self._taps[-1] > RANGE.pause:
            self._taps.clear()
        self._taps.append(clock)
        n = len(self._taps) - 1
        if n and self._taps[-1] > self._taps[0]:
            self.set(60.0 * n / (self._taps[-1] - self._taps[0]), t)
        self._first, self._origin = float(round(self.beats(t))), t
