"""Converts a user's numbers, lists and names to arrays, and collects every mistake.

Driven coordinates are given by inputs: ends and lengths of strings, driven joints. A drive moves
one by a motor; its command is then the input. In names, D stands for dynamic coordinates, which
move by the equations of motion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike
from pydantic import TypeAdapter, ValidationError

from fantoccini.base import Array, Times, did_you_mean, is_number, rotation
from fantoccini.base.documents import Angle, Mistakes, Path, shown
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion.channel import SAME_TIME, Points
from fantoccini.motion.pieces import channel_names


class Limits(NamedTuple):
    """Bounds of numbers in inputs."""

    max_number: float = 1e9
    """Largest time or value [s, m, rad or N], so that no polynomial overflows."""
    max_turn: float = np.pi - 1e-6
    """Largest turn between neighbouring rotations [rad]; above, the shortest way is ambiguous."""
    min_quaternion: float = 1e-9
    """Smallest size of a quaternion's largest number [1]; below, its direction is rounding."""


LIMITS = Limits()
_ANGLE = TypeAdapter(Angle)
_QUATERNION = ("qw", "qx", "qy", "qz")
"""Column names of a rotation."""

_NUMBER = f"a finite number up to {LIMITS.max_number:g}"
_ROTATION = "a quaternion [w, x, y, z] or a rotation vector of 3 angles"


class HasCoordinates(Protocol):
    """An object with a coordinate table: a marionette, a trajectory, a tree."""

    @property
    def coordinates(self) -> CoordinateTable: ...


Table = CoordinateTable | HasCoordinates
"""Argument that contains the coordinates."""


def table_of(owner: Table) -> CoordinateTable:
    """``owner`` itself if it is a coordinate table, or its coordinate table."""
    table = owner if isinstance(owner, CoordinateTable) else getattr(owner, "coordinates", None)
    if not isinstance(table, CoordinateTable):
        raise TypeError(
            f"found {owner!r:.80}, a {type(owner).__name__}; needed: a Marionette, as fan.load or "
            "fan.puppets give it, or its coordinates"
        )
    return table


def unknown_coordinate(table: CoordinateTable, name: str) -> str:
    """Error message for a name that is not a driven coordinate."""
    for channel, (_, v) in table.rotations.items():
        quaternion_names = [
            column for columns in _quaternions(table, channel).values() for column in columns
        ]
        if name in (*quaternion_names, *table.v_K[v : v + 3]):
            return f"is one number of a rotation; drive {channel!r} as a whole"
    if name in table.q_D or name in table.v_D:
        return "moves by itself: it is dynamic, and inputs drive the driven coordinates only"
    return f"is not a driven coordinate{did_you_mean(str(name), channel_names(table))}"


def _quaternions(table: CoordinateTable, channel: str) -> dict[str, list[str]]:
    """Names of a rotation channel and of the coordinate it commands -> their four columns."""
    names = [channel, *(name for name, command in table.commands.items() if command == channel)]
    return {name: [name.removesuffix("rotation") + x for x in _QUATERNION] for name in names}


def _given_once(
    name: str, given_name: str, given_names: dict[str, str], path: Path, mistakes: Mistakes
) -> bool:
    """Whether a channel has one name only, its own or its coordinate's; reports a second one."""
    first_name = given_names.setdefault(name, given_name)
    if first_name != given_name:
        mistakes.add(path, f"is given twice: as {first_name} and as {given_name}; leave one out")
    return first_name == given_name


def waypoints(
    table: CoordinateTable,
    points_by_name: Mapping[str, Any],
    mistakes: Mistakes,
    parent_path: Path = (),
) -> dict[str, Points]:
    """Reads ``{name: [(t, value), ...]}`` for driven coordinates and coordinates with a drive.

    Args:
        table: names of the coordinates.
        points_by_name: waypoints as the user wrote them.
        mistakes: collects them.
        parent_path: path of ``points_by_name`` itself.

    Returns:
        Times and values of every name without a mistake.
    """
    slices, series_by_name = channel_names(table), {}
    given_names: dict[str, str] = {}
    units = {row.name: row.unit for row in table.rows}
    for given_name, points in points_by_name.items():
        path, name = (*parent_path, str(given_name)), table.commands.get(given_name, given_name)
        if name not in slices:
            mistakes.add(path, unknown_coordinate(table, name))
            continue
        if not _given_once(name, given_name, given_names, path, mistakes):
            continue
        if name in table.rotations:
            rotations = series(points, mistakes, path, _quaternion)
            if rotations is not None and _are_turns_unambiguous(
                points, rotations[1], mistakes, path
            ):
                series_by_name[name] = rotations
        else:
            scalar = partial(number, angle=units.get(name) == "rad")
            values = series(points, mistakes, path, scalar)
            if values is not None:
                series_by_name[name] = values
    return series_by_name


