"""Units of unknowns and of channels.

A channel is a measured number over time, and an unknown a number of the puppet file that is
estimated. A marionette is a puppet with its compiled equations; `marionette.puppet` is the
description in its file. A row of the tree describes a string, limit, spring or drive, a row of the
coordinate table one coordinate.
"""

from __future__ import annotations

from typing import Any

from fantoccini.base.documents import Path
from fantoccini.lab.identification.record import Record
from fantoccini.model.puppet import parameters, plain

KEY_UNITS = {
    "mass": "kg",
    "density": "kg/m³",
    "gravity": "m/s²",
    "linear": "N s/m",
    "quadratic": "N s²/m²",
    "angular": "N m s",
    "max_tension": "N",
    "rewind_speed": "m/s",
    "inertia": "kg m²",
    "current": "A",
    "resistance": "ohm",
    "voltage": "V",
    "bandwidth": "rad/s",
} | dict.fromkeys(("at", "com", "world", "drum", "length"), "m")
"""Units of keys that have the same unit everywhere."""
SLIDING_AND_TURNING_UNITS = {
    "damping": ("N s/m", "N m s/rad"),
    "viscous": ("N s/m", "N m s/rad"),
    "stiffness": ("N/m", "N m/rad"),
    "coulomb": ("N", "N m"),
    "torque": ("N", "N m"),
    "speed": ("m/s", "rad/s"),
    "corner_speed": ("m/s", "rad/s"),
    "rest": ("m", "rad"),
    "armature": ("kg", "kg m²"),
    "constant": ("N/A", "N m/A"),
}
"""Units of keys whose unit depends on the joint: sliding, turning."""
CHAIN_UNITS = {"stiffness": "N", "damping": "N s"}
SLIDING_JOINTS = {"prismatic", "translation"}


def units(record: Record) -> dict[str, str]:
    """Unit of every unknown, by its label; empty if it is not clear from the puppet's file."""
    coordinate_units = {row.name: row.unit for row in record.marionette.coordinates.rows}
    parameter_unit = parameter_units(plain(record.marionette.puppet), coordinate_units)
    unknown_units = [parameter_unit.get(unknown.name, "") for unknown in record.unknowns]
    unknown_units += [coordinate_units.get(name, "") for name in record.offsets]
    n_positions = len(record.labels) - len(unknown_units) - int(record.find_delay)
    unknown_units += ["m"] * n_positions + ["s"] * int(record.find_delay)
    return dict(zip(record.labels, unknown_units, strict=True))


def channel_units(record: Record) -> tuple[str, ...]:
    """Unit of every channel: m, rad or N."""
    coordinate_units = {row.name: row.unit for row in record.marionette.coordinates.rows}
    channels = record.channels
    return (
        *(["m"] * 3 * len(channels.markers)),
        *(coordinate_units.get(name, "") for name in channels.coordinates),
        *(["N"] * len(channels.tensions)),
    )


def parameter_units(data: Any, coordinate_units: dict[str, str]) -> dict[str, str]:
    """Unit of every parameter, from its path in a puppet's plain data.

    Args:
        data: plain data of the puppet.
        coordinate_units: coordinate -> its unit.
    """
    units: dict[str, str] = {}
    for path, value in parameters(data):
        units.setdefault(value["parameter"], _unit(data, path, coordinate_units))
    return units


def _unit(data: Any, path: Path, coordinate_units: dict[str, str]) -> str:
    keys = [key for key in path if isinstance(key, str)]
    key = keys[-1]
    if "chain" in keys and key in CHAIN_UNITS:
        return CHAIN_UNITS[key]
    if key not in SLIDING_AND_TURNING_UNITS:
        return KEY_UNITS.get(key, "")
    sliding, turning = SLIDING_AND_TURNING_UNITS[key]
    item = data[path[0]][path[1]]
    if "joint" in keys:
        kind = item["joint"]["type"]
        either_unit = f"{sliding} or {turning}"
        return either_unit if kind == "free" else _choose(kind in SLIDING_JOINTS, sliding, turning)
    if path[0] == "drives":
        targets = item["on"]
        is_sliding = (
            coordinate_units.get(targets if isinstance(targets, str) else targets[0]) == "m"
        )
        is_winch = "drum" in item and "control" not in keys
        return _choose(is_sliding and not is_winch, sliding, turning)
    return sliding


def _choose(is_sliding: bool, sliding: str, turning: str) -> str:
    return sliding if is_sliding else turning
