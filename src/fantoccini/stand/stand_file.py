"""Stand files: the axes of a stand, their motors, what each moves, and the controller."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    WithJsonSchema,
    field_validator,
    model_validator,
)

from fantoccini.base import nearest
from fantoccini.base.documents import (
    SIZED,
    Angle,
    Document,
    Finding,
    Kind,
    Model,
    Name,
    NotNegative,
    Real,
    Size,
    document_schema,
    has_key,
    mistake,
    parse_document,
    read_document,
    refuse,
    shown,
    sized,
    unknown_names,
)
from fantoccini.model.puppet import QUANTITIES, named_file
from fantoccini.stand.controllers import Controller
from fantoccini.stand.determined import undetermined
from fantoccini.stand.motors import AxisFriction, Efficiency, Motor, Transmission

STANDS = Path(__file__).parent / "stands"
"""Folder of the bundled stands."""

_OWN = {"moves", "like", "home", "reversed"}
"""Keys of an axis that it does not take from the one it is like."""
_NEEDED = ("motor", "transmission", "travel", "speed", "acceleration")
"""Keys that an axis has, or takes from the one it is like."""
_MAX_LIKE = 64
"""Largest number of axes that are like one another in a row."""


def _factor(value: float) -> float:
    if value == 0.0 or not 1e-6 <= abs(value) <= QUANTITIES["ratio"].max_size:
        raise mistake(f"found {value:g}; needed: a factor that is not 0")
    return value


def _between(bounds: tuple[float, float]) -> tuple[float, float]:
    low, high = bounds
    if not low < high:
        raise mistake(f"found [{low:g}, {high:g}]; needed: the lower one first")
    return bounds


def _some(moves: dict[str, float]) -> dict[str, float]:
    if not moves:
        raise mistake("found nothing; needed: a driven coordinate with its factor, or several")
    return moves


def _coordinate(value: Any) -> Any:
    if not isinstance(value, str) or not 0 < len(value) <= 200 or not value.isprintable():
        raise mistake(f"found {shown(value)}; needed: the name of a driven coordinate")
    return value


Coordinate = Annotated[str, BeforeValidator(_coordinate), WithJsonSchema({"type": "string"})]
Moves = Annotated[dict[Coordinate, Annotated[Real, AfterValidator(_factor)]], AfterValidator(_some)]
Travel = Annotated[
    tuple[Angle, Angle],
    sized(2),
    SIZED,
    AfterValidator(_between),
    WithJsonSchema(
        {"type": "array", "items": {"type": ["number", "string"]}, "minItems": 2, "maxItems": 2}
    ),
]


class HomeFile(Model):
    """How an axis finds its place after it is switched on."""

    towards: Literal["min", "max"]
    """The end of its travel with the switch."""
    at: Angle
    """Its position where the switch closes [m or rad]."""
    speed: Size
    """With which it goes there [m/s or rad/s]."""


class AxisFile(Model):
    """An axis: a motor with what it moves."""

    like: Name | None = None
    """Another axis, whose keys stand for those that this one lacks, except `moves`, `home` and
    `reversed`."""
    motor: Motor | None = None
    """What turns it."""
    gear: Size = 1.0
    """Turns of the motor per turn of the drum, pulley, screw or joint."""
    transmission: Transmission | None = None
    """What makes a motion of its turns."""
    efficiency: Efficiency = 1.0
    """Of gear and transmission: part of the motor's power that arrives."""
    mass: NotNegative = 0.0
    """What moves along with it and is not in the puppet's file, without weight [kg]."""
    friction: AxisFriction | None = None
    """At the motor."""
    moves: Moves
    """Driven coordinate -> by how much it changes with the axis' position."""
    travel: Travel | None = None
    """Lowest and highest position [m or rad]."""
    speed: Size | None = None
    """Largest speed of the axis [m/s or rad/s]."""
    acceleration: Size | None = None
    """Largest acceleration of the axis [m/s^2 or rad/s^2]."""
    home: HomeFile | None = None
    """How it finds its place."""
    reversed: bool = False
    """Whether the motor turns backwards where the position grows."""


