"""Schema of score files: gestures in lanes, on beats or seconds."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema
from pydantic_core import PydanticCustomError

from fantoccini.puppet.located import shown
from fantoccini.puppet.sized import SIZED, Size
from fantoccini.puppet.values import Model, Name, NotNegative, Real, mistake, read_real

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
        raise mistake(f"found {shown(value)}; needed: a time, or a mark with an offset: turn + 2")
    return number


Factor = Annotated[Real, AfterValidator(_factor)]
Moment = Annotated[NotNegative, SIZED]
Time = Annotated[
    float | str,
    BeforeValidator(_time),
    WithJsonSchema({"anyOf": [{"type": "number", "minimum": 0}, {"type": "string"}]}),
]
"""A time, or a mark of the score with an offset: `chorus`, `chorus + 2`."""


class CueFile(Model):
    """A gesture in a lane. Without `at` and `on` it follows the one before at once."""

    gesture: str
    """A gesture file or a take (.npz) in this file's folder, or the name of a bundled gesture."""
    at: Time | None = None
    """When it begins."""
    on: dict[Name, Time] | None = None
    """A mark of the gesture -> when it is."""
    lasts: Factor | None = None
    """How long it lasts, each time; as long as its file says by default."""
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


class ScoreFile(Model):
    """A score: gestures of a puppet in lanes that add up."""

    score: Name
    """The score's name."""
    tempo: Factor | None = None
    """Beats in a minute; times are then in beats, otherwise in seconds."""
    lanes: Annotated[dict[str, tuple[CueFile, ...]], Field(min_length=1)]
    """Lane -> gestures, in order. Offsets of all lanes add up."""
    marks: dict[Name, Moment] = Field(default_factory=dict)
    """Name -> time."""
    speed: Size | dict[str, Size] = 1.0
    """Largest speed of driven coordinates, for all or by name [m/s or rad/s]."""
    acceleration: Size | dict[str, Size] = 6.0
    """Largest acceleration, likewise [m/s^2 or rad/s^2]."""
    captions: tuple[CaptionFile, ...] = ()
    """Words and when they are to be read."""
    duration: Size | None = None
    """When it ends at the earliest; with the last gesture by default."""


def score_schema() -> dict[str, Any]:
    """JSON Schema of a score file, for editors."""
    schema = ScoreFile.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
