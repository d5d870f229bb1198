"""Assembles a scene into one puppet.

Every puppet stands on a massless frame with the member's name, so that its coordinates do not
depend on its place. With several puppets, the names of a puppet's parts begin with the member's
name and a dot. In contact pairs a member's name stands for all parts of its puppet.

A prop is a free body, and a rig the body map of a puppet: which bodies are trunk, head and limbs. A
drive moves a coordinate by a motor.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from itertools import product
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from fantoccini.base import Mistake, PuppetError, did_you_mean, rotation
from fantoccini.base.documents import Finding, Located, Origin, read_document, shown
from fantoccini.model.puppet import FLOOR, Contact, Puppet, bundled, named_parts, parameters, plain
from fantoccini.model.scene.schema import PUPPET_OR_SCENE, Member, Prop, Scene


@dataclass(frozen=True)
class _PlacedMember:
    """A member of a scene, its puppet, and the prefix of the names of the puppet's parts."""

    member: Member
    puppet: Puppet
    prefix: str

    @property
    def frame(self) -> str:
        """Name of the body on which the puppet stands: a frame of its own, or the world."""
        is_moved = self.member.orientation is not None or any(self.member.at)
        return self.member.name if is_moved else "world"

    def part_name(self, name: str) -> str:
        """Name in the scene of a body, joint, string, coordinate or parameter."""
        return self.prefix + name

    def contact_name(self, name: str) -> str:
        """Name in the scene of a body or obstacle in contact; all puppets share one floor."""
        return name if name == FLOOR else self.part_name(name)

    def body_name(self, name: str) -> str:
        """Name in the scene of a body or of the puppet's world."""
        return self.frame if name == "world" else self.prefix + name


def assembled(scene: Scene) -> Puppet:
    """A scene as one puppet; with several members, their names precede the names of parts.

    Raises:
        PuppetError: every mistake in the puppets' files, and in the scene's use of them.
    """
    located = scene.located
    placements: list[_PlacedMember] = []
    mistakes: list[Mistake] = []
    for i, member in enumerate(scene.puppets):
        prefix = f"{member.name}." if len(scene.puppets) > 1 else ""
        try:
            placements.append(
                _PlacedMember(member, _puppet(member, ("puppets", i), located), prefix)
            )
        except PuppetError as error:
            mistakes += error.mistakes
    if mistakes:
        raise PuppetError(mistakes)
    findings = _name_clashes(scene, placements)
    common_values = {
        key: _common_value(key, getattr(scene, key), placements, findings)
        for key in ("gravity", "floor")
    }
    common_values["contact"] = _contact(scene, placements, findings)
    findings += _string_findings(scene, placements)
    if findings:
        raise located.error(findings, PuppetError)
    folder = _mesh_folder(placements, located)
    data: dict[str, Any] = {"puppet": scene.scene, "bodies": [], "pose": {}, **common_values}
    if len(scene.puppets) > 1:
        data["members"] = [member.name for member in scene.puppets]
    data["props"] = [prop.name for prop in scene.props]
    data |= _rigs(placements)
    for key in ("strings", "springs", "drives", "obstacles"):
        data[key] = []
    shared_obstacles: dict[str, str] = {}
    for placement in placements:
        shared_obstacles |= _add_member(data, placement, folder)
    if isinstance(data["contact"], dict):
        for pair in data["contact"].get("pairs", []):
            pair["between"] = [shared_obstacles.get(name, name) for name in pair["between"]]
    for prop in scene.props:
        _add_prop(data, prop)
    data["strings"] += [plain(string) for string in scene.strings]
    data["obstacles"] += [plain(obstacle) for obstacle in scene.obstacles]
    puppet = Puppet.model_validate(
        {key: value for key, value in data.items() if value is not None},
        context=Located(None, located.file, folder),
    )
    puppet._origin = _origin(scene, placements, located, folder)
    return puppet


def _rigs(placements: list[_PlacedMember]) -> dict[str, Any]:
    """Body maps of the puppets' files: that of the only member, or one for each member."""
    if len(placements) == 1:
        rig = placements[0].puppet.rig
        return {} if rig is None else {"rig": plain(rig)}
    rigs = {p.member.name: plain(p.puppet.rig) for p in placements if p.puppet.rig is not None}
    return {"rigs": rigs} if rigs else {}