def forces(
    table: CoordinateTable,
    points_by_name: Mapping[str, Any],
    mistakes: Mistakes,
    parent_path: Path = (),
) -> dict[str, Points]:
    """Reads ``{name: [(t, force), ...]}`` for dynamic velocities; two equal times are a step."""
    series_by_name = {}
    for name, points in points_by_name.items():
        path = (*parent_path, str(name))
        if name not in table.v_D:
            mistakes.add(
                path, f"is not the name of a dynamic velocity{did_you_mean(str(name), table.v_D)}"
            )
            continue
        values = series(points, mistakes, path, number, allow_steps=True)
        if values is not None:
            series_by_name[name] = values
    return series_by_name


def number(value: Any, angle: bool = False) -> float:
    """A finite number, or an angle such as ``30 deg`` if ``angle`` is True.

    Raises:
        ValueError: the value is not such a number; the message is for the user.
    """
    if isinstance(value, str) and angle:
        try:
            return number(_ANGLE.validate_python(value))
        except ValidationError as error:
            raise ValueError(error.errors()[0]["msg"]) from None
    if not is_number(value):
        raise ValueError(f"found {shown(value)}; needed: a number")
    # Checked before conversion: an integer may be too large for a float.
    if not abs(value) <= LIMITS.max_number:
        raise ValueError(f"found {shown(value)}; needed: {_NUMBER}")
    return float(value)


def _quaternion(value: Any) -> Array:
    """A quaternion from four numbers w, x, y, z or from a rotation vector of three [rad]."""
    if isinstance(value, str) or not isinstance(value, Sequence | np.ndarray):
        raise ValueError(f"found {shown(value)}; needed: {_ROTATION}")
    parts = np.array([number(x, angle=len(value) == 3) for x in value])
    if len(parts) == 3:
        return rotation.exp(parts)
    if len(parts) != 4:
        raise ValueError(f"found {len(parts)} numbers; needed: {_ROTATION}")
    if not np.any(np.abs(parts) > LIMITS.min_quaternion):
        raise ValueError("found a zero quaternion, which is no rotation")
    return rotation.normalised(parts)


def series(
    points: Any,
    mistakes: Mistakes,
    path: Path,
    convert: Callable[[Any], float | Array],
    allow_steps: bool = False,
) -> Points | None:
    """Times and values of one channel; None when a mistake was found."""
    n_before = len(mistakes)
    if isinstance(points, str | Mapping) or not isinstance(points, Sequence | np.ndarray):
        mistakes.add(path, f"found {shown(points)}; needed: a list of pairs [time, value]")
        return None
    if len(points) == 0:
        mistakes.add(path, "found no waypoints; one or more needed")
        return None
    times: list[float] = []
    values: list[float | Array] = []
    for i, point in enumerate(points):
        is_pair = not isinstance(point, str | Mapping) and isinstance(point, Sequence | np.ndarray)
        if not is_pair or len(point) != 2:
            mistakes.add((*path, i), f"found {shown(point)}; needed: a pair [time, value]")
            continue
        try:
            t = number(point[0])
        except ValueError as error:
            mistakes.add((*path, i), f"the time: {error}")
            continue
        if times and not (t - times[-1] > SAME_TIME or (allow_steps and t >= times[-1])):
            mistakes.add((*path, i), _order_message(t, times[-1]))
        times.append(t)
        try:
            values.append(convert(point[1]))
        except ValueError as error:
            mistakes.add((*path, i), f"the value: {error}")
    if len(mistakes) > n_before:
        return None
    return np.array(times), np.array(values)


def _order_message(t: float, previous: float) -> str:
    if abs(t - previous) <= SAME_TIME:
        return (
            f"comes at t = {t:g} s like the waypoint before it, which would be a step in position; "
            "leave time between them"
        )
    return f"comes at t = {t:g} s, after a waypoint at {previous:g} s; times must increase"


def _are_turns_unambiguous(points: Any, q: Array, mistakes: Mistakes, path: Path) -> bool:
    """Whether neighbouring rotations are less than 180 deg apart, as written and as quaternions."""
    turn = np.linalg.norm(rotation.between(q[:-1], q[1:]), axis=-1)
    for i in range(len(q) - 1):
        if len(points[i][1]) == len(points[i + 1][1]) == 3:
            before, after = ([number(x, angle=True) for x in points[k][1]] for k in (i, i + 1))
            difference = np.subtract(after, before)
            turn[i] = max(turn[i], float(np.linalg.norm(difference)))
    too_large = np.flatnonzero(turn >= LIMITS.max_turn).tolist()
    for i in too_large:
        mistakes.add(
            (*path, i + 1),
            f"turns by {np.degrees(turn[i]):.0f} deg from the waypoint before it, at "
            f"t = {points[i][0]:g} s; from 180 deg on the way is ambiguous: add waypoints between",
        )
    return not len(too_large)


