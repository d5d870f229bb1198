"""Mistakes that only show when a puppet is read as a whole, found in its plain data.

They are looked for in the raw data, whatever its other mistakes are, so that one reading reports
everything; whatever has the wrong form is passed over here and reported by the schema.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from fantoccini.errors import nearest
from fantoccini.puppet.drive import drive_misfits
from fantoccini.puppet.located import Finding, Located, key_path, shown
from fantoccini.puppet.mirror import twin_name
from fantoccini.puppet.shapes import has_mass
from fantoccini.puppet.values import NAME, value_of
from fantoccini.puppet.yaml_text import Path

_SECTIONS = ("bodies", "strings", "springs", "obstacles")
_MIRRORED = ("bodies", "strings", "springs")
_COORDINATES = {
    "revolute": ("",),
    "prismatic": ("",),
    "ball": (".rotation",),
    "free": (".x", ".y", ".z", ".rotation"),
    "fixed": (),
}
_QUATERNION = ("qw", "qx", "qy", "qz")
_MANY = 400


def findings(data: Any) -> list[Finding]:
    """All mistakes that concern more than one part of a puppet.

    Args:
        data: plain data, of any form.
    """
    if not isinstance(data, dict):
        return []
    checker = _Checker(data)
    checker.names()
    checker.mirror()
    checker.parents()
    checker.lines()
    checker.pose()
    checker.drives()
    checker.parameters()
    return checker.found


def parameters(data: Any) -> Iterator[tuple[Path, dict]]:
    """Every ``{parameter: ..., value: ...}`` with its place, in file order."""
    stack: list[tuple[Path, Any]] = [((), data)]
    while stack:
        path, value = stack.pop()
        if isinstance(value, dict):
            if isinstance(value.get("parameter"), str) and _is_number(value.get("value")):
                yield path, value
            stack.extend(((*path, k), v) for k, v in reversed(value.items()))
        elif isinstance(value, list):
            stack.extend(((*path, k), v) for k, v in reversed(list(enumerate(value))))


def name_lines(data: dict, located: Located) -> dict[str, int]:
    """Line of every name, for messages that come later."""
    places = [(name, located.line(path)) for name, path in _names(data)]
    return {name: line for name, line in places if line is not None}


def massless_joints(bodies: tuple, mirror: Any) -> list[Finding]:
    """Joints that the equations of motion could not move: nothing beyond them has mass.

    Args:
        bodies: the bodies of a puppet without other mistakes.
        mirror: its mirror, or None. What hangs on a twin is counted for the original.
    """
    place = {body.name: i for i, body in enumerate(bodies)}
    if mirror is not None:
        twins = {twin_name(n, mirror.from_, mirror.to): i for n, i in place.items()}
        place = twins | place
    heavy = [False] * len(bodies)
    for i, body in enumerate(bodies):
        if body.mass is None:
            own = any(has_mass(s) for s in body.shapes)
        else:
            own = value_of(body.mass) > 0
        own = own or any(value_of(n) > 0 for n in body.inertia or ())
        while own and not heavy[i]:
            heavy[i] = True
            parent = bodies[i].parent
            if parent == "world":
                break
            i = place[parent]
    return [
        (("bodies", i, "joint"), "this joint moves no mass; give the body or one it carries a mass")
        for i, body in enumerate(bodies)
        if not heavy[i] and body.joint.type != "fixed" and not body.joint.driven
    ]


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _items(data: Any, key: str) -> list[tuple[int, dict]]:
    """The mappings in a list under a key, with their places."""
    section = data.get(key) if isinstance(data, dict) else None
    if not isinstance(section, list):
        return []
    return [(i, item) for i, item in enumerate(section) if isinstance(item, dict)]


def _text(item: Any, key: str) -> str | None:
    value = item.get(key) if isinstance(item, dict) else None
    return value if isinstance(value, str) else None


def _names(data: dict) -> Iterator[tuple[str, Path]]:
    """Names of bodies, joints that have their own, strings, springs, obstacles; and where."""
    for key in _SECTIONS:
        for i, item in _items(data, key):
            name = _text(item, "name")
            if name is not None:
                yield name, (key, i, "name")
            joint = _text(item.get("joint"), "name")
            if key == "bodies" and joint is not None and joint != name:
                yield joint, (key, i, "joint", "name")


def _place(point: Any) -> tuple[float, ...] | None:
    """The numbers of a point, parameters by their values."""
    if not isinstance(point, list):
        return None
    numbers = [n.get("value") if isinstance(n, dict) else n for n in point]
    return tuple(numbers) if len(numbers) == 3 and all(map(_is_number, numbers)) else None


class _Checker:
    """Collects findings; knows all names, twins included."""

    def __init__(self, data: dict):
        self.data, self.found, self.hints = data, [], 0
        self.owner: dict[str, Path] = {}
        rule = data.get("mirror")
        token = _text(rule, "from") or _text(rule, "from_")
        self.rule = (token, _text(rule, "to")) if token and _text(rule, "to") else None
        self.bodies = {n: i for i, b in _items(data, "bodies") if (n := _text(b, "name"))}
        self.known = set(self.bodies) | {self.twin(n) for n in self.bodies}

    def say(self, path: Path, message: str) -> None:
        self.found.append((path, message))

    def twin(self, name: str) -> str:
        return twin_name(name, *self.rule) if self.rule else name

    def near(self, name: str, allowed: set[str]) -> str:
        """The nearest name; only for the first few, as looking for it takes long."""
        self.hints += 1
        return nearest(name[:64], allowed) if self.hints < 50 and len(allowed) < _MANY else ""

    def names(self) -> None:
        for name, path in _names(self.data):
            if name == "world":
                self.say(path, "found 'world', which is the name of the world itself")
            elif name in self.owner:
                first = key_path(self.owner[name])
                self.say(path, f"the name {shown(name)} is taken by {first}; names are used once")
            else:
                self.owner[name] = path

    def mirror(self) -> None:
        if not self.rule:
            return
        token, to = self.rule
        if token == to:
            self.say(("mirror", "to"), f"found {shown(to)} for both from and to")
            return
        made: dict[str, str] = {}
        carried = [(n, p) for n, p in _names(self.data) if p[0] in _MIRRORED]
        mirrored = {p[:2] for n, p in carried if p[-2] != "joint" and token in n}
        for name, path in carried:
            if path[:2] not in mirrored:
                if token in name:
                    text = f"the body's name does not contain {shown(token)}, the joint's does"
                    self.say(path, f"{text}; the mirror reflects bodies with their joints")
                continue
            twin = self.twin(name)
            taken = self.owner.get(twin)
            if token not in name or taken is not None or twin in made:
                by = key_path(taken) if taken is not None else f"the twin of {made.get(twin)!r}"
                self.say(path, f"its twin would be called {shown(twin)}, which is taken by {by}")
            elif not re.fullmatch(NAME, twin, re.ASCII) and re.fullmatch(NAME, name, re.ASCII):
                self.say(("mirror", "to"), f"{shown(twin)}, the twin of {name!r}, is not a name")
            made[twin] = name
        if not mirrored:
            shared = {w for n, _ in carried for w in re.split(r"[_-]", n)}
            text = f"no body, string or spring has {shown(token)} in its name"
            self.say(("mirror", "from"), text + self.near(token, shared))

    def parents(self) -> None:
        bodies = _items(self.data, "bodies")
        parent_of: dict[str, str] = {}
        for i, body in bodies:
            name, parent = _text(body, "name"), _text(body, "parent")
            if parent is None or parent == "world":
                continue
            if parent not in self.known:
                hint = self.near(parent, self.known | {"world"})
                self.say(("bodies", i, "parent"), f"no body is called {shown(parent)}{hint}")
            elif name is not None and self.bodies[name] == i:
                parent_of[name] = parent
                parent_of.setdefault(self.twin(name), self.twin(parent))
        done: set[str] = set()
        for start in parent_of:
            walk: dict[str, None] = {}
            name = start
            while name in parent_of and name not in done and name not in walk:
                walk[name] = None
                name = parent_of[name]
            if name in walk:
                ring = list(walk)[list(walk).index(name) :]
                shown_ring = ring if len(ring) < 9 else [*ring[:7], "...", ring[-1]]
                text = f"the parents go round in a circle: {' -> '.join([*shown_ring, name])}"
                firsts = [n for n in ring if n in self.bodies]
                if firsts:
                    self.say(("bodies", self.bodies[firsts[0]], "parent"), text)
            done.update(walk)

    def lines(self) -> None:
        for key, points in (("strings", "path"), ("springs", "between")):
            for i, item in _items(self.data, key):
                self.line((key, i, points), item.get(points))

    def line(self, path: Path, points: Any) -> None:
        """Points of a string or spring: they exist, and the distance between them can change."""
        if not isinstance(points, list):
            return
        carriers = [self.carrier(p, (*path, k)) for k, p in enumerate(points)]
        driven = [k for k, c in enumerate(carriers) if c and c[0] == "driven"]
        for k in driven:
            if path[0] == "springs":
                self.say((*path, k, "driven"), "a spring's end cannot be driven in place")
            elif k not in (0, len(points) - 1):
                self.say((*path, k, "driven"), "only a string's two ends can be driven")
        if len(driven) > 1 and path[0] == "strings":
            text = "both ends are driven; let one be a body with a driven joint"
            self.say((*path, driven[1], "driven"), text)
        if len(carriers) < 2 or None in carriers:
            return
        if len({c[:2] for c in carriers}) == 1:
            where = "in the world" if carriers[0][0] == "world" else f"on {shown(carriers[0][1])}"
            places = {c[2] for c in carriers}
            what = "its length is zero" if len(places) == 1 else "its length can never change"
            self.say(path, f"all points lie {where}: {what}")
            return
        for k in range(1, len(carriers)):
            if carriers[k] == carriers[k - 1] and carriers[k][2] is not None:
                self.say((*path, k), "this is the same point as the one before it")

    def carrier(self, point: Any, path: Path) -> tuple[str, Any, Any] | None:
        """Kind, name and place of what a point is fixed on; None where that is unclear."""
        if not isinstance(point, dict):
            return None
        at = _place(point.get("at", [0.0, 0.0, 0.0]))
        if point.get("driven") is not None:
            return ("driven", path, at)
        if point.get("world") is not None:
            return ("world", None, _place(point["world"]))
        name = _text(point, "body")
        if name == "world":
            self.say((*path, "body"), "found 'world'; write {world: [x, y, z]} instead")
        elif name is not None and name not in self.known:
            self.say(
                (*path, "body"), f"no body is called {shown(name)}{self.near(name, self.known)}"
            )
        elif name is not None:
            return ("body", name, at)
        return None

    def coordinates(self) -> tuple[dict[str, str], set[str]]:
        """Coordinates -> kind, and joints whose kind is unclear."""
        kinds: dict[str, str] = {}
        unclear: set[str] = set()
        for _, body in _items(self.data, "bodies"):
            joint = body.get("joint")
            name = _text(joint, "name") or _text(body, "name")
            kind = _text(joint, "type")
            axes = joint.get("axes") if isinstance(joint, dict) else None
            if joint is None or name is None:
                continue
            if kind == "translation" and isinstance(axes, list):
                suffixes = tuple(f".{a}" for a in axes)
            elif kind in _COORDINATES:
                suffixes = _COORDINATES[kind]
            else:
                unclear |= {name, self.twin(name)}
                continue
            for suffix in suffixes:
                entry = (
                    "rotation"
                    if suffix == ".rotation"
                    else "revolute"
                    if (kind == "revolute")
                    else "length"
                )
                kinds[name + suffix] = kinds[self.twin(name) + suffix] = entry
        for _, string in _items(self.data, "strings"):
            name = _text(string, "name")
            if name is not None and string.get("length") == "driven":
                kinds[f"{name}.length"] = kinds[f"{self.twin(name)}.length"] = "string"
        return kinds, unclear

    def pose(self) -> None:
        pose = self.data.get("pose")
        if not isinstance(pose, dict):
            return
        kinds, unclear = self.coordinates()
        strings = {_text(s, "name") for _, s in _items(self.data, "strings")}
        strings |= {self.twin(s) for s in strings if s}
        for key, value in pose.items():
            owner, _, suffix = key.partition(".")
            path = ("pose", key)
            if key in kinds:
                self.pose_value(path, kinds[key], value)
            elif owner in unclear:
                continue
            elif suffix in _QUATERNION and f"{owner}.rotation" in kinds:
                self.say(path, f"write {owner}.rotation: [w, x, y, z] instead")
            elif owner in strings and suffix in ("x", "y", "z"):
                self.say(path, "a driven end starts where its `at` says")
            elif owner in strings and suffix == "length":
                self.say(path, "this string's length is a number; only driven lengths have a start")
            else:
                hint = self.near(key, set(kinds))
                self.say(path, f"no coordinate is called {shown(key)}{hint}")

    def pose_value(self, path: Path, kind: str, value: Any) -> None:
        turns = isinstance(value, list)
        if turns != (kind == "rotation"):
            needed = "a rotation vector or a quaternion w, x, y, z" if not turns else "a number"
            self.say(path, f"found {shown(value)}; needed: {needed}")
        elif isinstance(value, str) and kind != "revolute":
            self.say(path, f"found {shown(value)}; needed: a number of metres, without a unit")
        elif kind == "string" and _is_number(value) and value <= 0:
            self.say(path, f"found {shown(value)}; needed: a positive length")

    def driven(self) -> dict[str, str]:
        """Driven coordinates -> ``m``, ``rad`` or ``rotation``."""
        kinds, _ = self.coordinates()
        units = {"length": "m", "string": "m", "revolute": "rad", "rotation": "rotation"}
        found: dict[str, str] = {}
        for _, body in _items(self.data, "bodies"):
            joint = body.get("joint")
            if isinstance(joint, dict) and joint.get("driven") is True:
                name = _text(joint, "name") or _text(body, "name")
                own = {k: units[v] for k, v in kinds.items() if k.partition(".")[0] == name}
                found |= own | {self.twin(name) + k[len(name) :]: v for k, v in own.items()}
        for _, string in _items(self.data, "strings"):
            name, path = _text(string, "name"), string.get("path")
            if name is None:
                continue
            ends = path if isinstance(path, list) else []
            axes = [e.get("driven") for e in ends if isinstance(e, dict)]
            suffixes = [f".{a}" for some in axes if isinstance(some, list) for a in some]
            suffixes += [".length"] if string.get("length") == "driven" else []
            found |= {n + s: "m" for n in (name, self.twin(name)) for s in suffixes}
        return found

    def drives(self) -> None:
        units, taken = self.driven(), {}
        for i, drive in _items(self.data, "drives"):
            names = drive.get("on")
            listed = names if isinstance(names, list) else [names]
            own: list[tuple[str, Path]] = []
            for k, name in enumerate(listed):
                path = ("drives", i, "on", k) if isinstance(names, list) else ("drives", i, "on")
                if not isinstance(name, str):
                    continue
                if name not in units:
                    hint = self.near(name, set(units))
                    self.say(path, f"no driven coordinate is called {shown(name)}{hint}")
                elif name in taken:
                    self.say(path, f"{name} has a drive already, {taken[name]}")
                else:
                    taken[name] = f"drives[{i}]"
                    own.append((name, path))
                    misfits = drive_misfits(drive, name, units[name])
                    self.found += [(("drives", i, *at), text) for at, text in misfits]
            for name, path in own:
                owner = name.partition(".")[0]
                twin = self.twin(owner) + name[len(owner) :]
                if twin in listed:
                    continue
                if twin in taken:
                    text = f"{twin}, the twin of {name}, has a drive already, {taken[twin]}"
                    self.say(path, text)
                taken[twin] = f"drives[{i}] of its twin {name}"

    def parameters(self) -> None:
        first: dict[str, tuple[Path, float]] = {}
        for path, found in parameters(self.data):
            name, value = found["parameter"], found["value"]
            place, known = first.setdefault(name, (path, value))
            if value != known:
                text = f"the parameter {shown(name)} is {value:g} here but {known:g} in"
                self.say(path, f"{text} {key_path(place)}; one name has one value")
