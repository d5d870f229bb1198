"""A score as it is played: it may wait for GO, be paused and be set to another time."""

from __future__ import annotations

import numpy as np

from fantoccini.arrays import Array
from fantoccini.gestures import Conductor, Gesture, Score
from fantoccini.gestures.piecewise import at
from fantoccini.gestures.transition import transition
from fantoccini.motion import polynomial
from fantoccini.perform.voice import Offsets

_RAMP = 0.3
"""Time in which a score starts and stops [s]."""


class ScoreVoice:
    """A score that is played.

    It starts and stops within 0.3 s, so that nothing jumps. To another time of the score leads a
    quintic within bounds, while its time stands still.

    Attributes:
        conductor: where in the score it is; waits and GO.
        running: whether it goes on.
        now: the offsets.

    Args:
        score: what is played.
        motion: its lanes together, without those that are armed.
        most: (2, n_vK) bounds of speeds and accelerations of what leads over.
    """

    def __init__(self, score: Score, motion: Gesture, most: Array):
        self.conductor, self.running = Conductor(score), True
        self.now = Offsets.none(most.shape[1])
        self._motion, self._most = motion, most
        self._pace, self._led = 0.0, 0.0
        self._lead: tuple[float, Array] | None = None
        self.seek(0.0)

    @property
    def t(self) -> float:
        """Time of the score [s]."""
        return self.conductor.t

    @property
    def still(self) -> bool:
        """Whether its time stands still now."""
        return self._lead is not None or self._pace == 0.0 or self.conductor.standing

    def bound(self, most: Array) -> None:
        """Sets the bounds of what leads over from now on."""
        self._most = most

    def seek(self, to: float | str) -> None:
        """Goes to a time of the score [s], or to a mark or a wait by its name.

        Raises:
            UnknownNameError: a name that the score has not.
            ValueError: a negative time.
        """
        t = self.conductor.seek(to)
        self._pace, self._led = 0.0, 0.0
        there, _ = at(self._motion.breaks, self._motion.coef, t)
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
        t = self.conductor.advance(0.5 * (before + self._pace) * tick)
        d, rate = at(self._motion.breaks, self._motion.coef, t)
        pace = 0.0 if self.conductor.standing else self._pace
        self.now = self.now._replace(d=d, rate=pace * rate)
