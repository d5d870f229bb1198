"""Stand files: the axes of a stand with their motors and coordinates, and the controllers.

A stand is the machine that moves a puppet, and an axis a motor with its gear and its drum, belt or
screw. It moves driven coordinates: ends and lengths of strings, driven joints.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Mapping
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

from fantoccini.base import did_you_mean
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
    parse_document,
    raise_if_any,
    read_document,
    shown,
    sized,
    unknown_names,
    validation_error,
)
from fantoccini.model.puppet import QUANTITIES, named_file
from fantoccini.stand.axis_rank import undetermined_axis
from fantoccini.stand.controllers import (
    LETTERS,
    Controller,
    ControllerBase,
    ControllerPart,
    axis_letters,
    too_many_axes,
)
from fantoccini.stand.motors import AxisFriction, Efficiency, Motor, Transmission

BUNDLED_STANDS_FOLDER = Path(__file__).parent / "stands"
"""Folder of the bundled stands."""

NEVER_INHERITED = {"moves", "like", "home", "reversed"}
"""Keys that an axis does not inherit from the axis named by `like`."""
REQUIRED_KEYS = ("motor", "transmission", "travel", "speed", "acceleration")
"""Keys that an axis must have, by itself or through `like`."""
MAX_LIKE_CHAIN = 64
"""Longest chain of `like`."""


def _require_nonzero(value: float) -> float:
    if value == 0.0 or not 1e-6 <= abs(value) <= QUANTITIES["ratio"].max_size:
        raise validation_error(f"found {value:g}; needed: a factor that is not 0")
    return value


def _require_ordered(bounds: tuple[float, float]) -> tuple[float, float]:
    low, high = bounds
    if not low < high:
        raise validation_error(f"found [{low:g}, {high:g}]; needed: the lower one first")
    return bounds


def _require_nonempty(moves: dict[str, float]) -> dict[str, float]:
    if not moves:
        raise validation_error(
            "found nothing; needed: a driven coordinate with its factor, or several"
        )
    return moves


def _require_name(value: Any) -> Any:
    if not isinstance(value, str) or not 0 < len(value) <= 200 or not value.isprintable():
        raise validation_error(f"found {shown(value)}; needed: the name of a driven coordinate")
    return value


Coordinate = Annotated[str, BeforeValidator(_require_name), WithJsonSchema({"type": "string"})]
Moves = Annotated[
    dict[Coordinate, Annotated[Real, AfterValidator(_require_nonzero)]],
    AfterValidator(_require_nonempty),
]
Travel = Annotated[
    tuple[Angle, Angle],
    sized(2),
    SIZED,
    AfterValidator(_require_ordered),
    WithJsonSchema(
        {"type": "array", "items": {"type": ["number", "string"]}, "minItems": 2, "maxItems": 2}
    ),
]


class HomeFile(Model):
    """Homing of an axis: a move to a switch at a known position, after power-on."""

    towards: Literal["min", "max"]
    """End of the travel with the switch."""
    at: Angle
    """Position of the axis where the switch closes [m or rad]."""
    speed: Size
    """Speed of homing [m/s or rad/s]."""


class AxisFile(Model):
    """An axis: a motor, its transmission, and the driven coordinates that it moves."""

    like: Name | None = None
    """Another axis, whose keys are used where this one lacks them, except `moves`, `home` and
    `reversed`."""
    motor: Motor | None = None
    """Motor of the axis."""
    gear: Size = 1.0
    """Turns of the motor per turn of the drum, pulley, screw or joint."""
    transmission: Transmission | None = None
    """Drum, belt, screw or shaft that converts the motor's rotation to motion."""
    efficiency: Efficiency = 1.0
    """Efficiency of gear and transmission: output power, relative to the motor's."""
    mass: NotNegative = 0.0
    """Mass that the axis moves and the puppet's file lacks; only its inertia is considered [kg]."""
    friction: AxisFriction | None = None
    """Friction at the motor."""
    moves: Moves
    """Driven coordinate -> its change per unit of the axis' position."""
    travel: Travel | None = None
    """Lowest and highest position [m or rad]."""
    speed: Size | None = None
    """Largest speed of the axis [m/s or rad/s]."""
    acceleration: Size | None = None
    """Largest acceleration of the axis [m/s^2 or rad/s^2]."""
    home: HomeFile | None = None
    """Homing."""
    reversed: bool = False
    """Whether the motor turns backwards as the position grows."""


