"""Values in puppet files: names, numbers, parameters, angles, points, orientations.

A number may be written ``{parameter: m1, value: 0.5}``: it is then an entry of the argument p of
every generated function instead of a constant.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable
from numbers import Real as AnyReal
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Tag,
    ValidationError,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError

from fantoccini.base import rotation
from fantoccini.base.documents.located import Finding, shown
from fantoccini.base.documents.units import ANGLES, LENGTHS, Units, quantity_schema, without_unit

NAME = r"[A-Za-z_][A-Za-z0-9_-]{0,63}"


class Model(BaseModel):
    """Base of all parts of the schema: immutable, without unknown keys."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        validate_by_name=True,
        serialize_by_alias=True,
        use_attribute_docstrings=True,
    )


def validation_error(message: str, instead: float | None = None) -> PydanticCustomError:
    """A validation error with a complete message.

    Args:
        message: the message.
        instead: an allowed number to use in its place, so that the rest can be checked.
    """
    return PydanticCustomError("fantoccini", "{text}", {"text": message, "instead": instead})


def raise_if_any(findings: Iterable[Finding]) -> None:
    """Raises a validation error that lists mistakes; does nothing if there are none.

    Args:
        findings: paths, from the keys of the validated part on, and messages.
    """
    details = [
        InitErrorDetails(type=validation_error(text), loc=path, input=None)
        for path, text in findings
    ]
    if details:
        raise ValidationError.from_exception_data("", details)


def name_mistake(text: str) -> str:
    """The message for a text that is not a name."""
    return (
        f"found {shown(text)}; a name is up to 64 letters, digits, - and _, "
        "and begins with a letter or _"
    )


def _name(text: str) -> str:
    if not re.fullmatch(NAME, text, re.ASCII):
        raise validation_error(name_mistake(text))
    return text


def _part_name(text: str) -> str:
    if not all(re.fullmatch(NAME, part, re.ASCII) for part in text.split(".", 1)):
        raise validation_error(name_mistake(text))
    return text


def owner_of(coordinate: str, members: Collection[str] = ()) -> str:
    """The joint or string of a coordinate: ``hand`` of ``hand.length``.

    Args:
        coordinate: its name.
        members: members of a scene, whose names may precede the owner's.
    """
    parts = coordinate.split(".")
    return ".".join(parts[: 2 if parts[0] in members else 1])


