"""Tempo of a performance, set in beats per minute or by taps."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from fantoccini.base import check_positive


class Range(NamedTuple):
    """Bounds of a tempo, and rules for taps."""

    slowest: float = 30.0  # Beats in a minute
    fastest: float = 240.0
    taps: int = 6  # Number of last taps that determine the tempo
    pause: float = 2.2  # Longest interval of taps [s]: just over a beat of the slowest tempo


RANGE = Range()
_BEAT_TOLERANCE = 1e-9
"""Tolerance within which a time counts as on a beat [beats]."""


class Tempo:
    """Tempo of a performance, and the times of its beats.

    Attributes:
        bpm: beats in a minute.

    Args:
        bpm: beats in a minute, from 30 to 240.
    """

    def __init__(self, bpm: float = 90.0):
        check_positive(bpm=bpm)
        self.bpm = float(min(max(bpm, RANGE.slowest), RANGE.fastest))
        # The beat with number `reference_beat` is at the time `reference_time`.
        self._reference_time, self._reference_beat = 0.0, 0.0
        self._taps: deque[float] = deque(maxlen=RANGE.taps)

    @property
    def beat(self) -> float:
        """Duration of a beat [s]."""
        return 60.0 / self.bpm

    def beats(self, t: float) -> float:
        """Number of beats up to a time [s]; a whole number on the beat."""
        return self._reference_beat + (t - self._reference_time) / self.beat

    def next(self, t: float) -> float:
        """Time of the first beat at or after a time [s]."""
        remaining = math.ceil(self.beats(t) - _BEAT_TOLERANCE) - self.beats(t)
        return t + max(0.0, remaining) * self.beat

    def set(self, bpm: float, t: float) -> None:
        """Changes the tempo at a time [s]; the count of beats is continuous."""
        check_positive(bpm=bpm)
        self._reference_beat, self._reference_time = self.beats(t), t
        self.bpm = float(min(max(bpm, RANGE.slowest), RANGE.fastest))

    def tap(self, t: float, clock: float) -> None:
        """Sets a beat at a tap; from the second tap on, intervals determine the tempo.

        Args:
            t: time of the performance [s].
            clock: time of the person who taps [s], independent of the performance's speed.
        """
        if self._taps and clock - self._taps[-1] > RANGE.pause:
            self._taps.clear()
        self._taps.append(clock)
        n = len(self._taps) - 1
        if n and self._taps[-1] > self._taps[0]:
            self.set(60.0 * n / (self._taps[-1] - self._taps[0]), t)
        self._reference_beat, self._reference_time = float(round(self.beats(t))), t
