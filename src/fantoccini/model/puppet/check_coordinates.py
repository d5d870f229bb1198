"""Checks of start values and drives, which refer to coordinates by name.

A driven coordinate is given as a function of time: an end or length of a string, or a driven joint.
A drive moves one by a motor towards its command. A twin is the mirror image of a part.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fantoccini.base.documents import Path, shown
from fantoccini.model.puppet.drive import drive_misfits
from fantoccini.model.puppet.joint import Joint
from fantoccini.model.puppet.parts import Parts
from fantoccini.model.puppet.written import is_number

_SUFFIXES = {
    "revolute": {"": "revolute"},
    "prismatic": {"": "length"},
    "ball": {".rotation": "rotation"},
    "free": {".x": "length", ".y": "length", ".z": "length", ".rotation": "rotation"},
    "fixed": {},
}
"""Type of joint -> suffix of a coordinate's name -> kind of coordinate."""
_UNITS = {"length": "m", "string": "m", "revolute": "rad", "rotation": "rotation"}
_QUATERNION = ("qw", "qx", "qy", "qz")


def check_pose(parts: Parts) -> None:
    """Checks that start values have names of coordinates, and the right kind of value."""
    kinds, unclear_joints = _coordinates(parts)
    string_names = {s.name for s in parts.puppet.strings if isinstance(s.name, str)}
    strings = string_names | {parts.twin(name) for name in string_names}
    names = set(kinds)
    for key, value in parts.pose.items():
        owner, suffix = parts.split_coordinate(key)
        path = ("pose", key)
        if key in kinds:
            _check_value(parts, path, kinds[key], value)
        elif owner in unclear_joints:
            continue
        elif suffix in _QUATERNION and f"{owner}.rotation" in kinds:
            parts.add_mistake(path, f"write {owner}.rotation: [w, x, y, z] instead")
        elif owner in strings and suffix in ("x", "y", "z"):
            parts.add_mistake(path, "a driven end starts at its `at`")
        elif owner in strings and suffix == "length":
            parts.add_mistake(
                path, "this string's length is a number; only driven lengths have a start"
            )
        else:
            parts.add_mistake(
                path, f"no coordinate is called {shown(key)}{_hint(parts, key, names)}"
            )


def check_drives(parts: Parts) -> None:
    """Checks that drives suit their coordinates, which are driven and have one drive each."""
    units = _driven_units(parts)
    _, unclear = _coordinates(parts)
    drive_of: dict[str, str] = {}
    driven_names = set(units)
    for i, drive in enumerate(parts.puppet.drives):
        checked_names: list[tuple[str, Path]] = []
        for k, name in enumerate(drive.on):
            path: Path = ("drives", i, "on", k)
            if not isinstance(name, str) or parts.split_coordinate(name)[0] in unclear:
                continue
            if name not in units:
                hint = _hint(parts, name, driven_names)
                parts.add_mistake(path, f"no driven coordinate is called {shown(name)}{hint}")
            elif name in drive_of:
                parts.add_mistake(path, f"{name} has a drive already, {drive_of[name]}")
            else:
                drive_of[name] = f"drives[{i}]"
                checked_names.append((name, path))
                misfits = drive_misfits(drive, name, units[name])
                parts.mistakes += [(("drives", i, *key_path), text) for key_path, text in misfits]
        for name, path in checked_names:
            owner, _ = parts.split_coordinate(name)
            twin = parts.twin(owner) + name[len(owner) :]
            if twin in drive.on:
                continue
            if twin in drive_of:
                text = f"{twin}, the twin of {name}, has a drive already, {drive_of[twin]}"
                parts.add_mistake(path, text)
            drive_of[twin] = f"drives[{i}] of its twin {name}"


def _hint(parts: Parts, key: str, names: set[str]) -> str:
    """The end of a message: the coordinate of the body's joint, or the most similar name."""
    owner, suffix = parts.split_coordinate(key)
    dot = "." if suffix else ""
    joint = parts.joint_of.get(owner, owner)
    candidates = [
        name
        for name in (joint + dot + suffix, *(owner + s for s in (".length", ".rotation")))
        if name in names and name != key
    ]
    if candidates:
        joint_text = f"; the joint of {owner} is called {joint}" if joint != owner else ""
        return f"{joint_text}; did you mean {candidates[0]!r}?"
    if joint != owner:
        return f"; the joint of {owner} is called {joint}"
    return parts.hint(key, names)


def _joints(parts: Parts) -> Iterator[tuple[str, Joint, dict[str, str] | None]]:
    """Name and joint of every joint, and suffix -> kind of its coordinates; None if unclear."""
    for body in parts.puppet.bodies:
        joint = body.joint
        name = joint.name or body.name
        if not isinstance(name, str):
            continue
        if joint.type == "translation" and isinstance(joint.axes, tuple):
            yield name, joint, {f".{a}": "length" for a in joint.axes if isinstance(a, str)}
        else:
            yield name, joint, _SUFFIXES.get(joint.type)


def _coordinates(parts: Parts) -> tuple[dict[str, str], set[str]]:
    """Kind of every coordinate, and the joints whose type is unclear."""
    kinds: dict[str, str] = {}
    unclear: set[str] = set()
    for name, _, suffixes in _joints(parts):
        if suffixes is None:
            unclear |= {name, parts.twin(name)}
        for suffix, kind in (suffixes or {}).items():
            kinds[name + suffix] = kinds[parts.twin(name) + suffix] = kind
    for string in parts.puppet.strings:
        if string.length == "driven" and isinstance(string.name, str):
            kinds[f"{string.name}.length"] = kinds[f"{parts.twin(string.name)}.length"] = "string"
    return kinds, unclear


def _check_value(parts: Parts, path: Path, kind: str, value: Any) -> None:
    """Checks a start value of a coordinate of this kind."""
    is_list = isinstance(value, list)
    if is_list != (kind == "rotation"):
        needed = "a rotation vector or a quaternion w, x, y, z" if not is_list else "a number"
        parts.add_mistake(path, f"found {shown(value)}; needed: {needed}")
    elif isinstance(value, str) and kind != "revolute":
        parts.add_mistake(path, f"found {shown(value)}; needed: a number of metres, without a unit")
    elif kind == "string" and is_number(value) and value <= 0:
        parts.add_mistake(path, f"found {shown(value)}; needed: a positive length")


def _driven_units(parts: Parts) -> dict[str, str]:
    """Driven coordinate -> ``m``, ``rad`` or ``rotation``."""
    units: dict[str, str] = {}
    for name, joint, suffixes in _joints(parts):
        if joint.driven is True:
            for suffix, kind in (suffixes or {}).items():
                units[name + suffix] = units[parts.twin(name) + suffix] = _UNITS[kind]
    for string in parts.puppet.strings:
        if not isinstance(string.name, str):
            continue
        axes = [axis for point in string.path for axis in point.driven or ()]
        ends = [f".{axis}" for axis in axes if isinstance(axis, str)]
        ends += [".length"] if string.length == "driven" else []
        units |= {n + end: "m" for n in (string.name, parts.twin(string.name)) for end in ends}
    return units
