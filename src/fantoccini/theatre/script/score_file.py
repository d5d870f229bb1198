"""Schema of score files: gestures in lanes, on beats or seconds.

A lane is a list of gestures in order; the offsets of all lanes add up. Classes with names in `File`
are parts of one score file.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import BeforeValidator, Field

from fantoccini.base.documents import Document, Kind, Model, Name, Positive, Size
from fantoccini.model.puppet import WORDS
from fantoccini.theatre.script.unions import AnyScoreCue
from fantoccini.theatre.script.values import Factor, Time


class CaptionFile(Model):
    """A caption."""

    at: Time
    """Time at which it appears."""
    until: Time
    """Time at which it disappears."""
    text: Annotated[str, Field(min_length=1)]
    """Text of the caption."""


class WaitFile(Model):
    """A time at which a live performance waits for GO."""

    at: Time
    """Time of the wait."""
    loop: Time | None = None
    """Start of the part that is repeated while it waits; without it, everything stands still."""


class SoundFile(Model):
    """A sound that accompanies the score."""

    file: str
    """A sound file in this file's folder."""
    at: Time = 0.0
    """Time at which it begins."""
    gain: Annotated[Positive, Field(le=100.0)] = 1.0
    """Factor by which the amplitude is multiplied."""


def _as_wait(value: Any) -> Any:
    return value if isinstance(value, dict) else {"at": value}


def _as_sound_list(value: Any) -> Any:
    if isinstance(value, str):
        return ({"file": value},)
    return (value,) if isinstance(value, dict) else value


_AS_WAIT = BeforeValidator(_as_wait, json_schema_input_type=Time | WaitFile)
_AS_SOUNDS = BeforeValidator(
    _as_sound_list, json_schema_input_type=str | SoundFile | tuple[SoundFile, ...]
)
SoundsFile = Annotated[tuple[SoundFile, ...], _AS_SOUNDS]
NonEmptyCues = Annotated[tuple[AnyScoreCue, ...], Field(min_length=1)]


class ScoreFile(Document):
    """A score: gestures of a puppet in lanes that add up."""

    kind: ClassVar = Kind("score", "a score has the keys `score` and `lanes`", words=WORDS)

    score: Name
    """Name of the score."""
    tempo: Factor | None = None
    """Beats in a minute; times are then in beats, otherwise in seconds."""
    lanes: Annotated[dict[str, tuple[AnyScoreCue, ...]], Field(min_length=1)]
    """Lane -> gestures, in order. Offsets of all lanes add up."""
    phrases: dict[Name, NonEmptyCues] = Field(default_factory=dict)
    """Name -> gestures in order, played as one gesture; times count from its start."""
    marks: dict[Name, Time] = Field(default_factory=dict)
    """Name -> time."""
    waits: dict[Name, Annotated[WaitFile, _AS_WAIT]] = Field(default_factory=dict)
    """Name -> time at which a live performance waits for GO."""
    speed: Size | dict[str, Size] = 1.0
    """Largest speed of driven coordinates, for all [m/s; of turns 0.4 m from the axis] or by name
    [m/s or rad/s]."""
    acceleration: Size | dict[str, Size] = 6.0
    """Largest acceleration of driven coordinates, for all [m/s^2; of turns 0.4 m from the axis] or
    by name [m/s^2 or rad/s^2]."""
    captions: tuple[CaptionFile, ...] = ()
    """Captions with their times."""
    sound: SoundsFile = ()
    """A sound file, or several with the times at which they begin."""
    duration: Size | None = None
    """Earliest end of the score; by default, the end of the last gesture."""
