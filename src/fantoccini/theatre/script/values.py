"""Values of scores and plays: factors, lengths, times, marks, places and directions.

A mark is here a named time of a gesture or score, or a named place on the stage.
"""

from __future__ import annotations

import math
import re
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema
from pydantic_core import PydanticCustomError

from fantoccini.base import did_you_mean
from fantoccini.base.documents import (
    NAME,
    SIZED,
    Name,
    Place,
    Real,
    read_angle,
    read_real,
    shown,
    validation_error,
)

Spot = tuple[str | int, ...]
"""Keys and indices that lead to a part of the file."""

START, END = "start", "end"
"""Moments that every cue has, in addition to the marks of its gesture."""

DIRECTIONS = {"audience": 0.0, "left": 90.0, "back": 180.0, "right": -90.0}
"""Direction on the stage -> angle from the audience, which is along x [deg]."""

STYLE_WORDS: dict[str, dict[str, Any]] = {
    "timidly": {"larger": 0.6, "faster": 0.8},
    "boldly": {"larger": 1.25},
    "slowly": {"faster": 0.7},
    "quickly": {"faster": 1.3},
    "smaller": {"larger": 0.7},
    "larger": {"larger": 1.3},
    "mirrored": {"mirrored": True},
    "twice": {"repeat": 2},
    "thrice": {"repeat": 3},
}
"""Word -> variation of a gesture; factors of several words are multiplied."""

_FACTOR_RANGE = (1e-3, 1e3)
"""Least and largest factor of sizes, speeds and durations."""
_MARK_PATTERN = rf"{NAME}( \d+)?"


def _check_factor(number: float) -> float:
    low, high = _FACTOR_RANGE
    if not low <= number <= high:
        raise validation_error(f"found {number:g}; needed: a number from {low:g} to {high:g}")
    return number


def _check_time(value: Any) -> float | str:
    if isinstance(value, str):
        return value
    try:
        number = read_real(value)
    except PydanticCustomError:
        number = -1.0
    if not 0.0 <= number <= 1e6:
        raise validation_error(
            f"found {shown(value)}; needed: a time, or one by name: turn + 2, wave.up"
        )
    return number


def _check_target(value: Any) -> Any:
    if isinstance(value, str):
        return value
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise validation_error(
            f"found {shown(value)}; needed: three numbers, or the name of a body"
        )
    return tuple(read_real(number) for number in value)


def _check_mark(text: str) -> str:
    if not re.fullmatch(_MARK_PATTERN, text, re.ASCII):
        raise validation_error(
            f"found {shown(text)}; needed: a mark of the gesture, such as up or left 2"
        )
    return text


def _as_tuple(value: Any) -> Any:
    return (value,) if isinstance(value, str) else value


def _as_times(value: Any) -> Any:
    return tuple(value) if isinstance(value, list | tuple) else (value,)


def _read_facing(value: Any) -> Any:
    if isinstance(value, str) and not value.lstrip()[:1].isdigit() and value[:1] not in "+-.":
        return value
    return read_angle(value)


def _read_side(given: Any) -> float:
    value: float | str = _read_facing(given)
    if not isinstance(value, str):
        return value
    if value not in DIRECTIONS:
        text = f"found {shown(value)}; needed: an angle, or {', '.join(DIRECTIONS)}"
        raise validation_error(text + did_you_mean(value, DIRECTIONS))
    return math.radians(DIRECTIONS[value])


def _check_where(value: Any) -> Any:
    if isinstance(value, str):
        return value
    if not isinstance(value, list | tuple) or len(value) not in (2, 3):
        raise validation_error(
            f"found {shown(value)}; needed: a mark, a player, or a place [x, y] in m"
        )
    return tuple(value)


def _check_style_word(value: str) -> str:
    if value not in STYLE_WORDS:
        raise validation_error(
            f"found {shown(value)}; allowed: "
            f"{', '.join(STYLE_WORDS)}{did_you_mean(value, STYLE_WORDS)}"
        )
    return value


Mark = Annotated[
    str,
    AfterValidator(_check_mark),
    WithJsonSchema({"type": "string", "pattern": f"^{_MARK_PATTERN}$"}),
]
"""A mark of a gesture; `left 2` is the second one named `left`."""
Target = Annotated[
    tuple[float, float, float] | str,
    BeforeValidator(_check_target, json_schema_input_type=Place | str),
    SIZED,
]
"""A place, or the name of a body."""
Factor = Annotated[Real, AfterValidator(_check_factor)]
Count = Annotated[int, Field(ge=1, le=1000)]
Time = Annotated[
    float | str,
    BeforeValidator(_check_time),
    WithJsonSchema({"anyOf": [{"type": "number", "minimum": 0}, {"type": "string"}]}),
]
"""A time, or a mark or a moment of a cue with an offset: `chorus + 2`, `wave.up`, `bow.end - 1`."""
TimeList = Annotated[
    tuple[Time, ...], BeforeValidator(_as_times, json_schema_input_type=Time | tuple[Time, ...])
]
StagePlace = Annotated[
    str | tuple[Real, Real] | tuple[Real, Real, Real], BeforeValidator(_check_where), SIZED
]
"""A mark, player or obstacle, or a place: x towards the audience, y to the audience's right [m]."""
Facing = Annotated[
    float | str,
    BeforeValidator(_read_facing),
    SIZED,
    WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string"}]}),
]
"""Angle from the audience to the left, or `audience`, `left`, `right`, `back`, or what to face."""
StageAngle = Annotated[
    float,
    BeforeValidator(_read_side),
    SIZED,
    WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string"}]}),
]
"""Angle from the audience to the left, or `audience`, `left`, `right`, `back`."""
NameList = Annotated[
    tuple[Name, ...],
    BeforeValidator(_as_tuple, json_schema_input_type=str | tuple[str, ...]),
    Field(min_length=1),
]
StyleWord = Annotated[
    str,
    AfterValidator(_check_style_word),
    WithJsonSchema({"type": "string", "enum": list(STYLE_WORDS)}),
]
StyleWords = Annotated[
    tuple[StyleWord, ...], BeforeValidator(_as_tuple, json_schema_input_type=str | tuple[str, ...])
]
