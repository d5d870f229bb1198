"""Names in gestures: driven coordinates, or strings and directions; mirror images."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.base import Array, MaskRows, StateError, nearest
from fantoccini.base.documents import LENGTHS, Mistakes, Path, without_unit
from fantoccini.motion import Points, pieces, reading

if TYPE_CHECKING:
    from fantoccini.model.tree import CoordinateTable

DIRECTIONS = {
    "up": ("length", -1.0),
    "down": ("length", 1.0),
    "forward": ("x", 1.0),
    "back": ("x", -1.0),
    "left": ("y", 1.0),
    "right": ("y", -1.0),
    "out": ("y", 0.0),
    "in": ("y", 0.0),
}
"""Direction -> coordinate of a string, and its sign; 0 if it depends on the string's side."""

_SUFFIXES = ("length", "x", "y", "z", "rotation")
_SIDE = re.compile(r"(?<![a-z])(left|right)(?![a-z])")
_TWIN = {"left": "right", "right": "left"}


def owner_of(name: str) -> tuple[str, str, str]:
    """Prefix of a coordinate's owner, the owner, and the rest after it.

    ``pierrot.``, ``hand_left`` and ``.length``: the sides of a scene's puppets do not count.
    """
    parts = name.split(".")
    k = len(parts) - 2 if len(parts) > 1 and parts[-1] in _SUFFIXES else len(parts) - 1
    before, after = "".join(f"{part}." for part in parts[:k]), parts[k + 1 :]
    return before, parts[k], "".join(f".{part}" for part in after)


def twin(name: str) -> str:
    """Name with left and right exchanged in its owner."""
    before, owner, after = owner_of(name)
    return before + _SIDE.sub(lambda side: _TWIN[side[1]], owner) + after


def reflection(name: str) -> Array | None:
    """Signs of a coordinate's components under reflection in the x-z plane; None if unknown.

    Equal angles of joints on both sides are mirror images, as in puppet files. For a joint in the
    middle the name does not determine the sign.
    """
    if name.endswith(".rotation"):
        return np.array([-1.0, 1.0, -1.0])
    if owner_of(name)[2]:
        return np.array([-1.0 if name.endswith(".y") else 1.0])
    return None if twin(name) == name else np.array([1.0])


def planes(table: CoordinateTable, named: MaskRows) -> list[tuple[int, int]]:
    """Indices in v_K of x and y of every end that is moved along one of them.

    Raises:
        StateError: an end is driven along only one of them, or a body is turned.
    """
    known, ends = pieces.channel_names(table), dict[str, tuple[int, int]]()
    for name, (_, v) in known.items():
        owner, _, part = name.rpartition(".")
        if not named[v.start]:
            continue
        if name in table.rotations:
            raise StateError(f"it turns {owner}; only motions of strings' ends turn with a puppet")
        if owner and part in ("x", "y"):
            other = f"{owner}.{'y' if part == 'x' else 'x'}"
            if other not in known:
                raise StateError(f"it moves {name}, and {other} is not driven")
            ends[owner] = known[f"{owner}.x"][1].start, known[f"{owner}.y"][1].start
    return list(ends.values())


def read(
    table: CoordinateTable, given: Mapping[str, Any], mistakes: Mistakes, at: Path = ()
) -> dict[str, Points]:
    """Driven scalar coordinate -> times and offsets, from names as in :meth:`Gesture.of`."""
    known = pieces.channel_names(table)
    places: dict[str, tuple[str, float]] = {}
    for name in given:
        channel, sign = meaning(name, known)
        places[name] = table.commands.get(channel, channel), sign
    written: dict[str, tuple[str, float, Any]] = {}
    for name, points in given.items():
        channel, sign = places[name]
        if channel not in known or channel in table.rotations:
            mistakes.add((*at, str(name)), _unknown(str(name), channel, table))
            continue
        if channel in written:
            mistakes.add(
                (*at, str(name)), f"moves {channel}, as {written[channel][0]} does; leave one out"
            )
            continue
        written[channel] = (str(name), sign, points)
    read: dict[str, Points] = {}
    for channel, (name, sign, points) in written.items():
        own = Mistakes.of_inputs()
        units = {row.name: row.unit for row in table.rows}
        plain = points if units.get(channel) == "rad" else _in_metres(points, own)
        waypoints = reading.waypoints(table, {channel: plain}, own)
        mistakes.found += [
            ((*at, name, *(k for k in path if k != channel)), text) for path, text in own.found
        ]
        if channel not in waypoints or own:
            continue
        t, values = waypoints[channel]
        if t[0] < 0.0:
            mistakes.add((*at, name, 0), f"comes at {t[0]:g} s; a gesture begins at 0 s")
            continue
        read[channel] = t, sign * values
    return read


def meaning(name: str, known: Mapping[str, Any]) -> tuple[str, float]:
    """Coordinate that a name moves, and the sign of the motion."""
    owner, dot, direction = str(name).rpartition(".")
    if name in known or not dot or direction not in DIRECTIONS:
        return str(name), 1.0
    part, sign = DIRECTIONS[direction]
    if not sign:
        side = _SIDE.findall(owner.rpartition(".")[2])
        if not side:
            return str(name), 1.0
        sign = (1.0 if side[-1] == "left" else -1.0) * (1.0 if direction == "out" else -1.0)
    return f"{owner}.{part}", sign


def _in_metres(points: Any, mistakes: Mistakes) -> Any:
    """Waypoints with their lengths in metres."""
    if not isinstance(points, list | tuple):
        return points
    converted = []
    for i, point in enumerate(points):
        if isinstance(point, list | tuple) and len(point) == 2:
            value = without_unit(point[1], LENGTHS)
            if isinstance(value, str):
                text = f"found {value!r}; needed: a length, as 0.12, 12 cm or 120 mm"
                mistakes.add((i,), text)
                value = 0.0
            point = (point[0], value)
        converted.append(point)
    return converted


def _unknown(name: str, channel: str, table: CoordinateTable) -> str:
    if channel in table.rotations:
        return "is a rotation; gestures are written of lengths, places and angles"
    known = pieces.channel_names(table)
    owner, _, direction = name.rpartition(".")
    owners = {n.rsplit(".", 1)[0] for n in known}
    if owner in owners and direction in DIRECTIONS:
        if channel != name:
            return f"would move {channel}, which is not a driven coordinate"
        return "needs left or right in its name"
    ways = [
        (f"{name}.{way}", f"{name}.{DIRECTIONS[way][0]}") for name in owners for way in DIRECTIONS
    ]
    names = [*known, *(way for way, moved in ways if moved in known)]
    return f"is neither a driven coordinate nor a string and a direction{nearest(name, names)}"
