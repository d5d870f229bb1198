"""The schema of record files.

Classes with names in `Entry` are parts of one record file. The types `Sized` and `Size` are a
number and a positive number of at most 1e6, and a `Place` is a position [m]. A driven coordinate is
an end or a length of a string, or a driven joint.
"""

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
    raise_if_any,
    validation_error,
)


class MarkerEntry(Model):
    """A point of a body whose position is measured."""

    body: Name
    """The body that carries the marker."""
    at: Place = (0.0, 0.0, 0.0)
    """Position of the marker in the body's frame [m]."""
    find: bool = False
    """Whether to estimate the position; `at` is then its initial value."""


class ColumnEntry(Model):
    """The quantity and unit of a column: `coordinate` or `tension`, and `unit`.

    Only columns that are not named after their coordinate, or not in SI units, need an entry.
    """

    coordinate: str | None = None
    """Name of a scalar coordinate; of a driven one, the column contains the commanded values."""
    tension: Name | None = None
    """Name of a string, whose tension was measured."""
    unit: Literal["rad", "deg", "m", "mm", "N"] | None = None
    """Unit of the column's numbers; rad, m or N by default."""

    @model_validator(mode="after")
    def _check_quantity(self) -> ColumnEntry:
        if self.coordinate is not None and self.tension is not None:
            raise validation_error("found `coordinate` and `tension`; needed: only one of them")
        if self.coordinate is None and self.tension is None and self.unit is None:
            raise validation_error("needed: `coordinate` or `tension`, or a `unit`")
        return self


class DelayEntry(Model):
    """An unknown delay."""

    about: Sized
    """Initial value [s]; the estimate is within 0.25 s of it."""


class UnknownEntry(Model):
    """Prior knowledge of an unknown number."""

    about: Real | None = None
    """Initial value; the puppet file's number by default."""
    known: Annotated[Positive, SIZED] | None = None
    """Standard deviation of the initial value, if that was measured beforehand."""


class RecordFile(Document):
    """A record of a puppet in motion, and the unknowns to estimate from it."""

    kind: ClassVar = Kind("record", "a record has the keys `record`, `puppet` and `samples`")

    record: Name
    """The record's name."""
    about: str | None = None
    """Description of the record, in one sentence."""
    puppet: str
    """A puppet file beside this one, or a bundled puppet."""
    samples: str
    """A CSV file beside this one, with a column `time` [s]; empty cells are gaps."""
    inputs: str | None = None
    """Inputs file or recorded performance that drove the puppet; by default the columns named
    after driven coordinates did."""
    markers: dict[Name, MarkerEntry] = Field(default_factory=dict)
    """Marker -> its body and position; its columns are `name.x`, `name.y` and `name.z` [m]."""
    columns: dict[str, ColumnEntry] = Field(default_factory=dict)
    """Column -> its quantity and unit; by default those of the coordinate with the same name."""
    unit: Literal["m", "mm"] = "m"
    """Unit of the markers' columns."""
    unknown: dict[str, UnknownEntry | None] = Field(default_factory=dict)
    """Unknown numbers: parameters of the puppet, or numbers in its file such as `forearm.mass`."""
    offsets: tuple[str, ...] = ()
    """Scalar driven coordinates whose commands are off by an unknown constant."""
    delay: Sized | Literal["find"] | DelayEntry = 0.0
    """Time of the record's clock minus that of the inputs' clock at the same instant [s]; estimated
    with `find` or `{about}`."""
    noise: dict[str, Annotated[Size, SIZED]] = Field(default_factory=dict)
    """Marker or column -> standard deviation [m, rad or N]; estimated by default."""
    start: dict[str, Value] = Field(default_factory=dict)
    """Values of the pose in which the puppet hangs when the record begins."""

    @model_validator(mode="after")
    def _check_offsets(self) -> RecordFile:
        raise_if_any(
            (("offsets", i), f"{name} is listed twice")
            for i, name in enumerate(self.offsets)
            if name in self.offsets[:i]
        )
        return self


def record_schema() -> dict[str, Any]:
    """JSON Schema of record files, for completion and checks in editors."""
    return document_schema(RecordFile)
