"""States at rest from values by name.

q_D are the dynamic coordinates and q_K the driven ones (ends and lengths of strings, driven
joints). A drive moves a dynamic coordinate by a motor towards its command, which is then the driven
one. A row of the tree describes a string, limit, spring or drive, a row of the coordinate table one
coordinate.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError, exp, floats
from fantoccini.dynamics.compiled import CompiledPuppet
from fantoccini.model import tree
from fantoccini.model.tree import CoordinateTable, DriveRow
from fantoccini.motion import State, reading

Value = float | str | Iterable[float | str]
"""A number, an angle such as ``30 deg``, a quaternion (w, x, y, z) or a rotation vector."""
Values = Mapping[str, Value]


def state(marionette: CompiledPuppet, values: Values | None = None) -> State:
    """A state at rest from values by name; see :meth:`Marionette.state`."""
    if values is not None and not isinstance(values, Mapping):
        raise StateError(
            f"found {values!r}; a state is given as names and values: {{'hand.length': 0.8}}"
        )
    table = marionette.coordinates
    q_D, q_K = table.start_D.copy(), table.start_K.copy()
    v_D, v_K = np.zeros(table.n_vD), np.zeros(table.n_vK)
    for name, value in (values or {}).items():
        _set_value(table, name, value, q_D, v_D, q_K, v_K)
    # Masses of chains are placed between the ends in this state, not in the file's pose.
    q_D, q_K = tree.placed(marionette.tree, q_D, q_K, marionette.number, frozenset(values or ()))
    if np.any(np.isnan(q_K)) or np.any(np.isnan(q_D)):
        configuration = {"q_D": np.nan_to_num(q_D), "q_K": np.nan_to_num(q_K)}
        h = marionette.library.evaluate("rows", **configuration, p=marionette.p).h
        for string, path_length in zip(marionette.tree.strings, h, strict=False):
            string.set_unknown_length(path_length, q_D, q_K)
    set_commands(marionette.tree.drives, values or {}, q_D, q_K)
    taut, slip = (
        np.zeros(marionette.tree.n_rows, dtype=bool),
        np.zeros(len(marionette.tree.strings)),
    )
    return State(0.0, q_D, v_D, q_K, v_K, taut, slip, table)


def _set_value(
    table: CoordinateTable, name: str, value: Value, q_D: Array, v_D: Array, q_K: Array, v_K: Array
) -> None:
    """Sets one named value in its array."""
    numbers = _numbers(table, name, value)
    if not np.all(np.isfinite(numbers)):
        raise StateError(f"{name}: found {value}; it must be finite")
    length = name.endswith(".length") and not name.startswith("v:")
    if length and numbers.ndim == 0 and numbers <= 0:
        raise StateError(f"{name}: found {value}; a length must be positive")
    scalar = name.startswith("v:") or name in table.q_D or name in table.q_K
    if scalar and numbers.ndim:
        raise StateError(f"{name}: found {numbers.size} numbers; needed: one")
    for names, target in ((table.q_D, q_D), (table.q_K, q_K)):
        if name in names:
            target[names.index(name)] = float(numbers)
            return
        if name.endswith(".rotation") and name[: -len("rotation")] + "qw" in names:
            start = names.index(name[: -len("rotation")] + "qw")
            target[start : start + 4] = _quaternion(name, numbers)
            return
    if name.startswith("v:"):
        for names, target in ((table.v_D, v_D), (table.v_K, v_K)):
            if name[2:] in names:
                target[names.index(name[2:])] = float(numbers)
                return
        raise UnknownNameError("velocity", name[2:], (*table.v_D, *table.v_K))
    rotations = [n[:-2] + "rotation" for n in (*table.q_D, *table.q_K) if n.endswith(".qw")]
    raise UnknownNameError("coordinate", name, (*table.q_D, *table.q_K, *rotations))


def set_commands(
    drives: Iterable[DriveRow], given_names: Container[str], q_D: Array, q_K: Array
) -> None:
    """Sets commands of drives in q_K to their coordinates in q_D, except those in ``given_names``.

    Their velocities are unchanged: inputs begin at rest even if the coordinates move.
    """
    for row in drives:
        if row.command is None or row.command_name in given_names:
            continue
        q, _ = row.command
        q_K[q : q + row.q.stop - row.q.start] = q_D[row.q]


def _numbers(table: CoordinateTable, name: str, value: Value) -> Array:
    is_angle = any(row.name == name and row.unit == "rad" for row in table.rows)
    try:
        if isinstance(value, str):
            return np.array(reading.number(value, is_angle))
        if isinstance(value, Sequence) and any(isinstance(x, str) for x in value):
            are_angles = name.endswith(".rotation") and len(value) == 3
            return np.array([reading.number(x, are_angles) for x in value])
        return floats(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise StateError(
            f"{name}: found {value!r}; needed: a number of metres or radians, an angle such as "
            "'30 deg' where it is one, or a rotation"
        ) from None


def _quaternion(name: str, value: Array) -> Array:
    if value.shape == (3,):
        return exp(value)
    size = np.linalg.norm(value)
    if value.shape != (4,) or size == 0:
        raise StateError(
            f"{name}: found {value.tolist()}; needed: a quaternion (w, x, y, z), not all zero, or "
            "a rotation vector of three numbers"
        )
    return value / size