class Stand(Document):
    """A stand as it is written; every axis has its motor, transmission and bounds."""

    kind: ClassVar = Kind("stand", "a stand has the keys `stand` and `axes`", STANDS)

    stand: Name
    """The stand's name."""
    about: str = ""
    """What it is."""
    puppet: str | None = None
    """The puppet that it moves: a file beside this one, or the name of a bundled one."""
    axes: Annotated[dict[Name, AxisFile], Field(min_length=1)]
    """Name -> axis, in the controller's order."""
    zero: dict[Coordinate, Angle] = Field(default_factory=dict)
    """Driven coordinate -> its value where all axes are at 0; 0 by default."""
    controller: Controller | None = None
    """What takes the set points."""

    @field_validator("axes")
    @classmethod
    def _complete(cls, axes: dict[str, AxisFile]) -> dict[str, AxisFile]:
        """Completes every axis by the one it is like."""
        found: list[Finding] = []
        made = {name: _like(axes, name, found) for name in axes}
        refuse(found)
        for name, axis in made.items():
            missing = [key for key in _NEEDED if getattr(axis, key) is None]
            found += [((name, key), "this key is missing") for key in missing]
            if axis.travel is None or axis.home is None:
                continue
            low, high = axis.travel
            if not low <= axis.home.at <= high:
                text = f"needed: a position within travel, {low:g} to {high:g}"
                found.append(((name, "home", "at"), f"found {axis.home.at:g}; {text}"))
        wrong = undetermined({name: axis.moves for name, axis in made.items()})
        if wrong is not None:
            found.append(((wrong[0], "moves"), wrong[1]))
        refuse(found)
        return made

    @model_validator(mode="after")
    def _known(self) -> Stand:
        """Refuses coordinates and axes that are not there."""
        known = {coordinate for axis in self.axes.values() for coordinate in axis.moves}
        names = {} if self.controller is None else self.controller.names
        refuse(
            [
                *unknown_names(self.zero, known, "no axis moves {}", ("zero",)),
                *unknown_names(names, self.axes, "there is no axis {}", ("controller", "names")),
            ]
        )
        return self

    def __hash__(self) -> int:
        return hash((self.stand, self.puppet, *self.axes))

    def __repr__(self) -> str:
        return f"<Stand {self.name}: {len(self.axes)} axes, for {self.puppet}>"

    __str__ = __repr__

    @property
    def name(self) -> str:
        """Its name."""
        return self.stand

    @property
    def puppet_path(self) -> Path | None:
        """The file of its puppet: beside its own, or a bundled one; None where it names none.

        Raises:
            FileError: there is no such file.
        """
        return None if self.puppet is None else named_file(self.puppet, self.located)


def _like(axes: Mapping[str, AxisFile], name: str, found: list[Finding]) -> AxisFile:
    """An axis with the keys that it lacks, from the one it is like; notes mistakes."""
    axis, given, seen = axes[name], dict[str, Any](), [name]
    other = axis
    while other.like is not None:
        like = other.like
        if like not in axes:
            others = [key for key in axes if key != name]
            found.append(((name, "like"), f"there is no axis {like!r}{nearest(like, others)}"))
            break
        if like in seen or len(seen) > _MAX_LIKE:
            found.append(((name, "like"), f"{shown(name)} would be like itself"))
            break
        seen.append(like)
        other = axes[like]
        keys = other.model_fields_set - _OWN
        given = {key: getattr(other, key) for key in keys} | given
    own = axis.model_fields_set
    return axis.model_copy(update={k: v for k, v in given.items() if k not in own})


def stand_names() -> tuple[str, ...]:
    """Names of the bundled stands."""
    return Stand.kind.bundled


def is_stand(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a stand: YAML with the key `stand`."""
    return has_key(path, "stand")


def load_stand(path: str | os.PathLike[str]) -> Stand:
    """Reads a stand file.

    Args:
        path: of the file, or the name of a bundled stand.

    Raises:
        FileError: with every mistake found and its location.
    """
    return read_document(path, Stand)


def loads_stand(text: str, name: str = "<string>", folder: Path | None = None) -> Stand:
    """Reads a stand from a text; arguments as of :func:`fantoccini.model.loads`."""
    return parse_document(text, Stand, name=name, folder=folder)


def stand_schema() -> dict[str, Any]:
    """JSON Schema of a stand file, for editors."""
    return document_schema(Stand)
