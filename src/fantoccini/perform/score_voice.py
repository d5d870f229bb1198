"""A score as it is played: by a clock that may wait, pause and be set."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from fantoccini.arrays import Array
from fantoccini.gestures import Gesture
from fantoccini.gestures.piecewise import at
from fantoccini.gestures.transition import transition
from fantoccini.motion import polynomial
from fantoccini.perform.voice import Offsets

_RAMP = 0.3
"""Time in which a score starts and stops [s]."""


class Clock(Protocol):
    """Where in a score it is."""

    def advance(self, dt: float) -> float:
        """Goes on by a time [s]; returns the time of the score [s]."""

    def seek(self, t: float) -> object:
        """Goes to a time of the score [s]."""


class OwnTime:
    """A clock that runs.

    Attributes:
        t: [s].
        end: where it stops [s].
    """

    def __init__(self, end: float):
        self.t, self.end = 0.0, end

    def advance(self, dt: float) -> float:
        """Goes on."""
        self.t = min(self.t + dt, self.end)
        return self.t

    def seek(self, t: float) -> None:
        """Goes to a time."""
        self.t = float(np.clip(t, 0.0, self.end))


class ScoreVoice:
    """A score that is played.

    It starts and stops within 0.3 s, so that nothing jumps. To another time of the score leads a
    quintic within bounds, while the clock stands.

    Attributes:
        gesture: all lanes of the score together.
        clock: where in the score it is.
        running: whether it goes on.
        t: time of the score [s].
        now: the offsets.

    Args:
        gesture, clock: see above.
        most: (2, n_vK) bounds of speeds and accelerations of what leads over.
    """

    def __init__(self, gesture: Gesture, clock: Clock | None, most: Array):
        self.gesture, self._most = gesture, most
        self.clock: Clock = OwnTime(gesture.duration) if clock is None else clock
        self.running, self.t, self._pace = True, 0.0, 0.0
        self.now = Offsets.none(most.shape[1])
        self._lead: tuple[float, Array] | None = None
        self._led = 0.0
        self.seek(0.0)

    def seek(self, t: float) -> None:
        """Goes to a time of the score [s]."""
        t = float(np.clip(t, 0.0, self.gesture.duration))
        self.clock.seek(t)
        self.t, self._pace, self._led = t, 0.0, 0.0
        there, _ = at(self.gesture.breaks, self.gesture.coef, t)
        self._lead, _ = transition(
            self.now.d, self.now.rate, there, np.zeros(len(there)), self._most
        )

    def advance(self, tick: float) -> None:
        """Goes on by a tick [s]."""
        if self._lead is not None:
            self._led = min(self._led + tick, self._lead[0])
            d, rate, _ = polynomial.evaluate(self._lead[1], np.array(self._led))
            if self._led >= self._lead[0]:
                self._lead, rate = None, np.zeros_like(rate)
            self.now = self.now._replace(d=d, rate=rate)
            return
        before, wanted = self._pace, float(self.running)
        self._pace += float(np.clip(wanted - before, -tick / _RAMP, tick / _RAMP))
        gone = 0.5 * (before + self._pace) * tick
        t = min(self.clock.advance(gone), self.gesture.duration)
        waits = t - self.t < 0.5 * gone  # the clock stands, or is at the end
        self.t = t
        d, rate = at(self.gesture.breaks, self.gesture.coef, t)
        self.now = self.now._replace(d=d, rate=0.0 * rate if waits else self._pace * rate)
