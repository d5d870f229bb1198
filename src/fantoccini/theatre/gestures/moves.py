"""Names in gestures: driven coordinates, or strings, bodies and directions; mirror images.

Driven coordinates q_K are ends and lengths of strings and driven joints; v_K are their velocities,
and an orientation has three. A channel is a coordinate, or the three parts of a rotation vector. A
row of the tree describes a string, limit, spring or drive, a row of the coordinate table one
coordinate.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.base import Array, MaskRows, StateError, UnknownNameError, did_you_mean
from fantoccini.base.documents import LENGTHS, Mistakes, Path, shown, without_unit
from fantoccini.motion import Points, pieces, reading

if TYPE_CHECKING:
    from fantoccini.model.tree import CoordinateTable

DIRECTIONS: dict[str, tuple[tuple[str, float], ...]] = {
    "up": (("length", -1.0), ("z", 1.0)),
    "down": (("length", 1.0), ("z", -1.0)),
    "forward": (("x", 1.0),),
    "back": (("x", -1.0),),
    "left": (("y", 1.0),),
    "right": (("y", -1.0),),
    "out": (("y", 0.0),),
    "in": (("y", 0.0),),
    "tip_forward": (("wy", 1.0),),
    "tip_back": (("wy", -1.0),),
    "roll_left": (("wx", -1.0),),
    "roll_right": (("wx", 1.0),),
    "turn_left": (("wz", 1.0),),
    "turn_right": (("wz", -1.0),),
}
"""Direction -> pairs (coordinate, sign), tried in order: a string or body uses the first pair whose
coordinate it has. A sign of 0 depends on the side, left or right. ``wx``, ``wy`` and ``wz`` are the
components of a rotation vector."""
MAX_TURN = np.pi - 0.05
"""Largest rotation of a driven body from rest [rad]; rotation vectors are not unique from pi on."""

_SUFFIXES = ("length", "x", "y", "z", "rotation")
_SIDE_WORD = re.compile(r"(?<![a-z])(left|right)(?![a-z])")
_OTHER_SIDE = {"left": "right", "right": "left"}
_AXIS_TOLERANCE = 1e-6
"""Tolerance of the numbers of an axis that lies along x, y or z."""


def split_name(name: str) -> tuple[str, str, str]:
    """Prefix of a coordinate's owner, the owner, and the rest after it.

    ``pierrot.``, ``hand_left`` and ``.length``: the sides of a scene's puppets do not count.
    """
    parts = name.split(".")
    owner_index = len(parts) - 2 if len(parts) > 1 and parts[-1] in _SUFFIXES else len(parts) - 1
    prefix, rest = "".join(f"{part}." for part in parts[:owner_index]), parts[owner_index + 1 :]
    return prefix, parts[owner_index], "".join(f".{part}" for part in rest)


def mirrored_name(name: str) -> str:
    """Name with left and right exchanged in its owner."""
    prefix, owner, suffix = split_name(name)
    return prefix + _SIDE_WORD.sub(lambda side: _OTHER_SIDE[side[1]], owner) + suffix


def scalar_indices(table: CoordinateTable) -> dict[str, int]:
    """Name of a driven scalar coordinate, or of a part of a rotation vector -> index in v_K."""
    scalars = {table.q_K[q]: v for q, v in table.scalars_K}
    turns = (v + i for _, v in table.rotations.values() for i in range(3))
    return scalars | {table.v_K[v]: v for v in turns}


def names_and_units(table: CoordinateTable) -> list[tuple[str, str]]:
    """Name of the input that drives each velocity of v_K, and its unit: ``m`` or ``rad``."""
    units = {row.name: row.unit for row in table.rows}
    names = [("", "")] * table.n_vK
    for name, (_, v) in pieces.channel_names(table).items():
        names[v] = [(name, units.get(name, "rad"))] * (v.stop - v.start)
    return names


def mirror_signs(name: str, table: CoordinateTable) -> Array | None:
    """Signs of a coordinate's components under reflection in the x-z plane; None if unknown.

    Equal angles of joints on both sides are mirror images, as in puppet files. In the middle the
    axis decides: an axis along y and one across it have mirror images of opposite signs.
    """
    if name.endswith(".rotation"):
        return np.array([-1.0, 1.0, -1.0])
    if split_name(name)[2] and name not in table.axes:
        return np.array([-1.0 if name.endswith(".y") else 1.0])
    if mirrored_name(name) != name:
        return np.array([1.0])
    axis = table.axes.get(name)
    if axis is None or _AXIS_TOLERANCE < abs(axis[1]) < 1.0 - _AXIS_TOLERANCE:
        return None
    turns, along_y = _units(table)[name] == "rad", abs(axis[1]) > _AXIS_TOLERANCE
    return np.array([1.0 if turns == along_y else -1.0])


def mirror_images(table: CoordinateTable, named: MaskRows) -> list[tuple[slice, slice, Array]]:
    """Places in v_K of moved coordinates and of their mirror images, and the images' signs.

    Raises:
        UnknownNameError: a coordinate has no twin.
        StateError: a joint in the middle has an axis that is neither along y nor across it.
    """
    channels = pieces.channel_names(table)
    pairs = []
    for name, (_, v) in channels.items():
        if not named[v.start]:
            continue
        if mirrored_name(name) not in channels:
            raise UnknownNameError("driven coordinate", mirrored_name(name), list(channels))
        sign = mirror_signs(name, table)
        if sign is None:
            raise StateError(f"the mirror image of the joint {name} is not known")
        pairs.append((v, channels[mirrored_name(name)][1], sign))
    return pairs


def xy_indices(table: CoordinateTable, named: MaskRows) -> list[tuple[int, int]]:
    """Indices in v_K of x and y of every end or body that is moved along one of them.

    Those whose axes turn with a body that carries them are left out.

    Args:
        table: names of the coordinates.
        named: (n_vK,) bool, whether a coordinate is moved.

    Raises:
        StateError: it is driven along only one of them.
    """
    channels, indices = pieces.channel_names(table), dict[str, tuple[int, int]]()
    for name, (_, v) in channels.items():
        owner, _, part = name.rpartition(".")
        if owner in table.carried or name in table.axes:  # a joint may have the name x
            continue
        if named[v.start] and owner and part in ("x", "y"):
            other_name = f"{owner}.{'y' if part == 'x' else 'x'}"
            if other_name not in channels:
                raise StateError(f"it moves {name}, and {other_name} is not driven")
            indices[owner] = channels[f"{owner}.x"][1].start, channels[f"{owner}.y"][1].start
    return list(indices.values())


def read_offsets(
    table: CoordinateTable, points: Mapping[str, Any], mistakes: Mistakes, keys: Path = ()
) -> dict[str, Points]:
    """Driven scalar coordinate or part of a rotation vector -> times and offsets.

    Names are those of :meth:`Gesture.from_points`.
    """
    offsets: dict[str, Points] = {}
    movers: dict[str, str] = {}
    for name, series_points in points.items():
        name_keys = (*keys, str(name))
        channel, sign = driven_coordinate(str(name), table)
        scalars = scalar_names(channel, table)
        if not scalars:
            mistakes.add(name_keys, _unknown_name_text(str(name), channel, table))
            continue
        if earlier_movers := [movers[part] for part in scalars if part in movers]:
            mistakes.add(name_keys, f"moves {channel}, as {earlier_movers[0]} does; leave one out")
            continue
        movers |= dict.fromkeys(scalars, str(name))
        waypoints = reading.series(
            series_points, mistakes, name_keys, _offset_reader(channel, table)
        )
        if waypoints is None:
            continue
        t, values = waypoints
        if t[0] < 0.0:
            mistakes.add((*name_keys, 0), f"comes at {t[0]:g} s; a gesture begins at 0 s")
            continue
        columns = values.reshape(len(t), len(scalars)).T
        offsets |= {part: (t, sign * column) for part, column in zip(scalars, columns, strict=True)}
    return offsets


def driven_coordinate(name: str, table: CoordinateTable) -> tuple[str, float]:
    """Coordinate, or part of a rotation vector, that a name moves, and the sign of the motion."""
    indices, (owner, dot, direction) = scalar_indices(table), name.rpartition(".")
    if name in table.rotations or name in indices or not dot or direction not in DIRECTIONS:
        return table.commands.get(name, name), 1.0
    joint = table.commands.get(owner, owner)
    for part, sign in DIRECTIONS[direction]:
        if joint in table.axes and part[-1] in "xyz":
            axis = table.axes[joint]["xyz".index(part[-1])]
            is_angle = _units(table).get(joint) == "rad"
            if abs(axis) > 1.0 - _AXIS_TOLERANCE and sign and is_angle == part.startswith("w"):
                return joint, sign * np.sign(axis)
        channel = _command_or_coordinate(owner, part, table)
        if channel in indices:
            break
    else:
        part, sign = DIRECTIONS[direction][0]
        channel = f"{owner}.{part}"
    if not sign:
        side = _SIDE_WORD.findall(owner.rpartition(".")[2])
        if not side:
            return name, 1.0
        sign = (1.0 if side[-1] == "left" else -1.0) * (1.0 if direction == "out" else -1.0)
    return channel, sign


def _command_or_coordinate(owner: str, part: str, table: CoordinateTable) -> str:
    """Name of a coordinate, or of its command if a drive moves it."""
    if part.startswith("w"):
        rotation_name = f"{owner}.rotation"
        return table.commands.get(rotation_name, rotation_name).removesuffix("rotation") + part
    return table.commands.get(f"{owner}.{part}", f"{owner}.{part}")


def scalar_names(channel: str, table: CoordinateTable) -> list[str]:
    """Scalars that a channel consists of; none if it is not driven."""
    if channel in table.rotations:
        v = table.rotations[channel][1]
        return list(table.v_K[v : v + 3])
    return [channel] if channel in scalar_indices(table) else []


def _units(table: CoordinateTable) -> dict[str, str]:
    """Coordinate -> unit."""
    return {row.name: row.unit for row in table.rows}


def _offset_reader(channel: str, table: CoordinateTable) -> Callable[[Any], float | Array]:
    """Reads the offset of a waypoint."""
    if channel in table.rotations:
        return _read_rotation_vector
    unit = _units(table).get(channel, "")
    if unit == "rad":
        return partial(reading.number, angle=True)
    return _read_length if unit == "m" else _read_angle


def _read_length(value: Any) -> float:
    value = without_unit(value, LENGTHS)
    if isinstance(value, str):
        raise ValueError(f"found {value!r}; needed: a length, as 0.12, 12 cm or 120 mm")
    return reading.number(value)


def _read_angle(value: Any) -> float:
    return float(_checked_turn(np.array([reading.number(value, angle=True)]))[0])


def _read_rotation_vector(value: Any) -> Array:
    if not isinstance(value, list | tuple | np.ndarray) or len(value) != 3:
        text = (
            "a rotation vector of 3 angles, as [0, 15 deg, 0], or a direction, as bar.tip_forward"
        )
        raise ValueError(f"found {shown(value)}; needed: {text}")
    return _checked_turn(np.array([reading.number(x, angle=True) for x in value]))


def _checked_turn(vector: Array) -> Array:
    """The vector, if it is a turn of less than half a circle."""
    angle = float(np.linalg.norm(vector))
    if angle > MAX_TURN:
        raise ValueError(
            f"found a turn by {np.degrees(angle):.0f} deg; a gesture turns a body by at most "
            f"{np.degrees(MAX_TURN):.0f} deg"
        )
    return vector


def _unknown_name_text(name: str, channel: str, table: CoordinateTable) -> str:
    known = {**pieces.channel_names(table), **scalar_indices(table)}
    owner, _, direction = name.rpartition(".")
    owners = {scalar if scalar in table.axes else scalar.rsplit(".", 1)[0] for scalar in known}
    if owner in owners and direction in DIRECTIONS:
        if direction in ("out", "in") and channel == name:
            return "needs left or right in its name"
        possible_directions = [
            candidate
            for candidate in DIRECTIONS
            if driven_coordinate(f"{owner}.{candidate}", table)[0] in known
        ]
        return f"is no direction of {owner}, which can move {', '.join(possible_directions)}"
    owner_directions = [
        f"{possible_owner}.{candidate}" for possible_owner in owners for candidate in DIRECTIONS
    ]
    names = [
        *pieces.channel_names(table),
        *(
            moved_name
            for moved_name in owner_directions
            if driven_coordinate(moved_name, table)[0] in known
        ),
    ]
    needed = "a driven coordinate, or a string or a driven body and a direction"
    return f"is not {needed}{did_you_mean(name, names)}"


def not_driven(name: str, on_control: bool) -> str:
    """Name of a coordinate that a gesture moves and a puppet lacks, and what the gesture needs.

    Args:
        name: name of the coordinate.
        on_control: whether the gesture has moves for puppets on controls.
    """
    needed = "strings with driven lengths and with ends driven in x and y"
    if on_control:
        needed += ", or a driven control that carries the trunk on strings of fixed length"
    return f"{name}, which is not a driven coordinate; needed: {needed} (docs/gestures.md)"
