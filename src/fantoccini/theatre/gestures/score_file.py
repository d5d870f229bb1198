"""Schema of score files: gestures in lanes, on beats or seconds."""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, WithJsonSchema
from pydantic_core import PydanticCustomError

from fantoccini.base.documents import (
    NAME,
    SIZED,
    Angle,
    Model,
    Name,
    Place,
    Positive,
    Real,
    Size,
    mistake,
    read_real,
    shown,
)
from fantoccini.theatre.gestures.moves import metres

_FACTORS = (1e-3, 1e3)
"""Least and largest factor of sizes, speeds and durations."""


def _factor(number: float) -> float:
    low, high = _FACTORS
    if not low <= number <= high:
        raise mistake(f"found {number:g}; needed: a number from {low:g} to {high:g}")
    return number


def _time(value: Any) -> float | str:
    if isinstance(value, str):
        return value
    try:
        number = read_real(value)
    except PydanticCustomError:
        number = -1.0
    if not 0.0 <= number <= 1e6:
        raise mistake(f"found {shown(value)}; needed: a time, or one by name: turn + 2, wave.up")
    return number


def _length(value: Any) -> float:
    number = metres(value)
    if isinstance(number, str):
        raise mistake(f"found {shown(value)}; needed: a length, as 0.06, 6 cm or 60 mm")
    return read_real(number)


def _to(value: Any) -> Any:
    if isinstance(value, str):
        return value
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise mistake(f"found {shown(value)}; needed: three numbers, or the name of a body")
    return tuple(read_real(number) for number in value)


def _mark(text: str) -> str:
    if not re.fullmatch(_MARK, text, re.ASCII):
        raise mistake(f"found {shown(text)}; needed: a mark of the gesture, such as up or left 2")
    return text


_MARK = rf"{NAME}( \d+)?"
Mark = Annotated[
    str, AfterValidator(_mark), WithJsonSchema({"type": "string", "pattern": f"^{_MARK}$"})
]
"""A mark of a gesture; of those of one name the second is called `left 2`."""
OF_GESTURES = ("of", "steps", "step", "turn", "to")
"""Keys that only gestures have."""

KINDS = ("gesture", "phrase", "hold")
"""What a cue may be."""

Length = Annotated[
    float,
    BeforeValidator(_length),
    SIZED,
    WithJsonSchema(
        {"anyOf": [{"type": "number"}, {"type": "string", "pattern": "^.+ *(mm|cm|m)$"}]}
    ),
]
To = Annotated[
    tuple[float, float, float] | str,
    BeforeValidator(_to, json_schema_input_type=Place | str),
    SIZED,
]
"""A place, or the name of a body."""
Factor = Annotated[Real, AfterValidator(_factor)]
Time = Annotated[
    float | str,
    BeforeValidator(_time),
    WithJsonSchema({"anyOf": [{"type": "number", "minimum": 0}, {"type": "string"}]}),
]
"""A time, or a mark or a moment of a cue with an offset: `chorus + 2`, `wave.up`, `bow.end - 1`."""


