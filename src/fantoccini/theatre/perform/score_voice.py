"""A score while it is played: it may wait for GO, pause and go to another time.

d(t) = d_score(t) + e(t),   e: a quintic to 0 that returns coordinates to the score
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


class _Transition(NamedTuple):
    """Quintic motion of some coordinates, in the voice's time [s].

    It is added to the score's motion, or replaces it.
    """

    moves: MaskRows
    replaces_score: bool
    begins: float
    duration: float
    coef: Array

    def has_ended(self, clock: float) -> bool:
        """Whether it has returned to the score."""
        return not self.replaces_score and clock >= self.begins + self.duration

    def at(self, clock: float) -> tuple[VecK, VecK]:
        """(n_vK,) offsets and rates."""
        s = min(clock - self.begins, self.duration)
        d, rate, _ = polynomial.evaluate(self.coef, np.array(s))
        return d, rate if s < self.duration else np.zeros_like(rate)


class ScoreVoice:
    """A score that is played.

    It starts and stops within 0.3 s, so that motion is continuous. A quintic within bounds leads to
    another time of the score, while its time stands still. Some coordinates may be left to the
    hands for a while.

    Attributes:
        conductor: time of the score, with its waits and GO.
        running: whether its time runs.
        now: present offsets.
        share: (2, 1) shares of the bounds of speed and acceleration for transitions.
        shift: (n_vK,) offset that is added to the score's, and its rate.

    Args:
        score: score that is played.
        motion: motion of all lanes together, without the armed ones.
        bounds: (2, n_vK) bounds of speeds and accelerations of transitions.
    """

    def __init__(self, score: Score, motion: Gesture, bounds: Array):
        self.conductor, self.running = Conductor(score), True
        self.now = Offsets.none(bounds.shape[1])
        self.share: Array = np.ones((2, 1))
        nothing = np.zeros(bounds.shape[1])
        self.shift: tuple[VecK, VecK] = nothing, nothing
        self._motion, self._bounds = motion, bounds
        self._pace, self._seek_time, self._clock = 0.0, 0.0, 0.0
        self._seek: tuple[float, Array] | None = None
        self._transitions: list[_Transition] = []
        self.seek(0.0)

    @property
    def t(self) -> float:
        """Time of the score [s]."""
        return self.conductor.t

    @property
    def is_still(self) -> bool:
        """Whether its time stands still at present."""
        return self._seek is not None or self._pace == 0.0 or self.conductor.standing

    @property
    def is_leading(self) -> bool:
        """Whether it is on the way to another time of the score."""
        return self._seek is not None

    @property
    def pace(self) -> float:
        """Rate of its time: 1 while it plays."""
        return 0.0 if self.is_still else self._pace

    def set_bounds(self, bounds: Array) -> None:
        """Sets the bounds of later transitions."""
        self._bounds = bounds

    def seek(self, to: float | str) -> None:
        """Goes to a time of the score [s], or to a mark or a wait by name.

        Raises:
            UnknownNameError: the score has no such name.
            ValueError: the time is negative.
        """
        t = self.conductor.seek(to)
        self._pace, self._seek_time = 0.0, 0.0
        self._transitions = [way for way in self._transitions if way.replaces_score]
        own = ~self._is_replaced
        there, _ = piecewise.evaluate(self._motion.breaks, self._motion.coef, t)
        self._seek, _ = transition(
            (self.now.d - self.shift[0]) * own,
            (self.now.rate - self.shift[1]) * own,
            there * own,
            np.zeros(len(there)),
            self._bounds * self.share,
        )

    def leave(self, moves: MaskRows) -> None:
        """Leaves coordinates to the hands: they stop within bounds, and the others continue."""
        nothing = np.zeros(len(moves))
        stops = np.where(moves, np.nan, 0.0)
        way, end = transition(
            self.now.d * moves, self.now.rate * moves, stops, nothing, self._bounds
        )
        coef = np.zeros((len(moves), polynomial.N_COEF))
        coef[:, 0] = end
        self._add(_Transition(moves, True, self._clock, *(way or (0.0, coef))))

    def lead_back(self, moves: MaskRows, d: VecK, rate: VecK) -> None:
        """Returns coordinates to the score's motion by a quintic.

        Args:
            moves: (n_vK,) mask of the coordinates.
            d, rate: (n_vK,) their present offsets and rates.
        """
        own_d, own_rate = self._score(0.0)
        e = (d - own_d - self.shift[0]) * moves
        e_rate = (rate - own_rate - self.shift[1]) * moves
        nothing, duration, way = np.zeros(len(moves)), 0.0, None
        for _ in range(_MAX_ITERATIONS):
            way, _ = transition(e, e_rate, nothing, nothing, self._remaining_bounds(duration))
            if way is None or way[0] <= duration:
                break
            duration = way[0]
        self._end_transitions(moves)
        if way is not None:
            self._add(_Transition(moves, False, self._clock, *way))
        self.now = self._combined(own_d, own_rate)

    def halt(self) -> None:
        """Stops all coordinates within bounds, at once; :meth:`lead_back` continues."""
        self.leave(np.ones(self._bounds.shape[1], dtype=bool))
        self.running, self._pace, self._seek = False, 0.0, None

    def advance(self, tick: float) -> None:
        """Advances by a tick [s]."""
        self._clock += tick
        self._transitions = [way for way in self._transitions if not way.has_ended(self._clock)]
        self.now = self._combined(*self._score(tick))

    # -- inside ------------------------------------------------------------------------------

    @property
    def _is_replaced(self) -> MaskRows:
        """(n_vK,) whether a coordinate is left to the hands."""
        led: MaskRows = np.zeros(self._bounds.shape[1], dtype=bool)
        for way in self._transitions:
            led |= way.moves & way.replaces_score
        return led

    def _score(self, tick: float) -> tuple[VecK, VecK]:
        """(n_vK,) offsets and rates of the score alone, after a tick."""
        if self._seek is not None:
            self._seek_time = min(self._seek_time + tick, self._seek[0])
            d, rate, _ = polynomial.evaluate(self._seek[1], np.array(self._seek_time))
            if self._seek_time >= self._seek[0]:
                self._seek, rate = None, np.zeros_like(rate)
            return d, rate
        before, wanted = self._pace, float(self.running)
        self._pace += float(np.clip(wanted - before, -tick / _RAMP_TIME, tick / _RAMP_TIME))
        t = self.conductor.advance(0.5 * (before + self._pace) * tick)
        d, rate = piecewise.evaluate(self._motion.breaks, self._motion.coef, t)
        pace = 0.0 if self.conductor.standing else self._pace
        return d, pace * rate

    def _combined(self, d: VecK, rate: VecK) -> Offsets:
        """Offsets of the score, with the transitions added to it or instead of it."""
        d, rate = d + self.shift[0], rate + self.shift[1]
        for way in self._transitions:
            own, own_rate = way.at(self._clock)
            keeps = ~(way.moves & way.replaces_score)
            d, rate = d * keeps + own * way.moves, rate * keeps + own_rate * way.moves
        return self.now._replace(d=d, rate=rate)

    def _remaining_bounds(self, duration: float) -> Array:
        """(2, n_vK) bounds of a return, reduced by the needs of the score in the meantime."""
        motion, t = self._motion, self.conductor.t
        meanwhile = (motion.breaks[1:] > t) & (motion.breaks[:-1] < t + duration)
        needed = np.max(motion.peaks_of_pieces[meanwhile], axis=0, initial=0.0)
        left = np.maximum(self._bounds - needed, _MIN_BOUND_SHARE * self._bounds)
        return np.minimum(left, self._bounds * self.share)

    def _add(self, way: _Transition) -> None:
        self._end_transitions(way.moves)
        self._transitions.append(way)

    def _end_transitions(self, moves: MaskRows) -> None:
        """Ends the transitions of some coordinates."""
        left = [way._replace(moves=way.moves & ~moves) for way in self._transitions]
        self._transitions = [way for way in left if way.moves.any()]
