"""Units of unknowns and of channels."""

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
    kinds = {row.name: row.unit for row in record.marionette.coordinates.rows}
    parameter_unit = parameter_units(plain(record.marionette.puppet), kinds)
    parts = [parameter_unit.get(unknown.name, "") for unknown in record.unknowns]
    parts += [kinds.get(name, "") for name in record.offsets]
    rest = len(record.labels) - len(parts) - int(record.find_delay)
    parts += ["m"] * rest + ["s"] * int(record.find_delay)
    return dict(zip(record.labels, parts, strict=True))


def channel_units(record: Record) -> tuple[str, ...]:
    """Unit of every channel: m, rad or N."""
    kinds = {row.name: row.unit for row in record.marionette.coordinates.rows}
    channels = record.channels
    return (
        *(["m"] * 3 * len(channels.markers)),
        *(kinds.get(name, "") for name in channels.coordinates),
        *(["N"] * len(channels.tensions)),
    )


def parameter_units(data: Any, kinds: dict[str, str]) -> dict[str, str]:
    """Unit of every parameter, from its path in a puppet's plain data.

    Args:
        data: plain data of the puppet.
        kinds: coordinate -> its unit.
    """
    units: dict[str, str] = {}
    for path, value in parameters(data):
        units.setdefault(value["parameter"], _unit(data, path, kinds))
    return units


def _unit(data: Any, path: Path, kinds: dict[str, str]) -> str:
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
        both = f"{sliding} or {turning}"
        return both if kind == "free" else _choose(kind in SLIDING_JOINTS, sliding, turning)
    if path[0] == "drives":
        on = item["on"]
        slides = kinds.get(on if isinstance(on, str) else on[0]) == "m"
        wound = "drum" in item and "control" not in keys
        return _choose(slides and not wound, sliding, turning)
    return sliding


def _choose(slides: bool, sliding: str, turning: str) -> str:
    return sliding if slides else turning
