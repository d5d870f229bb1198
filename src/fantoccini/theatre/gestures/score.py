"""Scores: gestures of a puppet in lanes, on beats; compiled to one motion of its hands.

q_K(t) = q_K0 + sum over lanes of d_lane(t)

q_K are the driven coordinates, the ends and lengths of the strings that the hands move; q_K0 are
their values at rest. A lane is a list of gestures in order, with the offsets d_lane.
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
    """A caption, with its times.

    Attributes:
        start, end: times at which it appears and disappears [s].
        text: text of the caption.
        who: speaker; "" for a caption without one.
    """

    start: float
    end: float
    text: str
    who: str = ""

    def __str__(self) -> str:
        """Text, after the name of its speaker."""
        return f"{self.who}: {self.text}" if self.who else self.text


@dataclass(frozen=True)
class PlayedGesture:
    """A gesture that a score plays, with its times in the score.

    Attributes:
        lane, gesture: names of the lane and of the gesture.
        start, end: times at which it begins and ends [s].
        marks: mark of the gesture -> time [s].
        name: name of its cue, to which other times of the score may refer.
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
        name: name of the wait.
        t: the score's time at which it waits [s].
        loop_start: start of the part that repeats until ``t``, during the wait [s]; None if the
            score stands still.
    """

    name: str
    t: float
    loop_start: float | None = None


@dataclass(frozen=True)
class Sound:
    """A sound that accompanies a score.

    Attributes:
        path: path of the file.
        start: beginning of the sound [s].
        gain: factor by which its amplitude is multiplied.
        duration: duration of the file [s].
    """

    path: Path
    start: float
    gain: float
    duration: float


@dataclass(frozen=True, eq=False)
class Score:
    """A compiled score, from :func:`load_score`. It is true if compiling changed nothing.

    Attributes:
        marionette: puppet that performs it.
        gesture: motion of all lanes together.
        cues: gestures with their times.
        marks: name -> time [s].
        captions: captions with their times.
        beat: duration of a beat [s]; 1 if times are in seconds.
        changes: deviations from the file and their reasons, with file and line.
        name: name of the score.
        speed, acceleration: bounds of the speed and acceleration of driven coordinates, for all or
            by name.
        waits: waits of live performances, in order; other runs of the score do not wait.
        sounds: sounds with their times.
        lanes: lane -> its own motion.
        tempo: beats in a minute; None if times are in seconds.
    """

    marionette: Marionette
    gesture: Gesture
    cues: tuple[PlayedGesture, ...]
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
        """Captions shown at a time [s], in order of their beginnings."""
        shown = (caption for caption in self.captions if caption.start <= t < caption.end)
        return tuple(sorted(shown, key=lambda caption: caption.start))

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return self.gesture.duration

    def inputs(self, x0: State) -> Input:
        """Input of the driven coordinates; the time of the state at rest is the score's time 0."""
        inputs = self.gesture.inputs(x0, speed=self.speed, acceleration=self.acceleration)
        return inputs.with_name(self.name)

    def offsets(self, t: float) -> tuple[VecK, VecK]:
        """(n_vK,) offsets d(t) from the puppet's rest and (n_vK,) their rates.

        Before the start and after the end, both are as at the start or the end [m or rad, per s].
        """
        return self.gesture.offsets(t)
