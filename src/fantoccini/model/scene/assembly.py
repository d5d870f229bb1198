"""Assembles a scene into one puppet.

Every puppet stands on a massless frame with the member's name, so that its coordinates mean the
same wherever it is placed. In a scene of several puppets the names of its parts begin with the
member's name and a dot. In pairs of contact that name stands for all of them, in a scene of one
puppet too.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from itertools import product
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from fantoccini.base import Mistake, PuppetError, nearest, rotation
from fantoccini.base.documents import Finding, Located, Origin, read_document, shown
from fantoccini.model.puppet import FLOOR, Contact, Puppet, bundled, named, parameters, plain
from fantoccini.model.scene.schema import PUPPET_OR_SCENE, Member, Prop, Scene


@dataclass(frozen=True)
class _Placed:
    """A member with its puppet, and the name that precedes those of its parts."""

    member: Member
    puppet: Puppet
    prefix: str

    @property
    def frame(self) -> str:
        """The body on which the puppet stands: a frame of its own, or the world."""
        moved = self.member.orientation is not None or any(self.member.at)
        return self.member.name if moved else "world"

    def part(self, name: str) -> str:
        """The name of a body, joint, string, coordinate or parameter in the scene."""
        return self.prefix + name

    def touched(self, name: str) -> str:
        """The name in the scene of what takes part in contact; there is one floor."""
        return name if name == FLOOR else self.part(name)

    def body(self, name: str) -> str:
        """The name of a body in the scene, the puppet's world included."""
        return self.frame if name == "world" else self.prefix + name


def assembled(scene: Scene) -> Puppet:
    """A scene as one puppet; with several members, their names stand before those of parts.

    Raises:
        PuppetError: with every mistake of the puppets' files, and of what the scene says of them.
    """
    located = scene.located
    placed: list[_Placed] = []
    mistakes: list[Mistake] = []
    for i, member in enumerate(scene.puppets):
        prefix = f"{member.name}." if len(scene.puppets) > 1 else ""
        try:
            placed.append(_Placed(member, _puppet(member, ("puppets", i), located), prefix))
        except PuppetError as error:
            mistakes += error.mistakes
    if mistakes:
        raise PuppetError(mistakes)
    found = _name_clashes(scene, placed)
    shared = {key: _shared(key, getattr(scene, key), placed, found) for key in ("gravity", "floor")}
    shared["contact"] = _contact(scene, placed, found)
    if found:
        raise located.error(found, PuppetError)
    folder = _folder(placed, located)
    data: dict[str, Any] = {"puppet": scene.scene, "bodies": [], "pose": {}, **shared}
    if len(scene.puppets) > 1:
        data["members"] = [member.name for member in scene.puppets]
    data["props"] = [prop.name for prop in scene.props]
    for key in ("strings", "springs", "drives", "obstacles"):
        data[key] = []
    same: dict[str, str] = {}
    for one in placed:
        same |= _add(data, one, folder)
    if isinstance(data["contact"], dict):
        for pair in data["contact"].get("pairs", []):
            pair["between"] = [same.get(name, name) for name in pair["between"]]
    for prop in scene.props:
        _add_prop(data, prop)
    data["obstacles"] += [plain(obstacle) for obstacle in scene.obstacles]
    made = Puppet.model_validate(
        {key: value for key, value in data.items() if value is not None},
        context=Located(None, located.file, folder),
    )
    made._origin = _origin(scene, placed, located, folder)
    return made


def _name_clashes(scene: Scene, placed: list[_Placed]) -> list[Finding]:
    """Names of the scene that parts of its puppets have already."""
    taken = {one.part(name) for one in placed for name, _ in named(one.puppet)}
    unused = {one.member.name for one in placed if one.frame == "world"}
    if isinstance(scene.contact, Contact):
        unused -= {name for pair in scene.contact.pairs for name in pair.between}
    return [
        (path, f"the name {name!r} is taken by a part of the puppet; names are used once")
        for path, name in scene.names()
        if name in taken - unused
    ]


