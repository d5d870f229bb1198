"""A score while it is played: it may wait for GO, pause and go to another time.

d(t) = d_score(t) + e(t),   e: a quintic to 0 that returns coordinates to the score

d are offsets of the driven coordinates, which the hands move; n_vK is the number of driven
velocities. A voice is a score or gesture while it is played. Breaks are the times at which the
pieces of a motion meet, and `coef` their coefficients. A tick is the interval at which a
performance advances.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, MaskRows, VecK, polynomial
from fantoccini.theatre.gestures import Conductor, Gesture, Score, piecewise, transition
from fantoccini.theatre.perform.voice import Offsets

_RAMP_TIME = 0.3
"""Time over which a score starts and stops [s]."""
_MIN_BOUND_SHARE = 0.2
"""Least share of a bound for a return to the score, even if the score needs more than the rest."""
_MAX_ITERATIONS = 4
"""Iterations for the duration of a return, which depends on the score at its end."""


class _Blend(NamedTuple):
    """Quintic motion of some coordinates, in the voice's time [s].

    It is added to the score's motion, or replaces it.
    """

    mask: MaskRows
    replaces_score: bool
    start_time: float
    duration: float
    coef: Array

    def has_ended(self, clock: float) -> bool:
        """Whether it has returned to the score."""
        return not self.replaces_score and clock >= self.start_time + self.duration

    def at(self, clock: float) -> tuple[VecK, VecK]:
        """(n_vK,) offsets and rates."""
        elapsed = min(clock - self.start_time, self.duration)
        d, rate, _ = polynomial.evaluate(self.coef, np.array(elapsed))
        return d, rate if elapsed < self.duration else np.zeros_like(rate)


class ScoreVoice:
    """A score that is played.

    It starts and stops within 0.3 s, so that motion is continuous. A quintic within bounds leads to
    another time of the score, while its time stands still. Some coordinates may be left to the
    hands for a while.

    Attributes:
        conductor: time of the score, with its waits and GO.
        running: whether its time runs.
        offsets: present offsets.
        bound_shares: (2, 1) shares of the bounds of speed and acceleration for transitions.
        shift: (n_vK,) offset that is added to the score's, and its rate.

    Args:
        score: score that is played.
        motion: motion of all lanes together, without the armed ones.
        bounds: (2, n_vK) bounds of speeds and accelerations of transitions.
    """

    def __init__(self, score: Score, motion: Gesture, bounds: Array):
        self.conductor, self.running = Conductor(score), True
        self.offsets = Offsets.none(bounds.shape[1])
        self.bound_shares: Array = np.ones((2, 1))
        zeros = np.zeros(bounds.shape[1])
        self.shift: tuple[VecK, VecK] = zeros, zeros
        self._motion, self._bounds = motion, bounds
        self._pace, self._seek_time, self._clock = 0.0, 0.0, 0.0
        self._seek_motion: tuple[float, Array] | None = None
        self._blends: list[_Blend] = []
        self.seek(0.0)

    @property
    def t(self) -> float:
        """Time of the score [s]."""
        return self.conductor.t

    @property
    def is_still(self) -> bool:
        """Whether its time stands still at present."""
        return self._seek_motion is not None or self._pace == 0.0 or self.conductor.standing

    @property
    def is_leading(self) -> bool:
        """Whether it is on the way to another time of the score."""
        return self._seek_motion is not None

    @property
    def pace(self) -> float:
        """Rate of its time: 1 while it plays."""
        return 0.0 if self.is_still else self._pace

    def set_bounds(self, bounds: Array) -> None:
        """Sets the bounds of later transitions."""
        self._bounds = bounds

    def seek(self, target: float | str) -> None:
        """Goes to a time of the score [s], or to a mark or a wait by name.

        Raises:
            UnknownNameError: the score has no such name.
            ValueError: the time is negative.
        """
        t = self.conductor.seek(target)
        self._pace, self._seek_time = 0.0, 0.0
        self._blends = [blend for blend in self._blends if blend.replaces_score]
        follows_score = ~self._is_replaced
        score_offsets, _ = piecewise.evaluate(self._motion.breaks, self._motion.coef, t)
        self._seek_motion, _ = transition(
            (self.offsets.d - self.shift[0]) * follows_score,
            (self.offsets.rate - self.shift[1]) * follows_score,
            score_offsets * follows_score,
            np.zeros(len(score_offsets)),
            self._bounds * self.bound_shares,
        )

    def leave(self, mask: MaskRows) -> None:
        """Leaves coordinates to the hands: they stop within bounds, and the others continue."""
        zeros = np.zeros(len(mask))
        target = np.where(mask, np.nan, 0.0)
        motion, final_offsets = transition(
            self.offsets.d * mask, self.offsets.rate * mask, target, zeros, self._bounds
        )
        coef = np.zeros((len(mask), polynomial.N_COEF))
        coef[:, 0] = final_offsets
        self._add_blend(_Blend(mask, True, self._clock, *(motion or (0.0, coef))))

    def lead_back(self, mask: MaskRows, d: VecK, rate: VecK) -> None:
        """Returns coordinates to the score's motion by a quintic.

        Args:
            mask: (n_vK,) mask of the coordinates.
            d, rate: (n_vK,) their present offsets and rates.
        """
        score_d, score_rate = self._advance_score(0.0)
        deviation = (d - score_d - self.shift[0]) * mask
        deviation_rate = (rate - score_rate - self.shift[1]) * mask
        zeros, duration, motion = np.zeros(len(mask)), 0.0, None
        for _ in range(_MAX_ITERATIONS):
            motion, _ = transition(
                deviation, deviation_rate, zeros, zeros, self._remaining_bounds(duration)
            )
            if motion is None or motion[0] <= duration:
                break
            duration = motion[0]
        self._end_blends(mask)
        if motion is not None:
            self._add_blend(_Blend(mask, False, self._clock, *motion))
        self.offsets = self._combined(score_d, score_rate)

    def halt(self) -> None:
        """Stops all coordinates within bounds, at once; :meth:`lead_back` continues."""
        self.leave(np.ones(self._bounds.shape[1], dtype=bool))
        self.running, self._pace, self._seek_motion = False, 0.0, None

    def advance(self, tick: float) -> None:
        """Advances by a tick [s]."""
        self._clock += tick
        self._blends = [blend for blend in self._blends if not blend.has_ended(self._clock)]
        self.offsets = self._combined(*self._advance_score(tick))

    # -- inside ------------------------------------------------------------------------------

    @property
    def _is_replaced(self) -> MaskRows:
        """(n_vK,) whether a coordinate is left to the hands."""
        is_replaced: MaskRows = np.zeros(self._bounds.shape[1], dtype=bool)
        for blend in self._blends:
            is_replaced |= blend.mask & blend.replaces_score
        return is_replaced

    def _advance_score(self, tick: float) -> tuple[VecK, VecK]:
        """(n_vK,) offsets and rates of the score alone, after a tick."""
        if self._seek_motion is not None:
            self._seek_time = min(self._seek_time + tick, self._seek_motion[0])
            d, rate, _ = polynomial.evaluate(self._seek_motion[1], np.array(self._seek_time))
            if self._seek_time >= self._seek_motion[0]:
                self._seek_motion, rate = None, np.zeros_like(rate)
            return d, rate
        old_pace, target_pace = self._pace, float(self.running)
        self._pace += float(np.clip(target_pace - old_pace, -tick / _RAMP_TIME, tick / _RAMP_TIME))
        t = self.conductor.advance(0.5 * (old_pace + self._pace) * tick)
        d, rate = piecewise.evaluate(self._motion.breaks, self._motion.coef, t)
        pace = 0.0 if self.conductor.standing else self._pace
        return d, pace * rate

    def _combined(self, d: VecK, rate: VecK) -> Offsets:
        """Offsets of the score, with the transitions added to it or instead of it."""
        d, rate = d + self.shift[0], rate + self.shift[1]
        for blend in self._blends:
            blend_d, blend_rate = blend.at(self._clock)
            keeps_score = ~(blend.mask & blend.replaces_score)
            d, rate = (
                d * keeps_score + blend_d * blend.mask,
                rate * keeps_score + blend_rate * blend.mask,
            )
        return self.offsets._replace(d=d, rate=rate)

    def _remaining_bounds(self, duration: float) -> Array:
        """(2, n_vK) bounds of a return, reduced by the needs of the score in the meantime."""
        motion, t = self._motion, self.conductor.t
        is_meanwhile = (motion.breaks[1:] > t) & (motion.breaks[:-1] < t + duration)
        needed = np.max(motion.peaks_of_pieces[is_meanwhile], axis=0, initial=0.0)
        remaining = np.maximum(self._bounds - needed, _MIN_BOUND_SHARE * self._bounds)
        return np.minimum(remaining, self._bounds * self.bound_shares)

    def _add_blend(self, blend: _Blend) -> None:
        self._end_blends(blend.mask)
        self._blends.append(blend)

    def _end_blends(self, mask: MaskRows) -> None:
        """Ends the transitions of some coordinates."""
        remaining = [blend._replace(mask=blend.mask & ~mask) for blend in self._blends]
        self._blends = [blend for blend in remaining if blend.mask.any()]
