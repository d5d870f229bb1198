"""Variations of a gesture in a cue: side, heading, speed, duration, size, repetitions.

A cue is a line of a score or play: a verb with its player and time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fantoccini.base import FantocciniError, StateError, UnknownNameError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.transitions import MAX_ACCELERATION, MAX_SPEED, MotionBound
from fantoccini.theatre.script import STYLE_WORDS, DoesCue, StyledCue

_MAX_PIECES = 100_000
"""Largest number of pieces of a repeated gesture, to limit memory."""


class StyleError(StateError):
    """A gesture cannot be varied as in a cue.

    Args:
        key: key of the impossible variation in the cue; empty for transitions between repetitions.
        reason: message with the reason.
    """

    def __init__(self, key: str, reason: FantocciniError | str):
        self.key = key
        super().__init__(str(reason))


@dataclass(frozen=True)
class Style:
    """Variation of a gesture, by the keys of a cue.

    Attributes:
        larger, faster: factors of its size and speed.
        mirrored: whether left and right are exchanged.
        repeat: number of repetitions.
        lasts: duration of each repetition [s]; None keeps that of the gesture.
    """

    larger: float = 1.0
    faster: float = 1.0
    mirrored: bool = False
    repeat: int = 1
    lasts: float | None = None

    @classmethod
    def from_cue(cls, cue: StyledCue, beat: float) -> Style:
        """Style of a cue, by its words and numbers; ``beat`` is the duration of a beat [s]."""
        larger, faster = cue.larger, cue.faster
        mirrored, repeat = cue.mirrored, cue.repeat
        for word in cue.how if isinstance(cue, DoesCue) else ():
            variation: dict[str, Any] = STYLE_WORDS[word]
            larger *= variation.get("larger", 1.0)
            faster *= variation.get("faster", 1.0)
            mirrored = mirrored != variation.get("mirrored", False)
            repeat *= variation.get("repeat", 1)
        lasts = None if cue.lasts is None else cue.lasts * beat
        return cls(larger, faster, mirrored, repeat, lasts)

    def apply(
        self,
        gesture: Gesture,
        puppet: Marionette,
        *,
        heading: float | None = None,
        speed: MotionBound = MAX_SPEED,
        acceleration: MotionBound = MAX_ACCELERATION,
    ) -> tuple[Gesture, Gesture]:
        """The gesture in this style, once and with its repetitions.

        It is turned before it is repeated, because the bounds hold for the axes of the stage.

        Args:
            gesture: gesture as its file has it.
            puppet: puppet or scene that performs it.
            heading: angle by which it is turned about the vertical [rad]; None does not turn it.
            speed, acceleration: bounds of the transitions between repetitions; see
                :meth:`Gesture.then`.

        Raises:
            StyleError: a variation is impossible.
        """
        failing_key = "mirrored"
        try:
            once = gesture.mirrored(puppet) if self.mirrored else gesture
            failing_key = "heading"
            once = once if heading is None else once.turned(heading)
            failing_key = "faster"
            once = once.faster(self.faster)
            failing_key = "lasts"
            once = once if self.lasts is None else once.lasting(self.lasts)
            failing_key = "larger"
            once = once.scaled(self.larger)
            failing_key = "repeat"
            pieces = self.repeat * (len(once.breaks) - 1)
            if pieces > _MAX_PIECES:
                raise StateError(
                    f"found {self.repeat}; {once.name} would have {pieces} pieces, "
                    f"of {_MAX_PIECES} at most"
                )
            failing_key = ""
            repeated = once.repeated(self.repeat, speed=speed, acceleration=acceleration)
        except (UnknownNameError, StateError) as error:
            raise StyleError(failing_key, error) from None
        return once, repeated
