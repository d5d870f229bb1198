"""World -> Tree: links in topological order, rows, and places handed out to coordinates."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import fields, replace
from typing import Any

import numpy as np
from pydantic import BaseModel

from fantoccini.puppet import (
    Attachment,
    Body,
    Chain,
    Joint,
    Number,
    Parameter,
    Puppet,
    String,
    value_of,
)
from fantoccini.puppet.shapes import shape_inertia
from fantoccini.tree.chains import mass_link, placed
from fantoccini.tree.coordinates import Coordinate, Role
from fantoccini.tree.joints import AXES, Joints, carriage, suffixes
from fantoccini.tree.structure import (
    WORLD,
    ChainRow,
    LimitRow,
    Lump,
    Point,
    SpringRow,
    StringRow,
    Tree,
)
from fantoccini.world import World


class _Grower:
    """Collects links, rows and coordinates of one puppet after the other."""

    def __init__(self) -> None:
        self.joints = Joints()
        self.strings: list[StringRow] = []
        self.springs: list[SpringRow] = []
        self.limits: list[LimitRow] = []
        self.chains: list[ChainRow] = []
        self.parameters: dict[str, float] = {}

    def puppet(self, puppet: Puppet, prefix: str) -> None:
        place = {"world": WORLD}
        marks = [len(part) for part in self.parts]
        drives = puppet.drives
        self.joints.motors = {prefix + name: drive for drive in drives for name in drive.on}
        for body in _parents_first(puppet.bodies):
            place[body.name] = self.body(body, place[body.parent], puppet.pose, prefix)
        for string in puppet.strings:
            self.string(string, place, puppet.pose, prefix)
        for spring in puppet.springs:
            start, end = (_point(a, place) for a in spring.between)
            ends = start, end
            self.springs.append(
                SpringRow(prefix + spring.name, ends, spring.stiffness, spring.rest, spring.damping)
            )
        for name, value in puppet.parameters().items():
            self.parameters[prefix + name] = value
        if prefix:
            for part, mark in zip(self.parts, marks, strict=True):
                part[mark:] = [_prefixed(row, prefix) for row in part[mark:]]

    @property
    def parts(self) -> tuple[list[Any], ...]:
        """The lists whose rows may hold parameters."""
        return self.joints.links, self.strings, self.springs, self.chains, self.joints.drives

    def body(self, body: Body, parent: int, pose: dict[str, Any], prefix: str) -> int:
        joint = body.joint
        joint_name = joint.name or body.name
        name = prefix + joint_name
        link = replace(
            carriage(prefix + body.name, name),
            parent=parent,
            damping=joint.damping,
            stiffness=joint.spring.stiffness if joint.spring else 0.0,
            rest=joint.spring.rest if joint.spring else 0.0,
            lumps=_lumps(body),
            mass=body.mass,
            com=body.com,
            inertia=None if body.inertia is None else _six(body.inertia),
            drag=(body.drag.linear, body.drag.quadratic, body.drag.angular)
            if body.drag
            else (0.0, 0.0, 0.0),
            shapes=tuple(body.shapes),
        )
        index = self.joints.body(link, joint, _start(joint_name, pose))
        self.joint_limits(joint, name, index)
        return index

    def joint_limits(self, joint: Joint, name: str, link: int) -> None:
        def add(
            side: str,
            bound: float | None,
            a: tuple[float, ...] | None = None,
            b: tuple[float, ...] | None = None,
        ) -> None:
            if bound is not None:
                axes = (None if axis is None else np.array(axis) for axis in (a, b))
                self.limits.append(LimitRow(f"{name}.{side}", link, side, bound, *axes))

        if joint.limits:
            add("lower", joint.limits.lower)
            add("upper", joint.limits.upper)
        if joint.cone:
            add("cone", joint.cone.max, joint.cone.axis, joint.cone.body_axis)
        if joint.twist:
            b = joint.twist.axis or (joint.cone.body_axis if joint.cone else None)
            add("twist.lower", joint.twist.lower, None, b)
            add("twist.upper", joint.twist.upper, None, b)

    def string(
        self, string: String, place: dict[str, int], pose: dict[str, Any], prefix: str
    ) -> None:
        points = tuple(
            self.driven_end(string.name, a, a.driven, prefix) if a.driven else _point(a, place)
            for a in string.path
        )
        length: Number | None = None
        length_index: tuple[int, int] | None = None
        if string.length == "driven":
            start = float(pose.get(f"{string.name}.length", np.nan))
            role, length_index = self.joints.length(prefix + string.name, start)
        else:
            length, role = string.length, Role.FIXED
            owner = prefix + string.name
            row = Coordinate(f"{owner}.length", role, owner, "m", None)
            self.joints.table.rows.append(row)
        if string.chain is not None:
            self.chain(string, string.chain, points, length, length_index, role, prefix)
            return
        self.strings.append(
            StringRow(
                name=prefix + string.name,
                points=points,
                length=length,
                length_index=length_index,
                wire=string.wire,
                colour=string.colour,
                restitution=string.restitution,
                max_tension=string.max_tension,
                rewind_speed=string.rewind_speed,
                length_role=role,
            )
        )

    def chain(
        self, string: String, chain: Chain, ends: tuple[Point, ...], length: Number | None,
        length_index: tuple[int, int] | None, role: Role, prefix: str,
    ) -> None:  # fmt: skip
        """A string as masses, hand.1 to hand.7, and springs; they are placed when all is there."""
        masses = []
        for k in range(1, chain.pieces):
            name = f"{prefix}{string.name}.{k}"
            start = {f".{a}": np.nan for a in AXES}
            link = mass_link(name, chain.mass, chain.pieces - 1)
            masses.append(Point(self.joints.add(link, "translation", AXES, start), (0.0,) * 3))
        self.chains.append(
            ChainRow(
                name=prefix + string.name,
                points=(ends[0], *masses, ends[1]),
                stiffness=chain.stiffness,
                damping=chain.damping,
                length=length,
                length_index=length_index,
                colour=string.colour,
                length_role=role,
            )
        )

    def driven_end(
        self, string: str, end: Attachment, axes: tuple[str, ...], prefix: str
    ) -> Point:
        """A massless body on driven world axes: `driven: [x, y]` gives hand.x and hand.y."""
        return Point(self.joints.end(prefix + string, axes, end.at), (0.0, 0.0, 0.0))


def grow(world: World) -> Tree:
    """The tree of a world: links in topological order, rows, the coordinate table.

    Args:
        world: one or more puppets; with several, every name is preceded by the puppet's name and
            a slash.

    Returns:
        The tree the equations are derived from.
    """
    grower = _Grower()
    for puppet in world.puppets:
        prefix = f"{puppet.name}/" if len(world.puppets) > 1 else ""
        grower.puppet(puppet.expanded(), prefix)
    first = f"{world.puppets[0].name}/" if len(world.puppets) > 1 else ""
    tree = Tree(
        name=world.name,
        gravity=_prefixed(world.gravity, first) if first else world.gravity,
        links=tuple(grower.joints.links),
        strings=tuple(grower.strings),
        springs=tuple(grower.springs),
        limits=tuple(grower.limits),
        coordinates=grower.joints.table.finish(),
        parameters=grower.parameters,
        drives=tuple(grower.joints.drives),
        chains=tuple(grower.chains),
    )
    table = tree.coordinates
    # A driven length without a start stays nan: the state that is asked for gives it one.
    start_D, _ = placed(tree, table.start_D, table.start_K, value_of)
    return replace(tree, coordinates=replace(table, start_D=start_D))


def _prefixed(part: Any, prefix: str) -> Any:
    """The same part of a tree with its parameters' names preceded by the puppet's."""
    if isinstance(part, Parameter):
        return Parameter.model_construct(parameter=prefix + part.parameter, value=part.value)
    if isinstance(part, tuple):
        return tuple(_prefixed(x, prefix) for x in part)
    if isinstance(part, BaseModel):
        names = type(part).model_fields
        return part.model_copy(update={n: _prefixed(getattr(part, n), prefix) for n in names})
    if dataclasses.is_dataclass(part) and not isinstance(part, type):
        return replace(
            part, **{f.name: _prefixed(getattr(part, f.name), prefix) for f in fields(part)}
        )
    return part


def _parents_first(bodies: Iterable[Body]) -> list[Body]:
    children: dict[str, list[Body]] = {}
    for body in bodies:
        children.setdefault(body.parent, []).append(body)
    order: list[Body] = []
    stack = list(reversed(children.get("world", [])))
    while stack:
        body = stack.pop()
        order.append(body)
        stack.extend(reversed(children.get(body.name, [])))
    return order


def _start(joint: str, pose: dict[str, Any]) -> dict[str, float]:
    """Suffix of a joint's configuration number -> its value in the pose, where it has one."""
    own = [key for key in pose if key == joint or key.startswith(f"{joint}.")]
    found = {key[len(joint) :]: pose[key] for key in own}
    rotation = found.pop(".rotation", None)
    if rotation is not None:
        found |= dict(zip(suffixes("ball")[0], rotation, strict=True))
    return {suffix: float(value) for suffix, value in found.items()}


def _point(attachment: Attachment, place: dict[str, int]) -> Point:
    if attachment.world is not None:
        return Point(WORLD, attachment.world)
    assert attachment.body is not None, "a driven end is no point of a body"
    return Point(place[attachment.body], attachment.at)


def _lumps(body: Body) -> tuple[Lump, ...]:
    lumps = []
    for shape in body.shapes:
        if shape.mass is not None:
            lumps.append(Lump(shape.mass, 1.0, shape_inertia(shape)[1]))
        elif shape.density is not None:
            lumps.append(Lump(shape.density, *shape_inertia(shape)))
    return tuple(lumps)


def _six(inertia: tuple[Number, ...]) -> tuple[Number, ...]:
    return inertia if len(inertia) == 6 else (*inertia, 0.0, 0.0, 0.0)
