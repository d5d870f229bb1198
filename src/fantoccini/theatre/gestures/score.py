"""Scores: gestures of a puppet in lanes, on beats; compiled to one motion of its hands.

q_K(t) = q_K0 + sum over lanes of d_lane(t)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from fantoccini.base import Mistake, VecK
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Input, State
from fantoccini.theatre.gestures.gesture import Gesture


@dataclass(frozen=True)
class Caption:
    """Words from one time to another [s].

    Attributes:
        start, end: [s].
        text: the words.
        who: who says them; "" for a caption without a speaker.
    """

    start: float
    end: float
    text: str
    who: str = ""

    def __str__(self) -> str:
        """The words, after the name of their speaker."""
        return f"{self.who}: {self.text}" if self.who else self.text


@dataclass(frozen=True)
class Played:
    """A gesture as it is played.

    Attributes:
        lane, gesture: names.
        start, end: [s].
        marks: of the gesture -> time [s].
        name: by which the score's times refer to it.
    """

    lane: str
    gesture: str
    start: float
    end: float
    marks: Mapping[str, float]
    name: str = ""


@dataclass(frozen=True)
class Wait:
    """A time of a score at which a live performance waits for GO.

    Attributes:
        name: of the wait.
        t: the score's time at which it waits [s].
        loop_start: from where on the score repeats itself until ``t`` meanwhile [s]; None where it
            stands still.
    """

    name: str
    t: float
    loop_start: float | None = None


@dataclass(frozen=True)
class Sound:
    """A sound that is heard with a score.

    Attributes:
        path: of the file.
        start: when it begins [s].
        gain: factor of its loudness.
        duration: [s].
    """

    path: Path
    start: float
    gain: float
    duration: float


@dataclass(frozen=True, eq=False)
class Score:
    """A score, compiled. Made by :func:`load_score`; true where all is as it was written.

    Attributes:
        marionette: the puppet.
        gesture: all lanes together.
        cues: what is played when.
        marks: name -> time [s].
        captions: words and their times.
        beat: duration of a beat [s]; 1 where times are in seconds.
        changes: what is not as it was written, and why, with file and line.
        name: of the score.
        waits: where a live performance waits for GO, in order; otherwise they take no time.
        sounds: what is heard.
        lanes: lane -> its own motion.
        tempo: beats in a minute; None where times are in seconds.
    """

    marionette: Marionette
    gesture: Gesture
    cues: tuple[Played, ...]
    marks: Mapping[str, float]
    captions: tuple[Caption, ...]
    beat: float
    changes: tuple[Mistake, ...] = ()
    name: str = ""
    speed: float | Mapping[str, float] = field(default=1.0, repr=False)
    acceleration: float | Mapping[str, float] = field(default=6.0, repr=False)
    waits: tuple[Wait, ...] = ()
    sounds: tuple[Sound, ...] = ()
    lanes: Mapping[str, Gesture] = field(default_factory=dict, repr=False)
    tempo: float | None = field(default=None, repr=False)

    def __bool__(self) -> bool:
        return not self.changes

    def __repr__(self) -> str:
        changed = f", {len(self.changes)} changes" if self.changes else ""
        return f"<Score {self.name!r}: {self.duration:g} s, {len(self.cues)} gestures{changed}>"

    def captions_at(self, t: float) -> tuple[Caption, ...]:
        """The captions to be read at a time [s], in order of their beginnings."""
        shown = (caption for caption in self.captions if caption.start <= t < caption.end)
        return tuple(sorted(shown, key=lambda one: one.start))

    @property
    def duration(self) -> float:
        """[s]."""
        return self.gesture.duration

    def inputs(self, x0: State) -> Input:
        """The motion of the hands from a state at rest on; the score's time 0 is the state's."""
        made = self.gesture.inputs(x0, speed=self.speed, acceleration=self.acceleration)
        return made.called(self.name)

    def offsets(self, t: float) -> tuple[VecK, VecK]:
        """(n_vK,) offsets d(t) from where the puppet hangs and (n_vK,) their rates.

        Before the start and after the end they are those there [m or rad, s].
        """
        return self.gesture.offsets(t)
