"""Kinds of quantities: the unit of each, and how small and how large it may be.

The bounds are far beyond what is built, and keep products of several numbers finite: a run never
meets an overflow that comes from the file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Discriminator, Tag, WithJsonSchema

from fantoccini.puppet.values import (
    Parameter,
    mistake,
    number_kind,
    read_angle,
    read_real,
    sized,
    value_of,
)


@dataclass(frozen=True)
class Quantity:
    """A kind of quantity.

    Attributes:
        unit: for messages.
        least: size of the smallest number that is not zero.
        most: size of the largest.
    """

    unit: str
    least: float
    most: float


QUANTITIES = {
    "place": Quantity("m", 0.0, 1e6),
    "length": Quantity("m", 1e-6, 1e6),
    "scale": Quantity("", 1e-9, 1e9),
    "mass": Quantity("kg", 1e-12, 1e9),
    "density": Quantity("kg/m^3", 1e-6, 1e6),
    "inertia": Quantity("kg m^2", 0.0, 1e15),
    "rotor": Quantity("kg m^2", 1e-18, 1e9),
    "damping": Quantity("N s/m or N m s", 1e-18, 1e9),
    "stiffness": Quantity("N/m, N m/rad or N", 1e-12, 1e12),
    "force": Quantity("N or N m", 1e-12, 1e12),
    "speed": Quantity("m/s or rad/s", 1e-9, 1e6),
    "acceleration": Quantity("m/s^2", 0.0, 1e6),
    "angle": Quantity("rad", 0.0, 1e6),
    "coordinate": Quantity("m or rad", 0.0, 1e6),
    "electric": Quantity("", 1e-12, 1e9),
    "ratio": Quantity("", 1e-9, 1e9),
}


def bounded(kind: str, sign: str) -> Any:
    """A check of sign and size; words and None pass.

    Args:
        kind: of quantity.
        sign: ``any``, ``not negative`` or ``positive``.
    """
    quantity = QUANTITIES[kind]

    def check(number: Any) -> Any:
        if number is None or isinstance(number, str):
            return number
        value = value_of(number)
        size = abs(value)
        instead = min(max(size, quantity.least), quantity.most) or quantity.most
        if sign == "positive" and value <= 0:
            raise mistake(f"found {value:g}; needed: a positive number", instead)
        if sign == "not negative" and value < 0:
            raise mistake(f"found {value:g}; needed: zero or a positive number", instead)
        if size > quantity.most or 0 < size < quantity.least:
            zero = "0, or " if quantity.least and sign != "positive" else ""
            text = f"{zero}{quantity.least:g} to {quantity.most:g}"
            if sign == "any":
                text += " in size"
            raise mistake(f"found {value:g}; allowed: {text} {quantity.unit}".rstrip(), instead)
        return number

    return AfterValidator(check)


def _schema(kind: str, sign: str) -> dict[str, Any]:
    quantity = QUANTITIES[kind]
    lowest = {"any": -quantity.most, "not negative": 0.0, "positive": quantity.least}[sign]
    return {"type": "number", "minimum": lowest, "maximum": quantity.most}


def _plain(kind: str, sign: str = "any") -> Any:
    """A number that cannot be a parameter."""
    schema = WithJsonSchema(_schema(kind, sign))
    return Annotated[float, BeforeValidator(read_real), bounded(kind, sign), schema]


def _number(kind: str, sign: str = "any") -> Any:
    """A number, or a parameter with one."""
    schema = WithJsonSchema(_schema(kind, sign))
    return Annotated[
        Annotated[Annotated[float, BeforeValidator(read_real), schema], Tag("<number>")]
        | Annotated[Parameter, Tag("<parameter>")],
        Discriminator(number_kind),
        bounded(kind, sign),
    ]


_ANGLE_TEXT = {"type": "string", "pattern": "^[-+.0-9eE]+ *(deg|rad)$"}


def _angle_or(kind: str) -> Any:
    """An angle with or without a unit, or a number of another kind."""
    schema = WithJsonSchema({"anyOf": [_schema(kind, "any"), _ANGLE_TEXT]})
    return Annotated[float, BeforeValidator(read_angle), bounded(kind, "any"), schema]


Place = _plain("place")
Size = _plain("length", "positive")
Scale = _plain("scale")
Angle = _angle_or("angle")
RotationPart = _plain("angle")
AngleOrPlace = _angle_or("coordinate")
NumberAngleOrPlace = Annotated[
    Annotated[AngleOrPlace, Tag("<number>")] | Annotated[Parameter, Tag("<parameter>")],
    Discriminator(number_kind),
    bounded("coordinate", "any"),
]

PlaceNumber = _number("place")
LengthNumber = _number("length", "positive")
RestLength = _number("length", "not negative")
Mass = _number("mass", "not negative")
PositiveMass = _number("mass", "positive")
Density = _number("density", "not negative")
Inertia = _number("inertia")
RotorInertia = _number("rotor", "positive")
Damping = _number("damping", "not negative")
Stiffness = _number("stiffness", "not negative")
PositiveStiffness = _number("stiffness", "positive")
Force = _number("force", "not negative")
PositiveForce = _number("force", "positive")
Speed = _number("speed", "positive")
Acceleration = _number("acceleration")
Electric = _number("electric", "positive")
Ratio = _number("ratio", "positive")
NotNegativeRatio = _number("ratio", "not negative")

Point = Annotated[tuple[PlaceNumber, PlaceNumber, PlaceNumber], sized(3)]
Gravity = Annotated[tuple[Acceleration, Acceleration, Acceleration], sized(3)]
Vector = Annotated[tuple[Place, Place, Place], sized(3)]
Sizes = Annotated[tuple[Size, Size, Size], sized(3)]
