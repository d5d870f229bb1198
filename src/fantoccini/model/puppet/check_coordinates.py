"""Mistakes in start values and drives, which both name coordinates."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fantoccini.base.documents import Path, shown
from fantoccini.model.puppet.drive import drive_misfits
from fantoccini.model.puppet.written import Written, is_number, items, word

_SUFFIXES = {
    "revolute": {"": "revolute"},
    "prismatic": {"": "length"},
    "ball": {".rotation": "rotation"},
    "free": {".x": "length", ".y": "length", ".z": "length", ".rotation": "rotation"},
    "fixed": {},
}
"""Type of joint -> suffix of a coordinate's name -> kind of the coordinate."""
_UNITS = {"length": "m", "string": "m", "revolute": "rad", "rotation": "rotation"}
_QUATERNION = ("qw", "qx", "qy", "qz")


def check_pose(written: Written) -> None:
    """Checks that start values belong to coordinates and are of their kind."""
    pose = written.data.get("pose")
    if not isinstance(pose, dict):
        return
    kinds, unclear = _coordinates(written)
    strings = {word(s, "name") for _, s in items(written.data, "strings")}
    strings |= {written.twin(s) for s in strings if s}
    names = set(kinds)
    for key, value in pose.items():
        owner, suffix = written.split(key)
        path = ("pose", key)
        if key in kinds:
            _pose_value(written, path, kinds[key], value)
        elif owner in unclear:
            continue
        elif suffix in _QUATERNION and f"{owner}.rotation" in kinds:
            written.say(path, f"write {owner}.rotation: [w, x, y, z] instead")
        elif owner in strings and suffix in ("x", "y", "z"):
            written.say(path, "a driven end starts at its `at`")
        elif owner in strings and suffix == "length":
            written.say(path, "this string's length is a number; only driven lengths have a start")
        else:
            written.say(path, f"no coordinate is called {shown(key)}{_hint(written, key, names)}")


def check_drives(written: Written) -> None:
    """Checks that drives suit driven coordinates, one drive each."""
    units = _driven(written)
    taken: dict[str, str] = {}
    known = set(units)
    for i, drive in items(written.data, "drives"):
        names = drive.get("on")
        listed = names if isinstance(names, list) else [names]
        given = {name for name in listed if isinstance(name, str)}
        own: list[tuple[str, Path]] = []
        for k, name in enumerate(listed):
            path: Path = ("drives", i, "on", k) if isinstance(names, list) else ("drives", i, "on")
            if not isinstance(name, str):
                continue
            if name not in units:
                hint = _hint(written, name, known)
                written.say(path, f"no driven coordinate is called {shown(name)}{hint}")
            elif name in taken:
                written.say(path, f"{name} has a drive already, {taken[name]}")
            else:
                taken[name] = f"drives[{i}]"
                own.append((name, path))
                misfits = drive_misfits(drive, name, units[name])
                written.found += [(("drives", i, *at), text) for at, text in misfits]
        for name, path in own:
            owner, _ = written.split(name)
            twin = written.twin(owner) + name[len(owner) :]
            if twin in given:
                continue
            if twin in taken:
                text = f"{twin}, the twin of {name}, has a drive already, {taken[twin]}"
                written.say(path, text)
            taken[twin] = f"drives[{i}] of its twin {name}"


def _hint(written: Written, key: str, names: set[str]) -> str:
    """Hint of the coordinate meant: of the body's joint, or the one with the nearest name."""
    owner, suffix = written.split(key)
    dot = "." if suffix else ""
    joint = written.joint_of.get(owner, owner)
    meant = [
        name
        for name in (joint + dot + suffix, *(owner + s for s in (".length", ".rotation")))
        if name in names and name != key
    ]
    if meant:
        of_body = f"; the joint of {owner} is called {joint}" if joint != owner else ""
        return f"{of_body}; did you mean {meant[0]!r}?"
    if joint != owner:
        return f"; the joint of {owner} is called {joint}"
    return written.near(key, names)


def _joints(written: Written) -> Iterator[tuple[str, dict[str, Any], dict[str, str] | None]]:
    """Name, plain data and coordinates of every joint; None if its type is unclear."""
    for _, body in items(written.data, "bodies"):
        joint = body.get("joint")
        name = word(joint, "name") or word(body, "name")
        if not isinstance(joint, dict) or name is None:
            continue
        kind, axes = word(joint, "type"), joint.get("axes")
        if kind == "translation" and isinstance(axes, list):
            yield name, joint, {f".{axis}": "length" for axis in axes[:3]}
        else:
            yield name, joint, None if kind is None else _SUFFIXES.get(kind)


def _coordinates(written: Written) -> tuple[dict[str, str], set[str]]:
    """Kind of every coordinate, and the joints whose type is unclear."""
    kinds: dict[str, str] = {}
    unclear: set[str] = set()
    for name, _, suffixes in _joints(written):
        if suffixes is None:
            unclear |= {name, written.twin(name)}
        for suffix, kind in (suffixes or {}).items():
            kinds[name + suffix] = kinds[written.twin(name) + suffix] = kind
    for _, string in items(written.data, "strings"):
        own = word(string, "name")
        if own is not None and string.get("length") == "driven":
            kinds[f"{own}.length"] = kinds[f"{written.twin(own)}.length"] = "string"
    return kinds, unclear


def _pose_value(written: Written, path: Path, kind: str, value: Any) -> None:
    turns = isinstance(value, list)
    if turns != (kind == "rotation"):
        needed = "a rotation vector or a quaternion w, x, y, z" if not turns else "a number"
        written.say(path, f"found {shown(value)}; needed: {needed}")
    elif isinstance(value, str) and kind != "revolute":
        written.say(path, f"found {shown(value)}; needed: a number of metres, without a unit")
    elif kind == "string" and is_number(value) and value <= 0:
        written.say(path, f"found {shown(value)}; needed: a positive length")


def _driven(written: Written) -> dict[str, str]:
    """Driven coordinates -> ``m``, ``rad`` or ``rotation``."""
    found: dict[str, str] = {}
    for name, joint, suffixes in _joints(written):
        if joint.get("driven") is True:
            for suffix, kind in (suffixes or {}).items():
                found[name + suffix] = found[written.twin(name) + suffix] = _UNITS[kind]
    for _, string in items(written.data, "strings"):
        own, path = word(string, "name"), string.get("path")
        if own is None:
            continue
        points = path if isinstance(path, list) else []
        axes = [point.get("driven") for point in points if isinstance(point, dict)]
        ends = [f".{a}" for some in axes if isinstance(some, list) for a in some]
        ends += [".length"] if string.get("length") == "driven" else []
        found |= {n + end: "m" for n in (own, written.twin(own)) for end in ends}
    return found
