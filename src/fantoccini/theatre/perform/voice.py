"""A gesture while it is played: the way to its start, its offsets, and its repetitions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, VecK
from fantoccini.theatre.gestures import SAME, Gesture, Line, Motion, at

_MAX_REST_RATE = 1e-9
"""Rate below which offsets count as at rest [m/s or rad/s]."""


class Offsets(NamedTuple):
    """Offsets of the driven coordinates from the positions that hands hold.

    Attributes:
        d, rate: (n_vK,) offsets and their rates [m or rad, per s].
        carried: (n_vK,) part that shifts the origin of later gestures, as after a walk.
    """

    d: VecK
    rate: VecK
    carried: VecK

    @classmethod
    def none(cls, n: int) -> Offsets:
        """Zero offsets of n coordinates."""
        return cls(np.zeros(n), np.zeros(n), np.zeros(n))

    @property
    def home(self) -> bool:
        """Whether they are at rest at the origin of gestures."""
        return bool(np.all(np.abs(self.d - self.carried) <= SAME) and self.still)

    @property
    def still(self) -> bool:
        """Whether they are at rest."""
        return bool(np.all(np.abs(self.rate) <= _MAX_REST_RATE))


class Voice:
    """A gesture that is played from a time on.

    Coordinates that it does not name and that are away from home return there with it.

    Attributes:
        gesture: gesture that is played.
        starts: beginning of the gesture, after the way to its start [s].
        repeat: whether to repeat it, joined by state.

    Args:
        gesture: gesture to play.
        most: (2, n_vK) bounds of speeds and accelerations of transitions.
        begins: beginning of the way to its start [s].
        before: offsets at that time.
        on: wanted beginning of the gesture, if there is time [s].
        repeat: see above.
    """

    def __init__(
        self,
        gesture: Gesture,
        most: Array,
        begins: float,
        before: Offsets,
        on: float | None = None,
        repeat: bool = False,
    ):
        self.gesture, self.repeat, self._most = gesture, repeat, most
        self._known: tuple[float, Offsets] | None = None
        self._go(begins, before, on)

    def at(self, t: float) -> Offsets:
        """Offsets at a time [s], which must not be earlier than in previous calls."""
        while t >= self._end and (self.repeat or not self._last.still):
            self._go_on()
        if t >= self._end:
            return self._last
        if self._known is None or self._known[0] != t:  # a tick begins where one has ended
            d, rate = at(self._breaks, self._coef, t - self._begins)
            self._known = t, Offsets(d, rate, self._carried)
        return self._known[1]

    def time(self, t: float) -> float:
        """Time within the gesture [s]."""
        return float(np.clip(t - self.starts, 0.0, self.gesture.duration))

    def over(self, t: float) -> bool:
        """Whether it has ended."""
        return t >= self._end and not self.repeat and self._last.still

    def bound(self, most: Array) -> None:
        """Sets the bounds of later transitions."""
        self._most = most

    def finish(self) -> None:
        """Ends with the present round."""
        self.repeat = False

    def _go(self, begins: float, before: Offsets, on: float | None) -> None:
        gesture, line = self.gesture, line_from(before, self._most)
        motion = named_with(gesture, before)
        begin = on - begins if on is not None and before.still else -np.inf
        line, begun, _ = line.add(motion, begin)
        self.starts = begins + begun
        self._take(line, begins, before)

    def _go_on(self) -> None:
        if self.repeat:
            self._go(self._end, self._last, None)
            return
        self._take(line_from(self._last, self._most).stopped(), self._end, self._last)

    def _take(self, line: Line, begins: float, before: Offsets) -> None:
        self._carried, self._known = before.carried, None
        self._begins, self._end = begins, begins + line.end
        self._breaks, self._coef = line.motion.breaks, line.motion.coef
        self._last = Offsets(line.d, line.rate, line.carried)


def line_from(before: Offsets, most: Array) -> Line:
    """A line that continues from offsets."""
    return Line.empty(most, before.d, before.rate, before.carried)


def named_with(gesture: Gesture, before: Offsets) -> Motion:
    """Motion of the gesture that also returns other coordinates home."""
    away = (np.abs(before.d - before.carried) > SAME) | (np.abs(before.rate) > _MAX_REST_RATE)
    return gesture.motion._replace(named=gesture.named | away)


def lead_time(gesture: Gesture, before: Offsets, most: Array) -> float:
    """Duration of the way from offsets to the start of a gesture [s]."""
    return line_from(before, most).lead_time(named_with(gesture, before))


def fitted(gesture: Gesture, most: Array) -> Gesture:
    """The gesture, slowed down to keep bounds (2, n_vK) of speeds and accelerations."""
    speed, acceleration = (float(np.max(x)) for x in gesture.peaks / most)
    over = max(speed, acceleration**0.5)
    return gesture.faster(1.0 / over) if over > 1.0 else gesture
