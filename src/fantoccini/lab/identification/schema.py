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
    """A point of a body whose position is measured."""

    body: Name
    """The body that carries it."""
    at: Place = (0.0, 0.0, 0.0)
    """Its position in the body's frame [m]."""
    find: bool = False
    """Whether `at` is only a guess, and the position is estimated."""


class ColumnFile(Model):
    """A column with another name or unit: `coordinate` or `tension`, and `unit`."""

    coordinate: str | None = None
    """A scalar coordinate; a driven one holds its command."""
    tension: Name | None = None
    """A string."""
    unit: Literal["rad", "deg", "m", "mm", "N"] | None = None
    """Unit of its numbers; rad, m or N by default."""

    @model_validator(mode="after")
    def _is_one(self) -> ColumnFile:
        if self.coordinate is not None and self.tension is not None:
            raise mistake("found `coordinate` and `tension`; needed: only one of them")
        if self.coordinate is None and self.tension is None and self.unit is None:
            raise mistake("needed: `coordinate` or `tension`, or a `unit`")
        return self


class DelayFile(Model):
    """An unknown delay."""

    about: Sized
    """Initial value [s]; the delay is searched within 0.25 s of it."""


class UnknownFile(Model):
    """Prior knowledge of an unknown number."""

    about: Real | None = None
    """Initial value; the file's number by default."""
    known: Annotated[Positive, SIZED] | None = None
    """Standard deviation of `about`, if it was measured beforehand."""


class RecordFile(Document):
    """A record of a puppet in motion, and the unknowns to estimate from it."""

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
    """Marker -> its body and position; its columns are `name.x`, `name.y` and `name.z` [m]."""
    columns: dict[str, ColumnFile] = Field(default_factory=dict)
    """Column with another name or unit -> its quantity and unit."""
    unit: Literal["m", "mm"] = "m"
    """Unit of the markers' columns."""
    unknown: dict[str, UnknownFile | None] = Field(default_factory=dict)
    """Unknowns: parameters of the puppet, or numbers in its file such as `forearm.mass`."""
    offsets: tuple[str, ...] = ()
    """Scalar driven coordinates whose commands are off by an unknown constant."""
    delay: Sized | Literal["find"] | DelayFile = 0.0
    """Time of the record's clock less that of the inputs' clock [s]; estimated with `find` or
    `{about}`."""
    noise: dict[str, Annotated[Size, SIZED]] = Field(default_factory=dict)
    """Marker or column -> standard deviation [m, rad or N]; estimated by default."""
    start: dict[str, Value] = Field(default_factory=dict)
    """Values of the pose in which the puppet hangs when the record begins."""

    @model_validator(mode="after")
    def _offsets_differ(self) -> RecordFile:
        refuse(
            (("offsets", i), f"{name} is unknown twice")
            for i, name in enumerate(self.offsets)
            if name in self.offsets[:i]
        )
        return self


def record_schema() -> dict[str, Any]:
    """JSON Schema of record files, for completion and checks in editors."""
    return document_schema(RecordFile)
