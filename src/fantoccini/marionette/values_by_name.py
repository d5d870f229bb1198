"""States by name: one value put into the arrays of a state."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import StateError, UnknownNameError
from fantoccini.motion import reading
from fantoccini.motion.rotation import exp
from fantoccini.tree import CoordinateTable, DriveRow


def put(
    table: CoordinateTable, name: str, value, q_D: Array, v_D: Array, q_K: Array, v_K: Array
) -> None:
    """Sets one named value in the arrays it belongs to.

    Args:
        table: names and places of all coordinates.
        name: of a coordinate; ``joint.rotation`` for a rotation; ``v:NAME`` for a velocity.
        value: a number, an angle such as ``30 deg``, or a quaternion (w, x, y, z) or rotation
            vector.
        q_D, v_D, q_K, v_K: changed in place.

    Raises:
        StateError: the value is not what the name takes.
        UnknownNameError: the puppet has no such coordinate.
    """
    number = _numbers(table, name, value)
    if not np.all(np.isfinite(number)):
        raise StateError(f"{name}: found {value}; it must be finite")
    length = name.endswith(".length") and not name.startswith("v:")
    if length and number.ndim == 0 and number <= 0:
        raise StateError(f"{name}: found {value}; a length must be positive")
    scalar = name.startswith("v:") or name in table.q_D or name in table.q_K
    if scalar and number.ndim:
        raise StateError(f"{name}: found {number.size} numbers; it takes one")
    for names, target in ((table.q_D, q_D), (table.q_K, q_K)):
        if name in names:
            target[names.index(name)] = float(number)
            return
        if name.endswith(".rotation") and name[: -len("rotation")] + "qw" in names:
            at = names.index(name[: -len("rotation")] + "qw")
            target[at : at + 4] = _quaternion(name, number)
            return
    if name.startswith("v:"):
        for names, target in ((table.v_D, v_D), (table.v_K, v_K)):
            if name[2:] in names:
                target[names.index(name[2:])] = float(number)
                return
        raise UnknownNameError("velocity", name[2:], (*table.v_D, *table.v_K))
    rotations = [n[:-2] + "rotation" for n in (*table.q_D, *table.q_K) if n.endswith(".qw")]
    raise UnknownNameError("coordinate", name, (*table.q_D, *table.q_K, *rotations))


def put_commands(
    drives: Iterable[DriveRow], named: Container[str], q_D: Array, q_K: Array
) -> None:
    """Sets the commands of drives to where their coordinates are, but for those that are named.

    Their velocities stay as they are: inputs begin at rest wherever the coordinates rush to.

    Args:
        drives: rows of the drives.
        named: names that have their value already.
        q_D: (n_qD,).
        q_K: (n_qK,) changed in place.
    """
    for row in drives:
        if row.command is None or row.command_name in named:
            continue
        q, _ = row.command
        q_K[q : q + row.q.stop - row.q.start] = q_D[row.q]


def _numbers(table: CoordinateTable, name: str, value) -> Array:
    """A number or numbers; angles may be text such as ``30 deg``.

    Raises:
        StateError: they are neither.
    """
    angles = any(row.name == name and row.unit == "rad" for row in table.rows)
    try:
        if isinstance(value, str):
            return np.array(reading.number(value, angles))
        if isinstance(value, Sequence) and any(isinstance(x, str) for x in value):
            turns = name.endswith(".rotation") and len(value) == 3
            return np.array([reading.number(x, turns) for x in value])
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise StateError(
            f"{name}: found {value!r}; it takes a number of metres or radians, an angle such as "
            "'30 deg' where it is one, or a rotation"
        ) from None


def _quaternion(name: str, value: Array) -> Array:
    if value.shape == (3,):
        return exp(value)
    size = np.linalg.norm(value)
    if value.shape != (4,) or size == 0:
        raise StateError(
            f"{name}: found {value.tolist()}; it takes a quaternion (w, x, y, z), not all zero, or "
            "a rotation vector of three numbers"
        )
    return value / size
