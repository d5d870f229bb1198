"""Schema of score files: gestures in lanes, on beats or seconds."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from fantoccini.puppet.values import Model, Name, NotNegative, Positive, Real, mistake

Time = NotNegative | str
"""A time, or a mark of the score with an offset: `chorus`, `chorus + 2`."""


class CueFile(Model):
    """A gesture in a lane. Without `at` and `on` it follows the one before at once."""

    gesture: str
    """A gesture file in this file's folder, or the name of a bundled gesture."""
    at: Time | None = None
    """When it begins."""
    on: dict[Name, Time] | None = None
    """A mark of the gesture -> when it is."""
    lasts: Positive | None = None
    """How long it lasts, each time; as long as its file says by default."""
    larger: Positive = 1.0
    """Factor of its size."""
    faster: Positive = 1.0
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
    text: str
    """The words."""


class ScoreFile(Model):
    """A score: gestures of a puppet in lanes that add up."""

    score: Name
    """The score's name."""
    tempo: Positive | None = None
    """Beats in a minute; times are then in beats, otherwise in seconds."""
    lanes: Annotated[dict[str, tuple[CueFile, ...]], Field(min_length=1)]
    """Lane -> gestures, in order. Offsets of all lanes add up."""
    marks: dict[Name, NotNegative] = Field(default_factory=dict)
    """Name -> time."""
    speed: Positive | dict[str, Positive] = 1.0
    """Largest speed of driven coordinates, for all or by name [m/s or rad/s]."""
    acceleration: Positive | dict[str, Positive] = 6.0
    """Largest acceleration, likewise [m/s^2 or rad/s^2]."""
    captions: tuple[CaptionFile, ...] = ()
    """Words that are shown."""
    duration: Real | None = None
    """When it ends at the earliest; with the last gesture by default."""


def score_schema() -> dict[str, Any]:
    """JSON Schema of a score file, for editors."""
    schema = ScoreFile.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
