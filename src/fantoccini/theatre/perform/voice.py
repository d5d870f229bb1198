"""Gesture while it is played: the transition to its start, its offsets, and its repetitions.

Offsets are differences of driven coordinates from the positions that hands hold; n_vK is the number
of driven velocities.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, VecK
from fantoccini.theatre.gestures import OFFSET_TOLERANCE, Gesture, Motion, MotionSequence, piecewise

_MAX_REST_RATE = 1e-9
"""Rate below which offsets count as at rest [m/s or rad/s]."""


class Offsets(NamedTuple):
    """Offsets of the driven coordinates from the positions that hands hold.

    Attributes:
        d, rate: (n_vK,) offsets [m or rad] and their rates [m/s or rad/s].
        origin_shift: (n_vK,) part of the offsets that shifts the origin of later gestures, as
            after a walk.
    """

    d: VecK
    rate: VecK
    origin_shift: VecK

    @classmethod
    def none(cls, n: int) -> Offsets:
        """Zero offsets of n coordinates."""
        return cls(np.zeros(n), np.zeros(n), np.zeros(n))

    @property
    def is_home(self) -> bool:
        """Whether they are at rest at the origin of gestures."""
        return bool(
            np.all(np.abs(self.d - self.origin_shift) <= OFFSET_TOLERANCE) and self.is_at_rest
        )

    @property
    def is_at_rest(self) -> bool:
        """Whether they are at rest."""
        return bool(np.all(np.abs(self.rate) <= _MAX_REST_RATE))


class Voice:
    """Gesture that is being played.

    Coordinates that it does not move return to the origin of gestures with it.

    Attributes:
        gesture: gesture that is played.
        start_time: beginning of the gesture, after the transition to its start [s].
        repeat: whether to repeat it, joined by state.

    Args:
        gesture: gesture to play.
        bounds: (2, n_vK) bounds of speeds and accelerations of transitions.
        begin: beginning of the transition [s].
        offsets_before: offsets at that time.
        wanted_start: wanted beginning of the gesture, if there is time [s].
        repeat: see above.
    """

    def __init__(
        self,
        gesture: Gesture,
        bounds: Array,
        begin: float,
        offsets_before: Offsets,
        wanted_start: float | None = None,
        repeat: bool = False,
    ):
        self.gesture, self.repeat, self._bounds = gesture, repeat, bounds
        self._cached: tuple[float, Offsets] | None = None
        self._start(begin, offsets_before, wanted_start)

    def at(self, t: float) -> Offsets:
        """Offsets at a time [s], which must not be earlier than in previous calls."""
        while t >= self._end and (self.repeat or not self._final_offsets.is_at_rest):
            self._continue()
        if t >= self._end:
            return self._final_offsets
        if self._cached is None or self._cached[0] != t:  # a tick begins where one has ended
            d, rate = piecewise.evaluate(self._breaks, self._coef, t - self._begin)
            self._cached = t, Offsets(d, rate, self._origin_shift)
        return self._cached[1]

    def time(self, t: float) -> float:
        """Time within the gesture [s]."""
        return float(np.clip(t - self.start_time, 0.0, self.gesture.duration))

    def has_ended(self, t: float) -> bool:
        """Whether it has ended."""
        return t >= self._end and not self.repeat and self._final_offsets.is_at_rest

    def set_bounds(self, bounds: Array) -> None:
        """Sets the bounds of later transitions."""
        self._bounds = bounds

    def finish(self) -> None:
        """Ends with the present repetition."""
        self.repeat = False

    def _start(self, begin: float, offsets_before: Offsets, wanted_start: float | None) -> None:
        """Plays the gesture once, from offsets at a time [s]."""
        delay = (
            wanted_start - begin
            if wanted_start is not None and offsets_before.is_at_rest
            else -np.inf
        )
        motion = returning_motion(self.gesture, offsets_before)
        line, start, _ = line_from(offsets_before, self._bounds).add(motion, delay)
        self.start_time = begin + start
        self._set_line(line, begin, offsets_before)

    def _continue(self) -> None:
        """Repeats the gesture, or comes to rest."""
        if self.repeat:
            self._start(self._end, self._final_offsets, None)
            return
        self._set_line(
            line_from(self._final_offsets, self._bounds).stopped(), self._end, self._final_offsets
        )

    def _set_line(self, line: MotionSequence, begin: float, offsets_before: Offsets) -> None:
        self._origin_shift, self._cached = offsets_before.origin_shift, None
        self._begin, self._end = begin, begin + line.end
        self._breaks, self._coef = line.motion.breaks, line.motion.coef
        self._final_offsets = Offsets(line.d, line.rate, line.origin)


def line_from(offsets: Offsets, bounds: Array) -> MotionSequence:
    """Empty sequence of motions that begins with these offsets and rates."""
    return MotionSequence.empty(bounds, offsets.d, offsets.rate, offsets.origin_shift)


def returning_motion(gesture: Gesture, offsets: Offsets) -> Motion:
    """Motion of a gesture that also returns all other coordinates to the origin of gestures."""
    is_away = (np.abs(offsets.d - offsets.origin_shift) > OFFSET_TOLERANCE) | (
        np.abs(offsets.rate) > _MAX_REST_RATE
    )
    return gesture.motion._replace(named=gesture.named | is_away)


def lead_time(gesture: Gesture, offsets: Offsets, bounds: Array) -> float:
    """Duration of the transition from offsets to the start of a gesture [s]."""
    return line_from(offsets, bounds).lead_time(returning_motion(gesture, offsets))


def slowed_to_bounds(gesture: Gesture, bounds: Array) -> Gesture:
    """The gesture, slowed down to keep bounds (2, n_vK) of speeds and accelerations."""
    speed, acceleration = (float(np.max(x)) for x in gesture.peaks / bounds)
    excess = max(speed, acceleration**0.5)
    return gesture.faster(1.0 / excess) if excess > 1.0 else gesture
