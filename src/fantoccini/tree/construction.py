"""Puppet -> Tree: links in topological order, rows, and places handed out to coordinates."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from fantoccini.puppet import Attachment, Body, Number, Parameter, Puppet, String
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


class _Grower:
    """Collects the links, rows and coordinates of a puppet."""

    def __init__(self) -> None:
        self.joints = Joints()
        self.strings: list[StringRow] = []
        self.springs: list[SpringRow] = []
        self.limits: list[LimitRow] = []
        self.chains: list[ChainRow] = []
        self.parameters: dict[str, float] = {}

    def puppet(self, puppet: Puppet) -> None:
        place = {"world": WORLD}
        self.joints.motors = {name: drive for drive in puppet.drives for name in drive.on}
        for body in _parents_first(puppet.bodies):
            place[body.name] = self.body(body, place[body.parent], puppet.pose)
        for string in puppet.strings:
            self.string(string, place, puppet.pose)
        for spring in puppet.springs:
            ends = tuple(_point(a, place) for a in spring.between)
            self.springs.append(
                SpringRow(spring.name, ends, spring.stiffness, spring.rest, spring.damping)
            )
        self.parameters = puppet.parameters()

    def body(self, body: Body, parent: int, pose: dict[str, Any]) -> int:
        joint = body.joint
        name = joint.name or body.name
        link = replace(
            carriage(body.name, name),
            parent=parent,
            damping=joint.damping,
            stiffness=joint.spring.stiffness if joint.spring else 0.0,
            rest=joint.spring.rest if joint.spring else 0.0,
            lumps=_lumps(body),
            mass=body.mass,
            com=None if body.com is None else tuple(body.com),
            inertia=None if body.inertia is None else _six(body.inertia),
            drag=(body.drag.linear, body.drag.quadratic, body.drag.angular)
            if body.drag
            else (0.0, 0.0, 0.0),
            shapes=tuple(body.shapes),
        )
        index = self.joints.body(link, joint, _start(name, pose))
        self.joint_limits(joint, name, index)
        return index

    def joint_limits(self, joint: Any, name: str, link: int) -> None:
        def add(side: str, bound: float | None, a: Any = None, b: Any = None) -> None:
            if bound is not None:
                self.limits.append(LimitRow(f"{name}.{side}", link, side, bound, a, b))

        if joint.limits:
            add("lower", joint.limits.lower)
            add("upper", joint.limits.upper)
        if joint.cone:
            a = np.array(joint.cone.axis)
            b = a if joint.cone.of is None else np.array(joint.cone.of)
            add("cone", joint.cone.max, a, b)
        if joint.twist:
            b = joint.twist.axis
            if b is None:
                b = joint.cone.axis if joint.cone.of is None else joint.cone.of
            add("twist.lower", joint.twist.lower, None, np.array(b))
            add("twist.upper", joint.twist.upper, None, np.array(b))

    def string(self, string: String, place: dict[str, int], pose: dict[str, Any]) -> None:
        points = tuple(
            self.driven_end(string.name, a, place) if a.driven else _point(a, place)
            for a in string.path
        )
        length, length_index, role = string.length, None, Role.FIXED
        if length == "driven":
            start = float(pose.get(f"{string.name}.length", np.nan))
            role, length_index = self.joints.length(string.name, start)
            length = None
        else:
            row = Coordinate(f"{string.name}.length", role, string.name, "m", None)
            self.joints.table.rows.append(row)
        if string.chain is not None:
            self.chain(string, points, length, length_index, role)
            return
        self.strings.append(
            StringRow(
                name=string.name,
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
        self, string: String, ends: tuple[Any, ...], length: Number | None, length_index: Any,
        role: Role,
    ) -> None:  # fmt: skip
        """A string as masses, hand.1 to hand.7, and springs; they are placed when all is there."""
        chain, masses = string.chain, []
        for k in range(1, chain.pieces):
            name = f"{string.name}.{k}"
            start = {f".{a}": np.nan for a in AXES}
            link = mass_link(name, chain.mass, chain.pieces - 1)
            masses.append(Point(self.joints.add(link, "translation", AXES, start), (0.0,) * 3))
        self.chains.append(
            ChainRow(
                name=string.name,
                points=(ends[0], *masses, ends[1]),
                stiffness=chain.stiffness,
                damping=chain.damping,
                length=length,
                length_index=length_index,
                colour=string.colour,
                length_role=role,
            )
        )

    def driven_end(self, string: str, end: Attachment, place: dict[str, int]) -> Point:
        """A massless body on driven axes: `driven: [x, y]` gives hand.x and hand.y."""
        at = tuple(_value(x) if a in end.driven else x for a, x in zip(AXES, end.at, strict=True))
        return Point(self.joints.end(string, place[end.parent], end.driven, at), (0.0, 0.0, 0.0))


def grow(puppet: Puppet) -> Tree:
    """The tree of a puppet: links in topological order, rows, the coordinate table."""
    grower = _Grower()
    grower.puppet(puppet.expanded())
    tree = Tree(
        name=puppet.name,
        gravity=tuple(puppet.gravity),
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
    start_D, _ = placed(tree, table.start_D, table.start_K, _value)
    return replace(tree, coordinates=replace(table, start_D=start_D))


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
    found = {
        key[len(joint) :]: value
        for key, value in pose.items()
        if joint in (key, key.rpartition(".")[0])
    }
    rotation = found.pop(".rotation", None)
    if rotation is not None:
        found |= dict(zip(suffixes("ball")[0], rotation, strict=True))
    return {suffix: float(value) for suffix, value in found.items()}


def _point(attachment: Attachment, place: dict[str, int]) -> Point:
    if attachment.world is not None:
        return Point(WORLD, tuple(attachment.world))
    return Point(place[attachment.body], tuple(attachment.at))


def _lumps(body: Body) -> tuple[Lump, ...]:
    lumps = []
    for shape in body.shapes:
        if shape.mass is None and shape.density is None:
            continue
        volume, unit = shape_inertia(shape)
        if shape.mass is not None:
            lumps.append(Lump(shape.mass, 1.0, unit))
        else:
            lumps.append(Lump(shape.density, volume, unit))
    return tuple(lumps)


def _six(inertia: Any) -> tuple[Number, ...]:
    return tuple(inertia) if len(inertia) == 6 else (*inertia, 0.0, 0.0, 0.0)


def _value(number: Number) -> float:
    return number.value if isinstance(number, Parameter) else float(number)
