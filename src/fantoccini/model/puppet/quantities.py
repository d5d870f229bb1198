"""Kinds of quantities: unit, smallest and largest size.

The bounds are far wider than the numbers of real puppets. They keep products of several numbers
finite, so that no file causes an overflow.

A number of a file may be a parameter, which has a name and may change later.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeVar

from pydantic import Discriminator, GetCoreSchemaHandler, GetJsonSchemaHandler, Tag
from pydantic_core import CoreSchema, core_schema

from fantoccini.base.documents import (
    Angle as AnyAngle,
    Number,
    Parameter,
    Real,
    number_kind,
    sized,
    validation_error,
    value_of,
)

ValueT = TypeVar("ValueT", float, Parameter, str, None)


@dataclass(frozen=True)
class Quantity:
    """A kind of quantity.

    Attributes:
        unit: unit, for messages.
        min_size: smallest absolute value other than 0.
        max_size: largest absolute value.
    """

    unit: str
    min_size: float
    max_size: float


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


@dataclass(frozen=True)
class Bounded:
    """Annotation that checks a number's sign and size; texts and None are allowed.

    Attributes:
        kind: key of :data:`QUANTITIES`.
        sign: allowed signs.
    """

    kind: str
    sign: Literal["any", "not negative", "positive"] = "any"

    def check(self, number: ValueT) -> ValueT:
        """The number itself; raises a mistake if it is not allowed."""
        if number is None or isinstance(number, str):
            return number
        quantity, value = QUANTITIES[self.kind], value_of(number)
        min_size, max_size = quantity.min_size, quantity.max_size
        size = abs(value)
        replacement = min(max(size, min_size), max_size) or max_size
        if self.sign == "positive" and value <= 0:
            raise validation_error(f"found {value:g}; needed: a positive number", replacement)
        if self.sign == "not negative" and value < 0:
            raise validation_error(
                f"found {value:g}; needed: zero or a positive number", replacement
            )
        if size > max_size or 0 < size < min_size:
            text = f"{min_size:g} to {max_size:g}"
            if min_size and self.sign != "positive":
                text = f"0, or {text}"
            if self.sign == "any":
                text += " in size"
            raise validation_error(
                f"found {value:g}; allowed: {text} {quantity.unit}".rstrip(), replacement
            )
        return number

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self.check, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        quantity = QUANTITIES[self.kind]
        signs = {"any": -quantity.max_size, "not negative": 0.0, "positive": quantity.min_size}
        return _with_range(handler(schema), signs[self.sign], quantity.max_size)


def _with_range(schema: dict[str, Any], minimum: float, maximum: float) -> dict[str, Any]:
    """A JSON schema with a range added to its numbers, also in alternatives."""
    if schema.get("type") == "number":
        return schema | {"minimum": minimum, "maximum": maximum}
    alternatives = {key: schema[key] for key in ("anyOf", "oneOf") if key in schema}
    return schema | {
        key: [_with_range(s, minimum, maximum) for s in options]
        for key, options in alternatives.items()
    }


Place = Annotated[Real, Bounded("place")]
Size = Annotated[Real, Bounded("length", "positive")]
Scale = Annotated[Real, Bounded("scale")]
Angle = Annotated[AnyAngle, Bounded("angle")]
RotationPart = Annotated[Real, Bounded("angle")]
AngleOrPlace = Annotated[AnyAngle, Bounded("coordinate")]
NumberAngleOrPlace = Annotated[
    Annotated[AnyAngle, Tag("<number>")] | Annotated[Parameter, Tag("<parameter>")],
    Discriminator(number_kind),
    Bounded("coordinate"),
]

PlaceNumber = Annotated[Number, Bounded("place")]
LengthNumber = Annotated[Number, Bounded("length", "positive")]
RestLength = Annotated[Number, Bounded("length", "not negative")]
Mass = Annotated[Number, Bounded("mass", "not negative")]
PositiveMass = Annotated[Number, Bounded("mass", "positive")]
Density = Annotated[Number, Bounded("density", "not negative")]
Inertia = Annotated[Number, Bounded("inertia")]
RotorInertia = Annotated[Number, Bounded("rotor", "positive")]
Armature = Annotated[Number, Bounded("rotor", "not negative")]
Damping = Annotated[Number, Bounded("damping", "not negative")]
Stiffness = Annotated[Number, Bounded("stiffness", "not negative")]
PositiveStiffness = Annotated[Number, Bounded("stiffness", "positive")]
Force = Annotated[Number, Bounded("force", "not negative")]
PositiveForce = Annotated[Number, Bounded("force", "positive")]
Speed = Annotated[Number, Bounded("speed", "positive")]
Acceleration = Annotated[Number, Bounded("acceleration")]
Electric = Annotated[Number, Bounded("electric", "positive")]
Ratio = Annotated[Number, Bounded("ratio", "positive")]
NotNegativeRatio = Annotated[Number, Bounded("ratio", "not negative")]

Point = Annotated[tuple[PlaceNumber, PlaceNumber, PlaceNumber], sized(3)]
Gravity = Annotated[tuple[Acceleration, Acceleration, Acceleration], sized(3)]
Vector = Annotated[tuple[Place, Place, Place], sized(3)]
Sizes = Annotated[tuple[Size, Size, Size], sized(3)]