def _name_clashes(scene: Scene, placements: list[_PlacedMember]) -> list[Finding]:
    """Findings for names of the scene that parts of its puppets already have."""
    taken = {
        placement.part_name(name)
        for placement in placements
        for name, _ in named_parts(placement.puppet)
    }
    unused = {placement.member.name for placement in placements if placement.frame == "world"}
    if isinstance(scene.contact, Contact):
        unused -= {name for pair in scene.contact.pairs for name in pair.between}
    return [
        (path, f"the name {name!r} is taken by a part of the puppet; names are used once")
        for path, name in scene.names()
        if name in taken - unused
    ]


def _string_findings(scene: Scene, placements: list[_PlacedMember]) -> list[Finding]:
    """Findings for strings of the scene with unknown bodies, or that a hand would move."""
    bodies = {prop.name for prop in scene.props}
    bodies |= {p.part_name(body.name) for p in placements for body in p.puppet.bodies}
    bodies |= {p.frame for p in placements} - {"world"}
    driven_text = "which no puppet of the scene would own; needed:"
    findings: list[Finding] = []
    for i, string in enumerate(scene.strings):
        if string.length == "driven":
            text = f"found 'driven', {driven_text} a length"
            findings.append((("strings", i, "length"), text))
        for k, end in enumerate(string.path):
            path = ("strings", i, "path", k)
            if end.driven is not None:
                text = f"found a driven end, {driven_text} `body` or `world`"
                findings.append(((*path, "driven"), text))
            elif end.body is not None and end.body not in bodies:
                text = f"no body is called {shown(end.body)}{did_you_mean(end.body[:64], bodies)}"
                findings.append(((*path, "body"), text))
    return findings


def _puppet(member: Member, parent_path: tuple[str | int, ...], located: Located) -> Puppet:
    """A member's puppet, its mirror applied, in the member's pose, with its parameters."""
    puppet = member.puppet
    if isinstance(puppet, str):
        path = bundled(puppet) or located.folder / puppet
        if not os.path.isfile(path):
            text = f"found {puppet!r}; there is no such file, and no bundled puppet of this name"
            raise located.error([((*parent_path, "puppet"), text)], PuppetError)
        file = os.path.relpath(path) if path.is_relative_to(Path.cwd()) else path
        parsed = read_document(file, *PUPPET_OR_SCENE)
        if isinstance(parsed, Scene):
            text = f"found {puppet!r}, which is a scene; needed: the file of a puppet"
            raise located.error([((*parent_path, "puppet"), text)], PuppetError)
        puppet = parsed
    parameter_names = puppet.parameters()
    unknown_parameters: list[Finding] = [
        (
            (*parent_path, "parameters", name),
            f"{puppet.name} has no such parameter{did_you_mean(name, parameter_names)}",
        )
        for name in member.parameters
        if name not in parameter_names
    ]
    if unknown_parameters:
        raise located.error(unknown_parameters, PuppetError)
    expanded = puppet.expanded()
    data = plain(expanded)
    for _, parameter in parameters(data):
        parameter["value"] = member.parameters.get(parameter["parameter"], parameter["value"])
    data["pose"] = data.get("pose", {}) | {k: plain(v) for k, v in member.pose.items()}
    try:
        posed_puppet = Puppet.model_validate(data, context=Located(folder=expanded._origin.folder))
    except PuppetError as error:
        raise PuppetError(_in_scene(m, parent_path, located) for m in error.mistakes) from None
    posed_puppet._origin = expanded._origin
    return posed_puppet


def _in_scene(mistake: Mistake, parent_path: tuple[str | int, ...], located: Located) -> Mistake:
    """A mistake in a member's pose or parameters, with its key in the scene's file."""
    section, _, key = mistake.key.partition(".")
    if section == "pose":
        return located.problem((*parent_path, section, key), mistake.message)
    return located.problem((*parent_path, "parameters"), f"{mistake.key}: {mistake.message}")


def _common_value(
    key: str, value_of_scene: Any, placements: list[_PlacedMember], findings: list[Finding]
) -> Any:
    """Gravity or floor: the scene's own, or else the common one of the puppets' files."""
    if value_of_scene is not None:
        return plain(value_of_scene)
    values: dict[str, tuple[str, Any]] = {}
    for placement in placements:
        value = plain(getattr(placement.puppet, key))
        if value is not None:
            values.setdefault(repr(value), (placement.member.name, value))
    if len(values) > 1:
        values_text = ", ".join(f"{value} ({name})" for name, value in values.values())
        findings.append(((), f"the puppets differ in {key}: {values_text}; give the scene its own"))
    return next((value for _, value in values.values()), None)


