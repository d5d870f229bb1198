"""Units of what is looked for and of what is measured."""

from __future__ import annotations

from typing import Any

from fantoccini.base.documents import Path
from fantoccini.lab.identification.record import Record
from fantoccini.model.puppet import parameters, plain

_UNITS = {
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
"""Of keys that have one unit everywhere."""
_KINDS = {
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
"""Of keys that mean one thing where something slides, and another where it turns."""
_OF_CHAIN = {"stiffness": "N", "damping": "N s"}
_SLIDING = {"prismatic", "translation"}


def units(record: Record) -> dict[str, str]:
    """Unit of every unknown, by its label; empty where the puppet's file does not tell it."""
    kinds = {row.name: row.unit for row in record.marionette.coordinates.rows}
    found = parameter_units(plain(record.marionette.puppet), kinds)
    parts = [found.get(one.name, "") for one in record.unknowns]
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
    """Unit of every parameter, by where it stands in a puppet's plain data.

    Args:
        data: of the puppet.
        kinds: coordinate -> its unit.
    """
    found: dict[str, str] = {}
    for path, value in parameters(data):
        found.setdefault(value["parameter"], _unit(data, path, kinds))
    return found


def _unit(data: Any, path: Path, kinds: dict[str, str]) -> str:
    keys = [key for key in path if isinstance(key, str)]
    key = keys[-1]
    if "chain" in keys and key in _OF_CHAIN:
        return _OF_CHAIN[key]
    if key not in _KINDS:
        return _UNITS.get(key, "")
    sliding, turning = _KINDS[key]
    item = data[path[0]][path[1]]
    if "joint" in keys:
        kind = item["joint"]["type"]
        both = f"{sliding} or {turning}"
        return both if kind == "free" else _of(kind in _SLIDING, sliding, turning)
    if path[0] == "drives":
        on = item["on"]
        slides = kinds.get(on if isinstance(on, str) else on[0]) == "m"
        wound = "drum" in item and "control" not in keys
        return _of(slides and not wound, sliding, turning)
    return sliding


def _of(slides: bool, sliding: str, turning: str) -> str:
    return sliding if slides else turning
