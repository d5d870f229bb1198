"""Player that adds gestures, a take and a score to the positions that hands hold.

q_K(t) = q_K,held(t) + d(t),   d(t): sum of the gestures, the take and the score

q_K are the driven coordinates, d offsets. A take is a recording of a performance for editing, and a
tick the interval at which a performance advances.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, VecK
from fantoccini.dynamics.marionette import Marionette
from fantoccini.theatre.gestures import Gesture, Score
from fantoccini.theatre.perform.score_voice import ScoreVoice
from fantoccini.theatre.perform.voice import Offsets, Voice, lead_time, slowed_to_bounds

_TOLERANCE = 1e-9
"""Tolerance of offsets and rates at rest [m or rad, per s]."""


class TickOffsets(NamedTuple):
    """Offsets and rates (n_vK,) at the two ends of a tick."""

    d: VecK
    rate: VecK
    d_next: VecK
    rate_next: VecK


class _ScheduledGesture(NamedTuple):
    """Gesture that waits for its time ``wanted_start`` [s]."""

    gesture: Gesture
    wanted_start: float
    repeat: bool


class MotionPlayer:
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
        self._scheduled: list[_ScheduledGesture] = []
        self.take: Voice | None = None
        self.score: ScoreVoice | None = None

    @property
    def is_idle(self) -> bool:
        """Whether nothing is played."""
        return not (self._voices or self._scheduled or self.take or self.score)

    @property
    def is_away(self) -> bool:
        """Whether gestures are played, wait, or have ended away from home."""
        return bool(self._voices or self._scheduled)

    @property
    def playing(self) -> tuple[str, ...]:
        """Names of the gestures that move or wait."""
        moving = [voice.gesture.name for voice in self._voices if not voice.has_ended(self.t)]
        return tuple(dict.fromkeys(moving + [entry.gesture.name for entry in self._scheduled]))

    @property
    def take_time(self) -> float | None:
        """Time within the take [s]; None without one."""
        return None if self.take is None else self.take.time(self.t)

    def transferred(
        self, old_marionette: Marionette, new_marionette: Marionette
    ) -> tuple[MotionPlayer | None, tuple[str, ...]]:
        """The player, or None if it cannot continue with a changed puppet; and messages."""
        old_table, new_table = old_marionette.coordinates, new_marionette.coordinates
        if (old_table.q_K, old_table.v_K) == (new_table.q_K, new_table.v_K):
            return self, ()
        playing_parts = {
            "the gestures": self.is_away,
            "the take": self.take,
            "the score": self.score,
        }
        return None, tuple(f"{name} ended" for name, part in playing_parts.items() if part)

    def set_bounds(self, bounds: Array) -> None:
        """Sets the bounds of later transitions."""
        self._bounds = bounds
        for voice in self._active_voices():
            voice.set_bounds(bounds)
        if self.score is not None:
            self.score.set_bounds(bounds)

    def offsets(self) -> Offsets:
        """Present sum of all offsets."""
        return self._total(self.t, self._active_voices(), self.score)

    def play(
        self, gesture: Gesture, *, wanted_start: float | None = None, repeat: bool = False
    ) -> float:
        """Plays a gesture; returns its beginning, in terms of ``t`` [s].

        Args:
            gesture: gesture; it is slowed down if it would exceed the bounds.
            wanted_start: wanted beginning; as soon as possible by default. It begins later if the
                transition to its start takes longer.
            repeat: whether to repeat it, until :meth:`finish`.
        """
        gesture = slowed_to_bounds(gesture, self._bounds)
        self._scheduled = [entry for entry in self._scheduled if entry.gesture.name != gesture.name]
        earliest = self.t + lead_time(gesture, self._replaced_offsets(gesture), self._bounds)
        if wanted_start is None or wanted_start <= earliest + self._tick:
            self._start(gesture, wanted_start, repeat)
        else:
            self._scheduled.append(_ScheduledGesture(gesture, wanted_start, repeat))
        return earliest if wanted_start is None else max(wanted_start, earliest)

    def finish(self, name: str) -> None:
        """Ends a gesture after its present repetition."""
        self._scheduled = [entry for entry in self._scheduled if entry.gesture.name != name]
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
        offsets = Offsets(np.zeros(n), np.where(motion.named, v_K, 0.0), np.zeros(n))
        self.take = Voice(motion, self._bounds, self.t, offsets, repeat=repeat)

    def stop_take(self) -> VecK:
        """Ends the take; returns its (n_vK,) offsets, for the hands to hold."""
        offset = self._total(self.t, [] if self.take is None else [self.take]).d
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
            self._voices.append(Voice(home, self._bounds, self.t, self.score.offsets))
            self.score = None

    def clear(self) -> VecK:
        """Ends all motion; returns its (n_vK,) offsets, for the hands to hold."""
        offset = self.offsets().d
        self._voices, self._scheduled, self.take, self.score = [], [], None, None
        return offset

    def step(self) -> TickOffsets:
        """Advances by a tick."""
        for entry in list(self._scheduled):
            offsets_before = self._replaced_offsets(entry.gesture)
            if (
                entry.wanted_start - lead_time(entry.gesture, offsets_before, self._bounds)
                <= self.t + self._tick
            ):
                self._scheduled.remove(entry)
                self._start(entry.gesture, entry.wanted_start, entry.repeat)
        offsets_before = self.offsets()
        self.t += self._tick
        if self.score is not None:
            self.score.advance(self._tick)
        offsets_after = self.offsets()
        return TickOffsets(
            offsets_before.d, offsets_before.rate, offsets_after.d, offsets_after.rate
        )

    def settle(self) -> VecK:
        """Removes motions that have ended at home; returns the (n_vK,) displacement of home."""
        displacement = np.zeros(self._bounds.shape[1])
        for voice in list(self._voices):
            offsets = voice.at(self.t)
            if voice.has_ended(self.t) and offsets.is_home:
                displacement += offsets.origin_shift
                self._voices.remove(voice)
        if self.take is not None and self.take.has_ended(self.t):
            displacement += self.stop_take()
        return displacement

    # -- internal ----------------------------------------------------------------------------

    def _start(self, gesture: Gesture, wanted_start: float | None, repeat: bool) -> None:
        offsets_before, replaced_voices = (
            self._replaced_offsets(gesture),
            self._replaced_voices(gesture),
        )
        self._voices = [voice for voice in self._voices if voice not in replaced_voices]
        self._voices.append(
            Voice(gesture, self._bounds, self.t, offsets_before, wanted_start, repeat)
        )

    def _replaced_offsets(self, gesture: Gesture) -> Offsets:
        """Sum of the offsets of the gestures that a gesture replaces."""
        return self._total(self.t, self._replaced_voices(gesture))

    def _replaced_voices(self, gesture: Gesture) -> list[Voice]:
        """Gestures that a gesture replaces."""
        return [
            voice
            for voice in self._voices
            if np.all(gesture.named | ~voice.gesture.named)
            or (_ends_away(gesture) and _ends_away(voice.gesture))
        ]

    def _active_voices(self) -> list[Voice]:
        """Gestures that are played, and the take."""
        return self._voices + ([] if self.take is None else [self.take])

    def _total(self, t: float, voices: list[Voice], score: ScoreVoice | None = None) -> Offsets:
        """Sum of offsets at a time [s]."""
        total = Offsets.none(self._bounds.shape[1]) if score is None else score.offsets
        for voice in voices:
            total = Offsets(*(a + b for a, b in zip(total, voice.at(t), strict=True)))
        return total


def _ends_away(gesture: Gesture) -> bool:
    """Whether a gesture ends at rest away from home."""
    d, rate = gesture.ends[0][1], gesture.ends[1][1]
    is_away = np.any(np.abs(d - gesture.travel) > _TOLERANCE)
    return bool(is_away and not np.any(np.abs(rate) > _TOLERANCE))