def _contact(scene: Scene, placements: list[_PlacedMember], findings: list[Finding]) -> Any:
    """Contact rules: the scene's own, or else the common ones of the puppets' files."""
    if isinstance(scene.contact, Contact):
        return plain(scene.contact) | {
            "pairs": _contact_pairs(scene, scene.contact, placements, findings)
        }
    if scene.contact is not None:
        return scene.contact
    with_rules = [p for p in placements if p.puppet.contact is not None]
    if not with_rules:
        return None
    rules = [plain(p.puppet.touching) for p in with_rules]
    common_rules = [rule and {k: v for k, v in rule.items() if k != "pairs"} for rule in rules]
    if any(rule != common_rules[0] for rule in common_rules):
        names = ", ".join(p.member.name for p in with_rules)
        findings.append(((), f"the puppets {names} differ in contact; give the scene its own"))
    if common_rules[0] is None:
        return False
    pairs = [
        pair | {"between": [placement.contact_name(name) for name in pair["between"]]}
        for placement, rule in zip(with_rules, rules, strict=True)
        for pair in rule.get("pairs", [])
    ]
    return common_rules[0] | {"pairs": pairs}


def _contact_pairs(
    scene: Scene, rules: Contact, placements: list[_PlacedMember], findings: list[Finding]
) -> list[dict[str, Any]]:
    """The scene's own pairs; a single member's name is replaced by the names of all its parts."""
    parts = {
        placement.member.name: [
            placement.part_name(part.name)
            for part in (*placement.puppet.bodies, *placement.puppet.obstacles)
        ]
        for placement in placements
    }
    allowed_names = {FLOOR, *(name for _, name in scene.names())}.union(*parts.values())
    parts_of = parts if len(placements) == 1 else {}
    pairs: list[dict[str, Any]] = []
    for i, pair in enumerate(rules.pairs):
        for k, name in enumerate(pair.between):
            if name not in allowed_names:
                text = f"no body, obstacle, prop or puppet is called {shown(name)}"
                path = ("contact", "pairs", i, "between", k)
                findings.append((path, text + did_you_mean(name[:64], allowed_names)))
        first_names, second_names = (parts_of.get(name, [name]) for name in pair.between)
        pairs += [
            plain(pair) | {"between": [a, b]}
            for a, b in product(first_names, second_names)
            if a < b or first_names is not second_names
        ]
    return pairs


def _mesh_folder(placements: list[_PlacedMember], located: Located) -> Path:
    """The deepest folder that contains all mesh files."""
    folders = [
        placement.puppet._origin.folder for placement in placements if _has_meshes(placement.puppet)
    ]
    return Path(os.path.commonpath([located.folder.resolve(), *(f.resolve() for f in folders)]))


def _has_meshes(puppet: Puppet) -> bool:
    shapes = [shape for body in puppet.bodies for shape in body.shapes]
    return any(shape.type == "mesh" for shape in (*shapes, *puppet.obstacles))


def _add_member(data: dict[str, Any], placement: _PlacedMember, folder: Path) -> dict[str, str]:
    """Adds the parts of a puppet to the data of the scene.

    Returns:
        Name of a puppet's obstacle that equals an obstacle of the scene -> name of the latter.
    """
    parts = _data_in_scene(placement, plain(placement.puppet), folder)
    if placement.frame != "world":
        joint = {"type": "fixed", "at": plain(placement.member.at)}
        if placement.member.orientation is not None:
            joint["orientation"] = plain(placement.member.orientation)
        data["bodies"].append({"name": placement.frame, "joint": joint})
    for key in ("bodies", "strings", "springs", "drives"):
        data[key] += parts.get(key, [])
    shared_obstacles: dict[str, str] = {}
    for obstacle in parts["obstacles"]:
        equal_names = [
            o["name"] for o in data["obstacles"] if _without_name(o) == _without_name(obstacle)
        ]
        if equal_names:
            shared_obstacles[obstacle["name"]] = equal_names[0]
        else:
            data["obstacles"].append(obstacle)
    data["pose"] |= parts.get("pose", {})
    return shared_obstacles


