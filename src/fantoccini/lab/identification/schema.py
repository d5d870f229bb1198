"""The schema of record files."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from fantoccini.base.documents import (
    SIZED,
    Document,
    Kind,
    Model,
    Name,
    Place,
    Positive,
    Real,
    Size,
    Sized,
    Value,
    document_schema,
    mistake,
    refuse,
)


class MarkerFile(Model):
    """A point of a body that is filmed."""

    body: Name
    """The body that carries it."""
    at: Place = (0.0, 0.0, 0.0)
    """Its place in the body's frame [m]."""
    find: bool = False
    """Whether `at` is only a guess, and the place is looked for."""


class ColumnFile(Model):
    """What a column is that has another name or unit: `coordinate` or `tension`, `unit`."""

    coordinate: str | None = None
    """A scalar coordinate; driven ones are what was commanded."""
    tension: Name | None = None
    """A string."""
    unit: Literal["rad", "deg", "m", "mm", "N"] | None = None
    """Of its numbers; rad, m or N by default."""

    @model_validator(mode="after")
    def _is_one(self) -> ColumnFile:
        if self.coordinate is not None and self.tension is not None:
            raise mistake("found `coordinate` and `tension`; needed: one of them")
        if self.coordinate is None and self.tension is None and self.unit is None:
            raise mistake("needed: `coordinate` or `tension`, or a `unit`")
        return self


class DelayFile(Model):
    """A delay that is looked for."""

    about: Sized
    """Where the search begins [s]; it ends within 0.25 s of that."""


class UnknownFile(Model):
    """What is known of a number that is looked for."""

    about: Real | None = None
    """Where the search begins; the file's number by default."""
    known: Annotated[Positive, SIZED] | None = None
    """Standard deviation of `about`, if it was measured beforehand."""


class RecordFile(Document):
    """A record of a puppet in motion, and what is to be found from it."""

    kind: ClassVar = Kind("record", "a record has the keys `record`, `puppet` and `samples`")

    record: Name
    """The record's name."""
    about: str | None = None
    """A sentence."""
    puppet: str
    """A puppet file beside this one, or a bundled puppet."""
    samples: str
    """A CSV file beside this one, with a column `time` [s]; empty cells are gaps."""
    inputs: str | None = None
    """The inputs file or recording that was played; columns named after driven coordinates by
    default."""
    markers: dict[Name, MarkerFile] = Field(default_factory=dict)
    """Marker -> where it sits; its columns are `name.x`, `name.y` and `name.z` [m]."""
    columns: dict[str, ColumnFile] = Field(default_factory=dict)
    """Column of another name or unit -> what it is."""
    unit: Literal["m", "mm"] = "m"
    """Of the markers' columns."""
    unknown: dict[str, UnknownFile | None] = Field(default_factory=dict)
    """What is looked for: parameters of the puppet, or places of numbers in its file such as
    `forearm.mass`."""
    offsets: tuple[str, ...] = ()
    """Scalar driven coordinates whose commands are off by an unknown constant."""
    delay: Sized | Literal["find"] | DelayFile = 0.0
    """By how much the record's clock shows more than the inputs' [s]; `find`, or `{about}`, looks
    for it."""
    noise: dict[str, Annotated[Size, SIZED]] = Field(default_factory=dict)
    """Marker or column -> standard deviation [m, rad or N]; estimated by default."""
    start: dict[str, Value] = Field(default_factory=dict)
    """Values of the pose in which the puppet hangs when the record begins."""

    @model_validator(mode="after")
    def _offsets_differ(self) -> RecordFile:
        refuse(
            (("offsets", i), f"{name} is looked for twice")
            for i, name in enumerate(self.offsets)
            if name in self.offsets[:i]
        )
        return self


def record_schema() -> dict[str, Any]:
    """JSON Schema of record files, for completion and checks in editors."""
    return document_schema(RecordFile)
