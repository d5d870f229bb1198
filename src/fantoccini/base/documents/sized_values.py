"""Bounded values for files of motions and plays: magnitudes of at most 1e6.

`Sized` is a number, `Size` a positive number, `Place` a position and `Length` a length with or
without its unit; `SIZED` is the check of the magnitude.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, WithJsonSchema

from fantoccini.base.documents.units import LENGTHS, quantity_schema
from fantoccini.base.documents.values import (
    Angle,
    Positive,
    Real,
    Vector,
    positive,
    read_length,
    validation_error,
)

_MAX_MAGNITUDE = 1e6
"""Largest allowed magnitude [m, rad or s]."""


def _sized(value: Any) -> Any:
    """Refuses numbers that are too large."""
    numbers = value if isinstance(value, tuple) else (value,)
    for number in numbers:
        if isinstance(number, float) and abs(number) > _MAX_MAGNITUDE:
            raise validation_error(
                f"found {number:g}; needed: a size of at most {_MAX_MAGNITUDE:g}"
            )
    return value


SIZED = AfterValidator(_sized)
Sized = Annotated[Real, SIZED]
Size = Annotated[Positive, SIZED]
Place = Annotated[Vector, SIZED]
Length = Annotated[
    float, BeforeValidator(read_length), SIZED, WithJsonSchema(quantity_schema(LENGTHS))
]
"""A number of metres, or a length with its unit, such as `12 cm`."""
PositiveLength = Annotated[Length, AfterValidator(positive)]
"""The same, greater than 0."""
Value = Annotated[
    Angle | tuple[Angle, ...], SIZED, WithJsonSchema({"type": ["number", "string", "array"]})
]
"""A number or angle, or a tuple of them: an interval or a rotation."""