def read_real(value: Any) -> float:
    """A finite number."""
    if isinstance(value, (dict, Parameter)):
        raise validation_error(
            f"found {shown(value)}; needed: a number (a parameter cannot stand here)"
        )
    if not isinstance(value, AnyReal) or isinstance(value, (bool, np.bool_)):
        raise validation_error(f"found {shown(value)}; needed: a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise validation_error(f"found {shown(number)}; needed: a finite number")
    return number + 0.0  # -0.0 becomes 0.0, so that equal puppets read the same


def read_angle(value: Any) -> float:
    """A number, or an angle with its unit, in radians."""
    return _quantity(value, ANGLES, "an angle: 0.5 (radians), 30 deg or 0.5 rad")


def read_length(value: Any) -> float:
    """A number, or a length with its unit, in metres."""
    return _quantity(value, LENGTHS, "a length, as 0.06, 6 cm or 60 mm")


def _quantity(value: Any, units: Units, needed: str) -> float:
    number = without_unit(value, units)
    if isinstance(number, str):
        raise validation_error(f"found {shown(value)}; needed: {needed}")
    return read_real(number)


Name = Annotated[
    str, AfterValidator(_name), WithJsonSchema({"type": "string", "pattern": f"^{NAME}$"})
]
PartName = Annotated[
    str, AfterValidator(_part_name), WithJsonSchema({"type": "string", "pattern": f"^{NAME}$"})
]
"""A name; in an assembled scene the name of a member and a dot may precede it."""
Real = Annotated[float, BeforeValidator(read_real), WithJsonSchema({"type": "number"})]
Angle = Annotated[float, BeforeValidator(read_angle), WithJsonSchema(quantity_schema(ANGLES))]


class Parameter(Model):
    """A number with a name: an entry of the argument p of every generated function."""

    parameter: PartName
    """The parameter's name; the same name always carries the same value."""
    value: Real
    """Its value in this file."""


def value_of(number: float | Parameter) -> float:
    """The number itself, or a parameter's value."""
    return number.value if isinstance(number, Parameter) else float(number)


def number_kind(value: Any) -> str:
    """Union branch of a number: a parameter is a mapping."""
    return "<parameter>" if isinstance(value, (dict, Parameter)) else "<number>"


def positive(number: float) -> float:
    """The number; refuses it unless it is greater than 0."""
    if number <= 0:
        raise validation_error(f"found {number:g}; needed: a positive number")
    return number


Number = Annotated[
    Annotated[Real, Tag("<number>")] | Annotated[Parameter, Tag("<parameter>")],
    Discriminator(number_kind),
]
Positive = Annotated[Real, AfterValidator(positive)]


def _not_negative(number: float) -> float:
    if number < 0:
        raise validation_error(f"found {number:g}; needed: a number of at least 0")
    return number


NotNegative = Annotated[Real, AfterValidator(_not_negative)]


def _share(number: float | Parameter) -> float | Parameter:
    if not 0 <= value_of(number) <= 1:
        raise validation_error(f"found {value_of(number):g}; needed: a number from 0 to 1")
    return number


Share = Annotated[Number, AfterValidator(_share)]
RealShare = Annotated[Real, AfterValidator(_share)]


def sized(*sizes: int) -> BeforeValidator:
    """Check for a list of one of these lengths."""

    def check(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if not isinstance(value, (list, tuple)) or len(value) not in sizes:
            description = (
                f"{len(value)} entries" if isinstance(value, (list, tuple)) else shown(value)
            )
            raise validation_error(
                f"found {description}; needed: a list of {' or '.join(map(str, sizes))} numbers"
            )
        return value

    return BeforeValidator(check)


def entries(n_min: int, n_max: int | None = None) -> BeforeValidator:
    """Check for a list with this many entries, before any entry is checked."""

    def check(value: Any) -> Any:
        if isinstance(value, (list, tuple)) and not (
            n_min <= len(value) <= (len(value) if n_max is None else n_max)
        ):
            needed = f"{n_min}" if n_max == n_min else f"at least {n_min}"
            raise validation_error(f"found a list of {len(value)}; needed: {needed}")
        return value

    return BeforeValidator(check)


def unit(vector: tuple[float, ...]) -> tuple[float, ...]:
    """The vector divided by its length; a vector that already has length 1 keeps its digits."""
    largest = max(map(abs, vector))
    if largest == 0:
        raise validation_error("found a vector of zero length; its direction is needed")
    size = math.hypot(*vector)
    if abs(size - 1) < 1e-15:  # rounding
        return vector
    # Scaled first: the length of a huge or tiny vector overflows or loses digits.
    scaled = tuple(x / largest for x in vector)
    size = math.hypot(*scaled)
    return tuple(x / size for x in scaled)


Vector = Annotated[tuple[Real, Real, Real], sized(3)]
Direction = Annotated[Vector, AfterValidator(unit)]
Quaternion = Annotated[tuple[Real, Real, Real, Real], sized(4), AfterValidator(unit)]


def _axes(axes: tuple[str, ...]) -> tuple[str, ...]:
    if not axes or list(axes) != sorted(set(axes)):
        raise validation_error(
            f"found {shown(list(axes))}; needed: one or more of x, y, z in this order"
        )
    return axes


Axes = Annotated[tuple[Literal["x", "y", "z"], ...], AfterValidator(_axes)]


def rotation_vector_quaternion(vector: tuple[float, ...]) -> tuple[float, ...]:
    """Unit quaternion w, x, y, z of a rotation vector [rad]."""
    return unit(tuple(rotation.exp(np.array(vector)).tolist()))


class Orientation(Model):
    """A rotation, written in exactly one of three ways."""

    quaternion: Quaternion | None = None
    """w, x, y, z."""
    axis: Direction | None = None
    """Axis of a rotation; goes with `angle`."""
    angle: Angle | None = None
    """Angle about `axis`."""
    rpy: Annotated[tuple[Angle, Angle, Angle], sized(3)] | None = None
    """Roll, pitch, yaw: rotations about the fixed axes x, then y, then z."""

    @model_validator(mode="after")
    def _exactly_one(self) -> Orientation:
        alternatives = [self.quaternion, self.rpy, self.axis if self.angle is None else self.angle]
        if sum(form is not None for form in alternatives) != 1 or (self.axis is None) != (
            self.angle is None
        ):
            raise validation_error("needed: exactly one of quaternion, axis with angle, or rpy")
        return self

    @property
    def matrix(self) -> np.ndarray:
        """Rotation matrix (3, 3) from the rotated frame to the reference frame."""
        if self.quaternion is not None:
            return rotation.matrix(np.array(self.quaternion))
        if self.rpy is not None:
            x, y, z = map(_turn, np.eye(3), self.rpy)
            return z @ (y @ x)
        return _turn(np.array(self.axis), self.angle or 0.0)


def _turn(axis: np.ndarray, angle: float) -> np.ndarray:
    return rotation.about(axis, math.cos(angle), math.sin(angle))