def samples(
    table: CoordinateTable, t: ArrayLike, columns: Mapping[str, ArrayLike], mistakes: Mistakes
) -> dict[str, Points]:
    """Reads samples: times and named columns; a rotation is (n, 4), or four columns.

    Args:
        table: names of the coordinates.
        t: (n,) times [s].
        columns: name -> (n,) values, or (n, 4) quaternions for ``bar.rotation``.
        mistakes: collects them.

    Returns:
        Times and values of every name; empty after a mistake.
    """
    n_before, slices = len(mistakes), channel_names(table)
    times = _column("t", t, None, (), mistakes)
    if times is not None and not len(times):
        mistakes.add(("t",), "found no samples; one or more needed")
    if times is None or not len(times):
        return {}
    for i in np.nonzero(~(np.diff(times) > SAME_TIME))[0]:
        mistakes.add(("t", int(i) + 1), _order_message(times[i + 1], times[i]))
    remaining: dict[str, Any] = dict(columns)
    series_by_name: dict[str, Points] = {}
    given_names: dict[str, str] = {}
    quaternion_columns = {
        n: column_names
        for c in table.rotations
        for n, column_names in _quaternions(table, c).items()
    }
    for name, column_names in quaternion_columns.items():
        present = [part for part in column_names if part in remaining]
        if not present:
            continue
        missing = [part for part in column_names if part not in remaining]
        if missing:
            mistakes.add((present[0],), f"needs the columns {', '.join(missing)} as well")
        if name in remaining:
            mistakes.add((name,), f"is given twice: as a whole and as {', '.join(present)}")
        quaternion_parts = [_column(p, remaining.pop(p), len(times), (), mistakes) for p in present]
        valid_parts = [column for column in quaternion_parts if column is not None]
        if not missing and len(valid_parts) == len(present):
            remaining[name] = np.stack(valid_parts, axis=-1)
    for given_name, values in remaining.items():
        name = table.commands.get(given_name, given_name)
        if name not in slices:
            mistakes.add((str(name),), unknown_coordinate(table, name))
            continue
        if not _given_once(name, given_name, given_names, (str(given_name),), mistakes):
            continue
        shape = (4,) if name in table.rotations else ()
        numbers = _column(name, values, len(times), shape, mistakes)
        if numbers is not None and shape:
            numbers = _unit_quaternions(name, times, numbers, mistakes)
        if numbers is not None:
            series_by_name[name] = (times, numbers)
    return series_by_name if len(mistakes) == n_before else {}


def _column(
    name: str, column: ArrayLike, n: int | None, shape: tuple[int, ...], mistakes: Mistakes
) -> Array | None:
    """A column as finite numbers (n, *shape); None after a mistake."""
    values = np.asarray(column)
    if values.dtype.kind not in "iuf":
        mistakes.add((name,), f"found {values.dtype.name} values; needed: numbers")
        return None
    needed_shape = (values.shape[0] if n is None and values.ndim else n, *shape)
    if values.shape != needed_shape:
        sizes = " x ".join("n" if size is None else str(size) for size in needed_shape)
        mistakes.add((name,), f"found the shape {values.shape}; needed: {sizes}, as for t")
        return None
    is_wrong = ~(np.abs(values) <= LIMITS.max_number)
    wrong_samples = np.unique(np.nonzero(is_wrong)[0])
    for i in wrong_samples:
        mistakes.add((name, int(i)), f"found {values[i]}; needed: {_NUMBER}")
    return None if len(wrong_samples) else values.astype(float)


def _unit_quaternions(name: str, t: Times, q: Array, mistakes: Mistakes) -> Array | None:
    """Unit quaternions; None when one is zero or neighbours are half a turn apart."""
    zero = np.nonzero(~np.any(np.abs(q) > LIMITS.min_quaternion, axis=-1))[0]
    for i in zero:
        mistakes.add((name, int(i)), "found a zero quaternion, which is no rotation")
    if len(zero):
        return None
    q = rotation.normalised(q)
    turn = np.linalg.norm(rotation.between(q[:-1], q[1:]), axis=-1)
    too_large = np.nonzero(turn >= LIMITS.max_turn)[0]
    for i in too_large:
        mistakes.add(
            (name, int(i) + 1),
            f"turns by {np.degrees(turn[i]):.0f} deg since t = {t[i]:g} s; it must be less than "
            "180 deg from sample to sample",
        )
    return None if len(too_large) else q