def _puppet(member: Member, at: tuple[str | int, ...], located: Located) -> Puppet:
    """A member's puppet, both halves written out, with the member's pose and parameters."""
    puppet = member.puppet
    if isinstance(puppet, str):
        path = bundled(puppet) or located.folder / puppet
        if not os.path.isfile(path):
            text = f"found {puppet!r}; there is no such file, and no bundled puppet of this name"
            raise located.error([((*at, "puppet"), text)], PuppetError)
        file = os.path.relpath(path) if path.is_relative_to(Path.cwd()) else path
        read = read_document(file, *PUPPET_OR_SCENE)
        if isinstance(read, Scene):
            text = f"found {puppet!r}, which is a scene; needed: the file of a puppet"
            raise located.error([((*at, "puppet"), text)], PuppetError)
        puppet = read
    known = puppet.parameters()
    unknown: list[Finding] = [
        ((*at, "parameters", name), f"{puppet.name} has no such parameter{nearest(name, known)}")
        for name in member.parameters
        if name not in known
    ]
    if unknown:
        raise located.error(unknown, PuppetError)
    made = puppet.expanded()
    data = plain(made)
    for _, parameter in parameters(data):
        parameter["value"] = member.parameters.get(parameter["parameter"], parameter["value"])
    data["pose"] = data.get("pose", {}) | {k: plain(v) for k, v in member.pose.items()}
    try:
        again = Puppet.model_validate(data, context=Located(folder=made._origin.folder))
    except PuppetError as error:
        raise PuppetError(_of_scene(m, at, located) for m in error.mistakes) from None
    again._origin = made._origin
    return again


def _of_scene(found: Mistake, at: tuple[str | int, ...], located: Located) -> Mistake:
    """A mistake in a puppet's pose or parameters, at its place in the scene."""
    head, _, key = found.key.partition(".")
    if head == "pose":
        return located.problem((*at, head, key), found.message)
    return located.problem((*at, "parameters"), f"{found.key}: {found.message}")


def _shared(key: str, own: Any, placed: list[_Placed], found: list[Finding]) -> Any:
    """Gravity or floor: the scene's own, or else the one that the puppets' files agree on."""
    if own is not None:
        return plain(own)
    given: dict[str, tuple[str, Any]] = {}
    for one in placed:
        value = plain(getattr(one.puppet, key))
        if value is not None:
            given.setdefault(repr(value), (one.member.name, value))
    if len(given) > 1:
        listed = ", ".join(f"{value} ({name})" for name, value in given.values())
        found.append(((), f"the puppets differ in {key}: {listed}; give the scene its own"))
    return next((value for _, value in given.values()), None)


def _contact(scene: Scene, placed: list[_Placed], found: list[Finding]) -> Any:
    """The scene's own rules of contact, or else those that the puppets' files agree on."""
    if isinstance(scene.contact, Contact):
        return plain(scene.contact) | {"pairs": _pairs(scene, scene.contact, placed, found)}
    if scene.contact is not None:
        return scene.contact
    given = [one for one in placed if one.puppet.contact is not None]
    if not given:
        return None
    rules = [plain(one.puppet.touching) for one in given]
    shared = [rule and {k: v for k, v in rule.items() if k != "pairs"} for rule in rules]
    if any(rule != shared[0] for rule in shared):
        names = ", ".join(one.member.name for one in given)
        found.append(((), f"the puppets {names} differ in contact; give the scene its own"))
    if shared[0] is None:
        return False
    pairs = [
        pair | {"between": [one.touched(name) for name in pair["between"]]}
        for one, rule in zip(given, rules, strict=True)
        for pair in rule.get("pairs", [])
    ]
    return shared[0] | {"pairs": pairs}


def _pairs(
    scene: Scene, rules: Contact, placed: list[_Placed], found: list[Finding]
) -> list[dict[str, Any]]:
    """The scene's own pairs; where nothing stands before names, a puppet's is spelt out."""
    parts = {
        one.member.name: [
            one.part(part.name) for part in (*one.puppet.bodies, *one.puppet.obstacles)
        ]
        for one in placed
    }
    known = {FLOOR, *(name for _, name in scene.names())}.union(*parts.values())
    alone = parts if len(placed) == 1 else {}
    pairs: list[dict[str, Any]] = []
    for i, pair in enumerate(rules.pairs):
        for k, name in enumerate(pair.between):
            if name not in known:
                text = f"no body, obstacle, prop or puppet is called {shown(name)}"
                path = ("contact", "pairs", i, "between", k)
                found.append((path, text + nearest(name[:64], known)))
        first, second = (alone.get(name, [name]) for name in pair.between)
        pairs += [
            plain(pair) | {"between": [a, b]}
            for a, b in product(first, second)
            if a < b or first is not second
        ]
    return pairs


def _folder(placed: list[_Placed], located: Located) -> Path:
    """The folder below which all mesh files lie."""
    folders = [one.puppet._origin.folder for one in placed if _has_meshes(one.puppet)]
    return Path(os.path.commonpath([located.folder.resolve(), *(f.resolve() for f in folders)]))


def _has_meshes(puppet: Puppet) -> bool:
    shapes = [shape for body in puppet.bodies for shape in body.shapes]
    return any(shape.type == "mesh" for shape in (*shapes, *puppet.obstacles))


