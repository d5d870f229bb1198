"""A score as it is played: it may wait for GO, be paused and be set to another time.

d(t) = d_score(t) + e(t),   e: a quintic to 0 that leads back what has left the score
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, MaskRows, VecK, polynomial
from fantoccini.theatre.gestures import Conductor, Gesture, Score, at, transition
from fantoccini.theatre.perform.voice import Offsets

_RAMP = 0.3
"""Time in which a score starts and stops [s]."""
_LEAST_SHARE = 0.2
"""Share of a bound that what leads back has, where the score needs more than the rest."""
_TRIES = 4
"""Iterations of the duration of a way back, which depends on where the score then is."""


class _Way(NamedTuple):
    """A quintic of some coordinates, by the voice's clock [s]: on top of the score, or instead."""

    moves: MaskRows
    instead: bool
    begins: float
    duration: float
    coef: Array

    def over(self, clock: float) -> bool:
        """Whether it has led back to the score."""
        return not self.instead and clock >= self.begins + self.duration

    def at(self, clock: float) -> tuple[VecK, VecK]:
        """(n_vK,) offsets and rates."""
        s = min(clock - self.begins, self.duration)
        d, rate, _ = polynomial.evaluate(self.coef, np.array(s))
        return d, rate if s < self.duration else np.zeros_like(rate)


class ScoreVoice:
    """A score that is played.

    It starts and stops within 0.3 s, so that nothing jumps. To another time of the score leads a
    quintic within bounds, while its time stands still. Some coordinates may be left to the hands
    for a while.

    Attributes:
        conductor: where in the score it is; waits and GO.
        running: whether it goes on.
        now: the offsets.
        share: (2, 1) of the bounds of speed and acceleration, for what leads over.
        shift: (n_vK,) and its rate: added to what the score moves.

    Args:
        score: what is played.
        motion: its lanes together, without those that are armed.
        most: (2, n_vK) bounds of speeds and accelerations of what leads over.
    """

    def __init__(self, score: Score, motion: Gesture, most: Array):
        self.conductor, self.running = Conductor(score), True
        self.now = Offsets.none(most.shape[1])
        self.share: Array = np.ones((2, 1))
        nothing = np.zeros(most.shape[1])
        self.shift: tuple[VecK, VecK] = nothing, nothing
        self._motion, self._most = motion, most
        self._pace, self._led, self._clock = 0.0, 0.0, 0.0
        self._lead: tuple[float, Array] | None = None
        self._ways: list[_Way] = []
        self.seek(0.0)

    @property
    def t(self) -> float:
        """Time of the score [s]."""
        return self.conductor.t

    @property
    def still(self) -> bool:
        """Whether its time stands still now."""
        return self._lead is not None or self._pace == 0.0 or self.conductor.standing

    @property
    def leading(self) -> bool:
        """Whether a way to another time of the score is under way."""
        return self._lead is not None

    @property
    def pace(self) -> float:
        """Rate of its time: 1 while it plays."""
        return 0.0 if self.still else self._pace

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
        self._ways = [way for way in self._ways if way.instead]
        own = ~self._instead
        there, _ = at(self._motion.breaks, self._motion.coef, t)
        self._lead, _ = transition(
            (self.now.d - self.shift[0]) * own,
            (self.now.rate - self.shift[1]) * own,
            there * own,
            np.zeros(len(there)),
            self._most * self.share,
        )

    def leave(self, moves: MaskRows) -> None:
        """Leaves coordinates to the hands: they stop within bounds, and the others go on."""
        nothing = np.zeros(len(moves))
        stops = np.where(moves, np.nan, 0.0)
        way, end = transition(self.now.d * moves, self.now.rate * moves, stops, nothing, self._most)
        coef = np.zeros((len(moves), polynomial.N_COEF))
        coef[:, 0] = end
        self._add(_Way(moves, True, self._clock, *(way or (0.0, coef))))

    def lead_back(self, moves: MaskRows, d: VecK, rate: VecK) -> None:
        """Lets coordinates do what the score does from now on; a quintic leads them there.

        Args:
            moves: (n_vK,) which.
            d, rate: (n_vK,) where they are, and how fast.
        """
        own_d, own_rate = self._score(0.0)
        e = (d - own_d - self.shift[0]) * moves
        e_rate = (rate - own_rate - self.shift[1]) * moves
        nothing, duration, way = np.zeros(len(moves)), 0.0, None
        for _ in range(_TRIES):
            way, _ = transition(e, e_rate, nothing, nothing, self._left(duration))
            if way is None or way[0] <= duration:
                break
            duration = way[0]
        self._drop(moves)
        if way is not None:
            self._add(_Way(moves, False, self._clock, *way))
        self.now = self._whole(own_d, own_rate)

    def halt(self) -> None:
        """Stops everything within bounds, at once; :meth:`lead_back` goes on."""
        self.leave(np.ones(self._most.shape[1], dtype=bool))
        self.running, self._pace, self._lead = False, 0.0, None

    def advance(self, tick: float) -> None:
        """Goes on by a tick [s]."""
        self._clock += tick
        self._ways = [way for way in self._ways if not way.over(self._clock)]
        self.now = self._whole(*self._score(tick))

    # -- inside ------------------------------------------------------------------------------

    @property
    def _instead(self) -> MaskRows:
        """(n_vK,) which coordinates are left to the hands."""
        led: MaskRows = np.zeros(self._most.shape[1], dtype=bool)
        for way in self._ways:
            led |= way.moves & way.instead
        return led

    def _score(self, tick: float) -> tuple[VecK, VecK]:
        """(n_vK,) offsets and rates of the score alone, after a tick."""
        if self._lead is not None:
            self._led = min(self._led + tick, self._lead[0])
            d, rate, _ = polynomial.evaluate(self._lead[1], np.array(self._led))
            if self._led >= self._lead[0]:
                self._lead, rate = None, np.zeros_like(rate)
            return d, rate
        before, wanted = self._pace, float(self.running)
        self._pace += float(np.clip(wanted - before, -tick / _RAMP, tick / _RAMP))
        t = self.conductor.advance(0.5 * (before + self._pace) * tick)
        d, rate = at(self._motion.breaks, self._motion.coef, t)
        pace = 0.0 if self.conductor.standing else self._pace
        return d, pace * rate

    def _whole(self, d: VecK, rate: VecK) -> Offsets:
        """The score's offsets with the ways on top of it, or instead."""
        d, rate = d + self.shift[0], rate + self.shift[1]
        for way in self._ways:
            own, own_rate = way.at(self._clock)
            keeps = ~(way.moves & way.instead)
            d, rate = d * keeps + own * way.moves, rate * keeps + own_rate * way.moves
        return self.now._replace(d=d, rate=rate)

    def _left(self, duration: float) -> Array:
        """(2, n_vK) bounds of what leads back, beside what the score needs for a while."""
        motion, t = self._motion, self.conductor.t
        meanwhile = (motion.breaks[1:] > t) & (motion.breaks[:-1] < t + duration)
        needed = np.max(motion.peaks_of_pieces[meanwhile], axis=0, initial=0.0)
        left = np.maximum(self._most - needed, _LEAST_SHARE * self._most)
        return np.minimum(left, self._most * self.share)

    def _add(self, way: _Way) -> None:
        self._drop(way.moves)
        self._ways.append(way)

    def _drop(self, moves: MaskRows) -> None:
        """No way moves these any more."""
        left = [way._replace(moves=way.moves & ~moves) for way in self._ways]
        self._ways = [way for way in left if way.moves.any()]
