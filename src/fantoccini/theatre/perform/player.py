"""Player that adds gestures, a take and a score to the positions that hands hold.

q_K(t) = q_K,held(t) + d(t),   d(t): sum of the gestures, the take and the score
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, VecK
from fantoccini.dynamics.marionette import Marionette
from fantoccini.theatre.gestures import Gesture, Score
from fantoccini.theatre.perform.score_voice import ScoreVoice
from fantoccini.theatre.perform.voice import Offsets, Voice, fitted, lead_time

_TOLERANCE = 1e-9
"""Tolerance of offsets and rates at rest [m or rad, per s]."""


class Steps(NamedTuple):
    """Offsets and rates (n_vK,) at the two ends of a tick."""

    d: VecK
    rate: VecK
    d_next: VecK
    rate_next: VecK


class _Waiting(NamedTuple):
    """Gesture that waits for its time ``on`` [s]."""

    gesture: Gesture
    on: float
    repeat: bool


class Player:
    """Player of gestures, takes and scores, tick by tick.

    Gestures are added. A gesture replaces another one if it moves all coordinates of that, or if
    both end away from home, as kneeling and sitting do; it then begins with the position and
    velocity of the other.

    Attributes:
        t: time since the player was created [s].
        take: take that is played, or None.
        score: score that is played or paused, or None.

    Args:
        bounds: (2, n_vK) bounds of speeds and accelerations.
        tick: duration of a tick [s].
    """

    def __init__(self, bounds: Array, tick: float):
        self.t = 0.0
        self._bounds, self._tick = bounds, tick
        self._voices: list[Voice] = []
        self._waiting: list[_Waiting] = []
        self.take: Voice | None = None
        self.score: ScoreVoice | None = None

    @property
    def is_idle(self) -> bool:
        """Whether nothing is played."""
        return not (self._voices or self._waiting or self.take or self.score)

    @property
    def is_away(self) -> bool:
        """Whether gestures are played, wait, or have ended away from home."""
        return bool(self._voices or self._waiting)

    @property
    def playing(self) -> tuple[str, ...]:
        """Names of the gestures that move or wait."""
        moving = [voice.gesture.name for voice in self._voices if not voice.has_ended(self.t)]
        return tuple(dict.fromkeys(moving + [entry.gesture.name for entry in self._waiting]))

    @property
    def take_time(self) -> float | None:
        """Time within the take [s]; None without one."""
        return None if self.take is None else self.take.time(self.t)

    def transferred(
        self, before: Marionette, after: Marionette
    ) -> tuple[Player | None, tuple[str, ...]]:
        """The player, or None if it cannot continue with a changed puppet; and messages."""
        old, new = before.coordinates, after.coordinates
        if (old.q_K, old.v_K) == (new.q_K, new.v_K):
            return self, ()
        parts = {"the gestures": self.is_away, "the take": self.take, "the score": self.score}
        return None, tuple(f"{name} ended" for name, part in parts.items() if part)

    def set_bounds(self, bounds: Array) -> None:
        """Sets the bounds of later transitions."""
        self._bounds = bounds
        for voice in self._all():
            voice.set_bounds(bounds)
        if self.score is not None:
            self.score.set_bounds(bounds)

    def offsets(self) -> Offsets:
        """Present sum of all offsets."""
        return self._sum(self.t, self._all(), self.score)

    def play(self, gesture: Gesture, *, on: float | None = None, repeat: bool = False) -> float:
        """Plays a gesture; returns its beginning, in terms of ``t`` [s].

        Args:
            gesture: gesture; it is slowed down if it would exceed the bounds.
            on: wanted beginning; as soon as possible by default. It begins later if the transition
                to its start takes longer.
            repeat: whether to repeat it, until :meth:`finish`.
        """
        gesture = fitted(gesture, self._bounds)
        self._waiting = [w for w in self._waiting if w.gesture.name != gesture.name]
        earliest = self.t + lead_time(gesture, self._before(gesture), self._bounds)
        if on is None or on <= earliest + self._tick:
            self._start(gesture, on, repeat)
        else:
            self._waiting.append(_Waiting(gesture, on, repeat))
        return earliest if on is None else max(on, earliest)

    def finish(self, name: str) -> None:
        """Ends a gesture after its present repetition."""
        self._waiting = [w for w in self._waiting if w.gesture.name != name]
        for voice in self._voices:
            if voice.gesture.name == name:
                voice.finish()

    def play_take(self, motion: Gesture, v_K: VecK, repeat: bool = False) -> None:
        """Plays a take from now on; the hands have the velocities of its start.

        Args:
            motion: motion of the take, without the coordinates that it does not move.
            v_K: (n_vK,) rates at its beginning.
            repeat: whether to repeat it, joined by state.
        """
        n = len(v_K)
        before = Offsets(np.zeros(n), np.where(motion.named, v_K, 0.0), np.zeros(n))
        self.take = Voice(motion, self._bounds, self.t, before, repeat=repeat)

    def stop_take(self) -> VecK:
        """Ends the take; returns its (n_vK,) offsets, for the hands to hold."""
        offset = self._sum(self.t, [] if self.take is None else [self.take]).d
        self.take = None
        return offset

    def play_score(self, score: Score, motion: Gesture) -> ScoreVoice:
        """Plays a score from its start; ``motion`` is its motion. A former score returns home."""
        self.stop_score()
        self.score = ScoreVoice(score, motion, self._bounds)
        return self.score

    def stop_score(self) -> None:
        """Ends the score; its coordinates return home."""
        if self.score is not None:
            home = Gesture.rest(self.score.conductor.score.gesture.coordinates, self._tick)
            self._voices.append(Voice(home, self._bounds, self.t, self.score.now))
            self.score = None

    def clear(self) -> VecK:
        """Ends all motion; returns its (n_vK,) offsets, for the hands to hold."""
        offset = self.offsets().d
        self._voices, self._waiting, self.take, self.score = [], [], None, None
        return offset

    def step(self) -> Steps:
        """Advances by a tick."""
        for entry in list(self._waiting):
            before = self._before(entry.gesture)
            if entry.on - lead_time(entry.gesture, before, self._bounds) <= self.t + self._tick:
                self._waiting.remove(entry)
                self._start(entry.gesture, entry.on, entry.repeat)
        before = self.offsets()
        self.t += self._tick
        if self.score is not None:
            self.score.advance(self._tick)
        after = self.offsets()
        return Steps(before.d, before.rate, after.d, after.rate)

    def settle(self) -> VecK:
        """Removes motions that have ended at home; returns the (n_vK,) displacement of home."""
        moved = np.zeros(self._bounds.shape[1])
        for voice in list(self._voices):
            last = voice.at(self.t)
            if voice.has_ended(self.t) and last.is_home:
                moved += last.carried
                self._voices.remove(voice)
        if self.take is not None and self.take.has_ended(self.t):
            moved += self.stop_take()
        return moved

    # -- internal ----------------------------------------------------------------------------

    def _start(self, gesture: Gesture, on: float | None, repeat: bool) -> None:
        before, replaced = self._before(gesture), self._replaced(gesture)
        self._voices = [voice for voice in self._voices if voice not in replaced]
        self._voices.append(Voice(gesture, self._bounds, self.t, before, on, repeat))

    def _before(self, gesture: Gesture) -> Offsets:
        """Sum of the offsets of the gestures that a gesture replaces."""
        return self._sum(self.t, self._replaced(gesture))

    def _replaced(self, gesture: Gesture) -> list[Voice]:
        """Gestures that a gesture replaces."""
        return [
            voice
            for voice in self._voices
            if np.all(gesture.named | ~voice.gesture.named)
            or (_ends_away(gesture) and _ends_away(voice.gesture))
        ]

    def _all(self) -> list[Voice]:
        """Gestures that are played, and the take."""
        return self._voices + ([] if self.take is None else [self.take])

    def _sum(self, t: float, voices: list[Voice], score: ScoreVoice | None = None) -> Offsets:
        """Sum of offsets at a time [s]."""
        total = Offsets.none(self._bounds.shape[1]) if score is None else score.now
        for voice in voices:
            total = Offsets(*(a + b for a, b in zip(total, voice.at(t), strict=True)))
        return total


def _ends_away(gesture: Gesture) -> bool:
    """Whether a gesture ends at rest away from home."""
    d, rate = gesture.ends[0][1], gesture.ends[1][1]
    is_away = np.any(np.abs(d - gesture.travel) > _TOLERANCE)
    return bool(is_away and not np.any(np.abs(rate) > _TOLERANCE))