def _add(data: dict[str, Any], one: _Placed, folder: Path) -> dict[str, str]:
    """Adds the parts of a puppet to the data of the scene.

    Returns:
        Names of obstacles that stand in the scene already, and what these are called there.
    """
    own = _renamed(one, plain(one.puppet), folder)
    if one.frame != "world":
        joint = {"type": "fixed", "at": plain(one.member.at)}
        if one.member.orientation is not None:
            joint["orientation"] = plain(one.member.orientation)
        data["bodies"].append({"name": one.frame, "joint": joint})
    for key in ("bodies", "strings", "springs", "drives"):
        data[key] += own.get(key, [])
    same: dict[str, str] = {}
    for obstacle in own["obstacles"]:
        twins = [o["name"] for o in data["obstacles"] if _unnamed(o) == _unnamed(obstacle)]
        if twins:
            same[obstacle["name"]] = twins[0]
        else:
            data["obstacles"].append(obstacle)
    data["pose"] |= own.get("pose", {})
    return same


def _unnamed(obstacle: dict[str, Any]) -> dict[str, Any]:
    """An obstacle but for its name: several puppets may stand round the same table."""
    return {key: value for key, value in obstacle.items() if key != "name"}


def _renamed(one: _Placed, own: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The plain data of a puppet with the names and places that it has in the scene."""
    for body in own["bodies"]:
        body["name"] = one.part(body["name"])
        body["parent"] = one.body(body.get("parent", "world"))
        if "name" in body.get("joint", {}):
            body["joint"]["name"] = one.part(body["joint"]["name"])
    for key, points in (("strings", "path"), ("springs", "between")):
        for item in own.get(key, []):
            item["name"] = one.part(item["name"])
            item[points] = [_point(one, point) for point in item[points]]
    for drive in own.get("drives", []):
        drive["on"] = [one.part(name) for name in drive["on"]]
    own["pose"] = {one.part(name): value for name, value in own.get("pose", {}).items()}
    own["obstacles"] = [_obstacle(one, o) for o in own.get("obstacles", [])]
    for _, parameter in parameters(own):
        parameter["parameter"] = one.part(parameter["parameter"])
    there = os.path.relpath(one.puppet._origin.folder.resolve(), folder)
    shapes = [shape for body in own["bodies"] for shape in body.get("shapes", [])]
    for shape in (*shapes, *own["obstacles"]):
        if shape["type"] == "mesh":
            shape["file"] = PurePath(there, shape["file"]).as_posix()
    return own


def _point(one: _Placed, point: dict[str, Any]) -> dict[str, Any]:
    """A point of a string or spring; those in the puppet's world lie on its frame."""
    if "body" in point:
        return point | {"body": one.part(point["body"])}
    if "driven" in point:
        return point | {"parent": one.body(point.get("parent", "world"))}
    if one.frame == "world":
        return point
    return {"body": one.frame, "at": point["world"]}


def _obstacle(one: _Placed, obstacle: dict[str, Any]) -> dict[str, Any]:
    """An obstacle of a puppet's file, where the puppet is placed."""
    out = obstacle | {"name": one.part(obstacle["name"])}
    if one.frame == "world":
        return out
    turn = one.member.orientation
    R = np.eye(3) if turn is None else turn.matrix
    r = np.array(one.member.at)
    keys = ("from", "to") if obstacle["type"] == "capsule" else ("at",)
    for key in keys:
        out[key] = (R @ np.array(obstacle.get(key, [0.0, 0.0, 0.0])) + r).tolist()
    if obstacle["type"] in ("box", "ellipsoid", "mesh") and turn is not None:
        own = obstacle.get("orientation")
        inner = np.eye(3) if own is None else type(turn).model_validate(own).matrix
        out["orientation"] = {"quaternion": rotation.quaternion(R @ inner).tolist()}
    return out


def _add_prop(data: dict[str, Any], prop: Prop) -> None:
    """Adds a prop: a body on a free joint that starts at its place."""
    body = {k: v for k, v in plain(prop).items() if k not in ("at", "orientation")}
    data["bodies"].append(body | {"joint": {"type": "free"}})
    data["pose"] |= {f"{prop.name}.{axis}": x for axis, x in zip("xyz", prop.at, strict=True)}
    if prop.orientation is not None:
        turn = rotation.quaternion(prop.orientation.matrix)
        data["pose"][f"{prop.name}.rotation"] = turn.tolist()


def _origin(scene: Scene, placed: list[_Placed], located: Located, folder: Path) -> Origin:
    """File and line of every name of the scene."""
    lines: dict[str, int] = {}
    files: dict[str, str] = {}
    for one in placed:
        for name, _ in named(one.puppet):
            file, line = one.puppet.locate(name)
            files[one.part(name)] = file
            if line is not None:
                lines[one.part(name)] = line
    for path, name in scene.names():
        if (line := located.line(path)) is not None:
            lines[name] = line
    return Origin(located.file, folder, lines, files)