class Stand(Document):
    """The contents of a stand file; every axis has its motor, transmission and bounds."""

    kind: ClassVar = Kind("stand", "a stand has the keys `stand` and `axes`", BUNDLED_STANDS_FOLDER)

    stand: Name
    """The stand's name."""
    about: str = ""
    """Description of the stand, in one sentence."""
    puppet: str | None = None
    """Puppet on the stand: a file beside this one, or the name of a bundled puppet."""
    axes: Annotated[dict[Name, AxisFile], Field(min_length=1)]
    """Name -> axis, in the controller's order."""
    zero: dict[Coordinate, Angle] = Field(default_factory=dict)
    """Driven coordinate -> its value when all axes are at 0; 0 by default."""
    elsewhere: tuple[Coordinate, ...] = ()
    """Driven coordinates that another stand or a hand moves."""
    controller: Controller | None = None
    """The controller that receives the set points."""
    controllers: dict[Name, ControllerPart] = Field(default_factory=dict)
    """Name -> controller, each for some of the axes, in place of `controller`."""

    @field_validator("axes")
    @classmethod
    def _complete_axes(cls, axes: dict[str, AxisFile]) -> dict[str, AxisFile]:
        """Adds to every axis the keys that it inherits through `like`."""
        mistakes: list[Finding] = []
        complete = {name: _inherit(axes, name, mistakes) for name in axes}
        raise_if_any(mistakes)
        for name, axis in complete.items():
            missing = [key for key in REQUIRED_KEYS if getattr(axis, key) is None]
            mistakes += [((name, key), "this key is missing") for key in missing]
            if axis.travel is None or axis.home is None:
                continue
            low, high = axis.travel
            if not low <= axis.home.at <= high:
                text = f"needed: a position within travel, {low:g} to {high:g}"
                mistakes.append(((name, "home", "at"), f"found {axis.home.at:g}; {text}"))
        dependent = undetermined_axis({name: axis.moves for name, axis in complete.items()})
        if dependent is not None:
            mistakes.append(((dependent[0], "moves"), dependent[1]))
        raise_if_any(mistakes)
        return complete

    @model_validator(mode="after")
    def _validate_names(self) -> Stand:
        """Raises for unknown names, and for controllers that do not fit the axes."""
        coordinates = {coordinate for axis in self.axes.values() for coordinate in axis.moves}
        mistakes = [*unknown_names(self.zero, coordinates, "no axis moves {}", ("zero",))]
        for i, name in enumerate(self.elsewhere):
            if name in coordinates:
                text = f"an axis of this stand moves {shown(name)}"
                mistakes.append((("elsewhere", i), text))
        raise_if_any([*mistakes, *_sharing_mistakes(self)])
        if self.controller is not None:
            mistakes += _controller_mistakes(self.controller, tuple(self.axes), ("controller",))
        for name, part in self.controllers.items():
            mistakes += _controller_mistakes(part, part.axes, ("controllers", name))
        raise_if_any(mistakes)
        return self

    def __hash__(self) -> int:
        return hash((self.stand, self.puppet, *self.axes))

    def __repr__(self) -> str:
        return f"<Stand {self.name}: {len(self.axes)} axes, for {self.puppet}>"

    __str__ = __repr__

    @property
    def name(self) -> str:
        """Name of the stand."""
        return self.stand

    @property
    def puppet_path(self) -> Path | None:
        """File of the puppet, beside the stand's or bundled; None if the stand names no puppet.

        Raises:
            FileError: there is no such file.
        """
        return None if self.puppet is None else named_file(self.puppet, self.located)

    @property
    def parts(self) -> dict[str, Stand]:
        """Name of a controller -> the stand with only the axes of this controller.

        A stand with one controller is {"": self}.
        """
        return {
            name: self.model_copy(
                update={
                    "axes": {axis: self.axes[axis] for axis in part.axes},
                    "controller": part,
                    "controllers": {},
                }
            )
            for name, part in self.controllers.items()
        } or {"": self}

    def controller_of(self, axis: str) -> ControllerBase | None:
        """The controller that moves an axis; None if the file names none."""
        controllers = self.controllers.values()
        return next((c for c in controllers if axis in c.axes), self.controller)


