"""Tempo of a performance, set in beats per minute or by taps.

A tap is a press of a key on the beat.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from fantoccini.base import check_positive


class TempoRange(NamedTuple):
    """Bounds of a tempo, and rules for taps."""

    slowest: float = 30.0  # Beats in a minute
    fastest: float = 240.0
    n_taps: int = 6  # Number of last taps that determine the tempo
    max_tap_interval: float = 2.2  # [s], just over a beat of the slowest tempo


TEMPO_RANGE = TempoRange()
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
        self.bpm = float(min(max(bpm, TEMPO_RANGE.slowest), TEMPO_RANGE.fastest))
        # The beat with number `reference_beat` is at the time `reference_time`.
        self._reference_time, self._reference_beat = 0.0, 0.0
        self._taps: deque[float] = deque(maxlen=TEMPO_RANGE.n_taps)

    @property
    def beat(self) -> float:
        """Duration of a beat [s]."""
        return 60.0 / self.bpm

    def beat_number(self, t: float) -> float:
        """Number of beats up to a time [s]; a whole number on the beat."""
        return self._reference_beat + (t - self._reference_time) / self.beat

    def next_beat_time(self, t: float) -> float:
        """Time of the first beat at or after a time [s]."""
        remaining = math.ceil(self.beat_number(t) - _BEAT_TOLERANCE) - self.beat_number(t)
        return t + max(0.0, remaining) * self.beat

    def set(self, bpm: float, t: float) -> None:
        """Changes the tempo at a time [s]; the count of beats is continuous."""
        check_positive(bpm=bpm)
        self._reference_beat, self._reference_time = self.beat_number(t), t
        self.bpm = float(min(max(bpm, TEMPO_RANGE.slowest), TEMPO_RANGE.fastest))

    def tap(self, t: float, clock: float) -> None:
        """Sets a beat at a tap; from the second tap on, intervals determine the tempo.

        Args:
            t: time of the performance [s].
            clock: time of the person who taps [s], independent of the performance's speed.
        """
        if self._taps and clock - self._taps[-1] > TEMPO_RANGE.max_tap_interval:
            self._taps.clear()
        self._taps.append(clock)
        n_intervals = len(self._taps) - 1
        if n_intervals and self._taps[-1] > self._taps[0]:
            self.set(60.0 * n_intervals / (self._taps[-1] - self._taps[0]), t)
        self._reference_beat, self._reference_time = float(round(self.beat_number(t))), t
