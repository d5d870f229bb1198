"""Stand files: the axes of a stand, their motors, what each moves, and the controller."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from fantoccini.base import FileError, Mistake, nearest
from fantoccini.base.documents import (
    SIZED,
    Angle,
    Located,
    Model,
    Name,
    NotNegative,
    Real,
    Size,
    described_schema,
    has_key,
    mistake,
    read_file,
    read_located,
    shown,
    sized,
    validate,
)
from fantoccini.model.puppet import QUANTITIES, bundled
from fantoccini.stand.controllers import Controller
from fantoccini.stand.determined import undetermined
from fantoccini.stand.motors import AxisFriction, Efficiency, Motor, Transmission

STANDS = Path(__file__).parent / "stands"
"""Folder of the bundled stands."""

_OWN = ("moves", "like", "home", "reversed")
"""Keys of an axis that it does not take from the one it is like."""
_INHERITED = ("motor", "transmission", "travel", "speed", "acceleration")
"""Keys that an axis has, or takes from the one it is like."""
_MAX_LIKE = 64
"""Axes that may be like one another in a row."""


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


class StandFile(Model):
    """A stand."""

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


@dataclasses.dataclass(frozen=True, eq=False)
class Stand:
    """A stand as it is written.

    Attributes:
        file: what it says; every axis has its motor, transmission and bounds.
        located: where it says so.
    """

    file: StandFile
    located: Located

    def __repr__(self) -> str:
        return f"<Stand {self.name}: {len(self.file.axes)} axes, for {self.file.puppet}>"

    @property
    def name(self) -> str:
        """Its name."""
        return self.file.stand

    @property
    def puppet_path(self) -> Path | None:
        """The file of its puppet: beside its own, or a bundled one; None where it names none.

        Raises:
            FileError: there is no such file.
        """
        if self.file.puppet is None:
            return None
        found = self.located.beside(self.file.puppet) or bundled(self.file.puppet)
        if found is None:
            text = f"found neither a file {shown(self.file.puppet)} here nor a bundled puppet"
            raise self.located.error([(("puppet",), text)], FileError)
        return found

    def refuse(self, found: list[tuple[tuple[str | int, ...], str]]) -> None:
        """Raises a FileError with these mistakes, if there are any."""
        if found:
            raise self.located.error(found, FileError)


def stand_names() -> tuple[str, ...]:
    """Names of the bundled stands."""
    return tuple(sorted(path.stem for path in STANDS.glob("*.yaml")))


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
    name = os.fspath(path)
    if not os.path.exists(name):
        if name not in stand_names():
            text = "found nothing here, and no bundled stand of this name"
            raise FileError([Mistake(name, None, "", text + nearest(name, stand_names()))])
        path = STANDS / f"{name}.yaml"
    return _stand(read_file(path))


def loads_stand(text: str, name: str = "<string>", folder: Path | None = None) -> Stand:
    """Reads a stand from a text; arguments as of :func:`fantoccini.model.loads`."""
    return _stand(read_located(text, name, folder))


def stand_schema() -> dict[str, Any]:
    """JSON Schema of a stand file, for editors."""
    return described_schema(StandFile, "fantoccini stand")


def _stand(located: Located) -> Stand:
    data = located.data if isinstance(located.data, dict) else {}
    if "stand" not in data and "puppet" in data and "bodies" in data:
        text = "this is a puppet file; a stand has the keys `stand` and `axes`"
        raise located.error([((), text)], FileError)
    file = validate(StandFile, _resolved(located))
    found: list[tuple[tuple[str | int, ...], str]] = []
    for name, axis in file.axes.items():
        found += [
            (("axes", name, key), "this key is missing")
            for key in _INHERITED
            if getattr(axis, key) is None
        ]
        if axis.travel is None or axis.home is None:
            continue
        low, high = axis.travel
        if not low <= axis.home.at <= high:
            text = f"found {axis.home.at:g}; needed: a position within travel, {low:g} to {high:g}"
            found.append((("axes", name, "home", "at"), text))
    known = {coordinate for axis in file.axes.values() for coordinate in axis.moves}
    for name in file.zero:
        if name not in known:
            text = f"no axis moves {shown(name)}{nearest(name, known)}"
            found.append((("zero", name), text))
    for name in {} if file.controller is None else file.controller.names:
        if name not in file.axes:
            text = f"there is no axis {shown(name)}{nearest(name, file.axes)}"
            found.append((("controller", "names", name), text))
    wrong = undetermined({name: axis.moves for name, axis in file.axes.items()})
    if wrong is not None:
        found.append((("axes", wrong[0], "moves"), wrong[1]))
    if found:
        raise located.error(found, FileError)
    return Stand(file, located)


def _resolved(located: Located) -> Located:
    """The same with every axis completed by the one it is like.

    Raises:
        FileError: an axis is like one that is not there, or like itself.
    """
    data = located.data
    axes = data.get("axes") if isinstance(data, dict) else None
    if not isinstance(axes, dict):
        return located
    found: list[tuple[tuple[str | int, ...], str]] = []
    made: dict[Any, Any] = {}
    for name, axis in axes.items():
        own, other, seen = axis, axis, [name]
        while isinstance(other, dict) and "like" in other:
            like = other["like"]
            if not isinstance(like, str) or not isinstance(axes.get(like), dict):
                known = [str(key) for key in axes if key != name]
                hint = nearest(like, known) if isinstance(like, str) else ""
                found.append((("axes", name, "like"), f"there is no axis {shown(like)}{hint}"))
                break
            if like in seen or len(seen) > _MAX_LIKE:
                found.append((("axes", name, "like"), f"{shown(name)} would be like itself"))
                break
            seen.append(like)
            other = axes[like]
            own = {key: value for key, value in other.items() if key not in _OWN} | own
        made[name] = own
    if found:
        raise located.error(found, FileError)
    return dataclasses.replace(located, data={**data, "axes": made})