def _inherit(axes: Mapping[str, AxisFile], name: str, mistakes: list[Finding]) -> AxisFile:
    """An axis with the keys that it inherits through `like`; appends mistakes to the list."""
    axis, inherited, visited = axes[name], dict[str, Any](), [name]
    ancestor = axis
    while ancestor.like is not None:
        like = ancestor.like
        if like not in axes:
            other_axes = [key for key in axes if key != name]
            mistakes.append(
                ((name, "like"), f"there is no axis {like!r}{did_you_mean(like, other_axes)}")
            )
            break
        if like in visited or len(visited) > MAX_LIKE_CHAIN:
            mistakes.append(((name, "like"), f"{shown(name)} would inherit from itself"))
            break
        visited.append(like)
        ancestor = axes[like]
        keys = ancestor.model_fields_set - NEVER_INHERITED
        inherited = {key: getattr(ancestor, key) for key in keys} | inherited
    own_keys = axis.model_fields_set
    return axis.model_copy(update={k: v for k, v in inherited.items() if k not in own_keys})


def _sharing_mistakes(stand: Stand) -> Iterator[Finding]:
    """Mistakes in the assignment of axes and ports to several controllers."""
    if not stand.controllers:
        return
    if stand.controller is not None:
        text = "found `controller` and `controllers`; allowed: one of them"
        yield ("controllers",), text
    owners = Counter(axis for part in stand.controllers.values() for axis in part.axes)
    ports = Counter(part.port for part in stand.controllers.values() if part.port is not None)
    for name, part in stand.controllers.items():
        key_path = ("controllers", name)
        for i, axis in enumerate(part.axes):
            if axis not in stand.axes:
                text = f"there is no axis {shown(axis)}{did_you_mean(axis, stand.axes)}"
                yield (*key_path, "axes", i), text
            elif owners[axis] > 1:
                yield (*key_path, "axes", i), f"found {axis!r} twice; needed: one controller for it"
        if part.port is not None and ports[part.port] > 1:
            text = f"found {part.port!r} twice; needed: one port for each controller"
            yield (*key_path, "port"), text
    for axis in stand.axes:
        if not owners[axis]:
            text = f"no controller has the axis {axis!r}; needed: each axis in the `axes` of one"
            yield ("controllers",), text


def _controller_mistakes(
    controller: ControllerBase, axes: tuple[str, ...], key_path: tuple[str, ...]
) -> list[Finding]:
    """Mistakes of a controller with respect to its axes: too many, or with wrong names."""
    mistakes = [*unknown_names(controller.names, axes, "there is no axis {}", (*key_path, "names"))]
    kind: str = getattr(controller, "type", "")
    if reason := too_many_axes(kind, len(axes)):
        mistakes.append((key_path, reason))
    if kind not in LETTERS or mistakes:
        return mistakes
    _, mistakes_by_axis = axis_letters(controller, kind, axes)
    return [((*key_path, "names", axis), text) for axis, text in mistakes_by_axis.items()]


def stand_names() -> tuple[str, ...]:
    """Names of the bundled stands."""
    return Stand.kind.bundled


def is_stand(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a stand: YAML with the key `stand`."""
    return has_key(path, "stand")


def load_stand(path: str | os.PathLike[str]) -> Stand:
    """Reads a stand file.

    Args:
        path: path of the file, or the name of a bundled stand.

    Raises:
        FileError: the file has mistakes; all are listed with their locations.
    """
    return read_document(path, Stand)


def loads_stand(text: str, name: str = "<string>", folder: Path | None = None) -> Stand:
    """Reads a stand from a text; arguments as for :func:`fantoccini.model.loads`."""
    return parse_document(text, Stand, name=name, folder=folder)


def stand_schema() -> dict[str, Any]:
    """JSON Schema of a stand file, for editors."""
    return document_schema(Stand)