class CueFile(Model):
    """A gesture, a phrase or a rest in a lane. Without `at` and `on` it follows the one before."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": [kind]} for kind in KINDS]})

    gesture: str | None = None
    """A gesture file or a take (.npz) in this file's folder, or the name of a bundled gesture."""
    phrase: Name | None = None
    """A phrase of this file."""
    hold: Factor | None = None
    """How long the lane rests where it is."""
    name: Name | None = None
    """By which times refer to it; the name of its gesture or phrase by default."""
    at: Time | None = None
    """When it begins."""
    on: dict[Mark, Time] | None = None
    """A mark of the gesture -> when it is."""
    lasts: Factor | None = None
    """How long it lasts, each time; as long as its file says by default."""
    of: Name | None = None
    """The member of a scene that does it."""
    steps: Annotated[int, Field(ge=1, le=1000)] | None = None
    """How many steps of `walk`."""
    step: Length | None = None
    """Length of a step of `walk` [m]."""
    turn: Angle | None = None
    """By how much `walk` turns to the left, in all [rad]."""
    to: To | None = None
    """The place that `point` and `look` are for [m], or a body that is there at the start."""
    heading: Angle | None = None
    """The direction of forward, from that at the start: after a walk that turns [rad]."""
    larger: Factor = 1.0
    """Factor of its size."""
    faster: Factor = 1.0
    """Factor of its speed."""
    mirrored: bool = False
    """Whether left and right change places."""
    repeat: Annotated[int, Field(ge=1, le=1000)] = 1
    """How often, in a row."""

    def model_post_init(self, context: Any, /) -> None:
        """Refuses what contradicts itself."""
        kinds = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(kinds) != 1:
            found = "both " + " and ".join(f"`{one}`" for one in kinds) if kinds else "none of them"
            raise mistake(f"found {found}; needed: one of `gesture`, `phrase` and `hold`")
        if self.hold is not None and (more := self.model_fields_set - {"hold", "at", "name"}):
            raise mistake(f"found `hold` with `{min(more)}`; a hold has only `at` and `name`")
        own = [key for key in OF_GESTURES if getattr(self, key) is not None]
        if self.gesture is None and own:
            raise mistake(f"found `phrase` with `{own[0]}`; only a gesture has `{own[0]}`")
        if self.turn:
            # Larger, it is no rigid motion; repeated, it needs another heading each time.
            for key in self.model_fields_set & {"larger", "repeat"}:
                raise mistake(f"found both `turn` and `{key}`; needed: other `steps` or cues")
        if self.at is not None and self.on is not None:
            raise mistake("found both `at` and `on`; needed: one of them")
        if self.on is not None and len(self.on) != 1:
            raise mistake(f"found {len(self.on)} marks in `on`; needed: one")
        if self.lasts is not None and self.faster != 1.0:
            raise mistake("found both `lasts` and `faster`; needed: one of them")


class CaptionFile(Model):
    """Words for a while."""

    at: Time
    """When they appear."""
    until: Time
    """When they go."""
    text: Annotated[str, Field(min_length=1)]
    """The words."""


class WaitFile(Model):
    """Where a live performance waits for GO."""

    at: Time
    """When."""
    loop: Time | None = None
    """From where on it repeats what leads there until then; it stands still by default."""


class SoundFile(Model):
    """A sound that is heard with the score."""

    file: str
    """A sound file in this file's folder."""
    at: Time = 0.0
    """When it begins."""
    gain: Annotated[Positive, Field(le=100.0)] = 1.0
    """Factor of its loudness."""


def _wait(value: Any) -> Any:
    return value if isinstance(value, dict) else {"at": value}


def _sounds(value: Any) -> Any:
    if isinstance(value, str):
        return ({"file": value},)
    return (value,) if isinstance(value, dict) else value


_AS_WAIT = BeforeValidator(_wait, json_schema_input_type=Time | WaitFile)
_AS_SOUNDS = BeforeValidator(
    _sounds, json_schema_input_type=str | SoundFile | tuple[SoundFile, ...]
)
SoundsFile = Annotated[tuple[SoundFile, ...], _AS_SOUNDS]
Cues = Annotated[tuple[CueFile, ...], Field(min_length=1)]


class ScoreFile(Model):
    """A score: gestures of a puppet in lanes that add up."""

    score: Name
    """The score's name."""
    tempo: Factor | None = None
    """Beats in a minute; times are then in beats, otherwise in seconds."""
    lanes: Annotated[dict[str, tuple[CueFile, ...]], Field(min_length=1)]
    """Lane -> gestures, in order. Offsets of all lanes add up."""
    phrases: dict[Name, Cues] = Field(default_factory=dict)
    """Name -> gestures in order, to be played like one; times count from its beginning."""
    marks: dict[Name, Time] = Field(default_factory=dict)
    """Name -> time."""
    waits: dict[Name, Annotated[WaitFile, _AS_WAIT]] = Field(default_factory=dict)
    """Name -> when a live performance waits for GO."""
    speed: Size | dict[str, Size] = 1.0
    """Largest speed of driven coordinates, for all or by name [m/s or rad/s]."""
    acceleration: Size | dict[str, Size] = 6.0
    """Largest acceleration, likewise [m/s^2 or rad/s^2]."""
    captions: tuple[CaptionFile, ...] = ()
    """Words and when they are to be read."""
    sound: SoundsFile = ()
    """A sound file, or several with the times at which they begin."""
    duration: Size | None = None
    """When it ends at the earliest; with the last gesture by default."""


def score_schema() -> dict[str, Any]:
    """JSON Schema of a score file, for editors."""
    schema = ScoreFile.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