def _without_name(obstacle: dict[str, Any]) -> dict[str, Any]:
    """An obstacle without its name: files of several puppets may contain the same table."""
    return {key: value for key, value in obstacle.items() if key != "name"}


def _data_in_scene(placement: _PlacedMember, parts: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The plain data of a puppet, with its names and positions in the scene."""
    for body in parts["bodies"]:
        body["name"] = placement.part_name(body["name"])
        body["parent"] = placement.body_name(body.get("parent", "world"))
        if "name" in body.get("joint", {}):
            body["joint"]["name"] = placement.part_name(body["joint"]["name"])
    for key, points in (("strings", "path"), ("springs", "between")):
        for item in parts.get(key, []):
            item["name"] = placement.part_name(item["name"])
            item[points] = [_point(placement, point) for point in item[points]]
    for drive in parts.get("drives", []):
        drive["on"] = [placement.part_name(name) for name in drive["on"]]
    parts["pose"] = {
        placement.part_name(name): value for name, value in parts.get("pose", {}).items()
    }
    parts["obstacles"] = [_obstacle(placement, o) for o in parts.get("obstacles", [])]
    for _, parameter in parameters(parts):
        parameter["parameter"] = placement.part_name(parameter["parameter"])
    subfolder = os.path.relpath(placement.puppet._origin.folder.resolve(), folder)
    shapes = [shape for body in parts["bodies"] for shape in body.get("shapes", [])]
    for shape in (*shapes, *parts["obstacles"]):
        if shape["type"] == "mesh":
            shape["file"] = PurePath(subfolder, shape["file"]).as_posix()
    return parts


def _point(placement: _PlacedMember, point: dict[str, Any]) -> dict[str, Any]:
    """A point of a string or spring; points in the puppet's world are moved to its frame."""
    if "body" in point:
        return point | {"body": placement.part_name(point["body"])}
    if "driven" in point:
        return point | {"parent": placement.body_name(point.get("parent", "world"))}
    if placement.frame == "world":
        return point
    return {"body": placement.frame, "at": point["world"]}


def _obstacle(placement: _PlacedMember, obstacle: dict[str, Any]) -> dict[str, Any]:
    """An obstacle of a puppet's file, at its place in the scene."""
    moved = obstacle | {"name": placement.part_name(obstacle["name"])}
    if placement.frame == "world":
        return moved
    orientation = placement.member.orientation
    R = np.eye(3) if orientation is None else orientation.matrix
    r = np.array(placement.member.at)
    keys = ("from", "to") if obstacle["type"] == "capsule" else ("at",)
    for key in keys:
        moved[key] = (R @ np.array(obstacle.get(key, [0.0, 0.0, 0.0])) + r).tolist()
    if obstacle["type"] in ("box", "ellipsoid", "mesh") and orientation is not None:
        inner_orientation = obstacle.get("orientation")
        R_inner = (
            np.eye(3)
            if inner_orientation is None
            else type(orientation).model_validate(inner_orientation).matrix
        )
        moved["orientation"] = {"quaternion": rotation.quaternion(R @ R_inner).tolist()}
    return moved


def _add_prop(data: dict[str, Any], prop: Prop) -> None:
    """Adds a prop: a body on a free joint, at its start place."""
    body = {k: v for k, v in plain(prop).items() if k not in ("at", "orientation")}
    data["bodies"].append(body | {"joint": {"type": "free"}})
    data["pose"] |= {f"{prop.name}.{axis}": x for axis, x in zip("xyz", prop.at, strict=True)}
    if prop.orientation is not None:
        quaternion = rotation.quaternion(prop.orientation.matrix)
        data["pose"][f"{prop.name}.rotation"] = quaternion.tolist()


def _origin(
    scene: Scene, placements: list[_PlacedMember], located: Located, folder: Path
) -> Origin:
    """File and line of every name of the scene."""
    lines: dict[str, int] = {}
    files: dict[str, str] = {}
    for placement in placements:
        for name, _ in named_parts(placement.puppet):
            file, line = placement.puppet.locate(name)
            files[placement.part_name(name)] = file
            if line is not None:
                lines[placement.part_name(name)] = line
    for path, name in scene.names():
        if (line := located.line(path)) is not None:
            lines[name] = line
    return Origin(located.file, folder, lines, files)
