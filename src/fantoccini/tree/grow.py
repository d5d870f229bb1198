"""World -> Tree: links in topological order, rows, and places handed out to coordinates."""

from __future__ import annotations

import dataclasses
from dataclasses import fields

import numpy as np

from fantoccini.puppet import Attachment, Body, Number, Parameter, Puppet, String
from fantoccini.puppet.shapes import shape_inertia
from fantoccini.tree.chains import AXES, mass_link, placed
from fantoccini.tree.structure import (
    WORLD,
    ChainRow,
    Coordinate,
    CoordinateTable,
    LimitRow,
    Link,
    Lump,
    Point,
    Role,
    SpringRow,
    StringRow,
    Tree,
)
from fantoccini.world import World

_CONFIGURATION = {
    "fixed": (),
    "revolute": ("",),
    "prismatic": ("",),
    "ball": (".qw", ".qx", ".qy", ".qz"),
    "free": (".x", ".y", ".z", ".qw", ".qx", ".qy", ".qz"),
}
_VELOCITY = {
    "fixed": (),
    "revolute": ("",),
    "prismatic": ("",),
    "ball": (".wx", ".wy", ".wz"),
    "free": (".x", ".y", ".z", ".wx", ".wy", ".wz"),
}
_UNITS = {"revolute": "rad", ".x": "m", ".y": "m", ".z": "m", "prismatic": "m"}
_COLUMN = {"x": 0, "y": 1, "z": 2}


class _Table:
    """Hands out places in q_D, v_D, q_K, v_K while the tree grows."""

    def __init__(self) -> None:
        self.rows: list[Coordinate] = []
        self.names: dict[tuple[Role, str], list[str]] = {
            (role, what): [] for role in (Role.DYNAMIC, Role.DRIVEN) for what in "qv"
        }
        self.start: dict[Role, list[float]] = {Role.DYNAMIC: [], Role.DRIVEN: []}
        self.quaternions: dict[Role, list[tuple[int, int]]] = {Role.DYNAMIC: [], Role.DRIVEN: []}
        self.scalars: dict[Role, list[tuple[int, int]]] = {Role.DYNAMIC: [], Role.DRIVEN: []}
        self.rotations: dict[str, tuple[int, int]] = {}

    def add(
        self, owner: str, kind: str, role: Role, q: tuple[str, ...], v: tuple[str, ...], start: list
    ) -> tuple[slice, slice]:
        if role is Role.FIXED or not q:
            return slice(0, 0), slice(0, 0)
        q_names, v_names = self.names[role, "q"], self.names[role, "v"]
        q0, v0 = len(q_names), len(v_names)
        for k, suffix in enumerate(q):
            unit = _UNITS.get(suffix) or _UNITS.get(kind) or ("m" if suffix == ".length" else "1")
            self.rows.append(Coordinate(owner + suffix, role, owner, unit, q0 + k))
        q_names.extend(owner + s for s in q)
        v_names.extend(owner + s for s in v)
        self.start[role].extend(start)
        n_scalar = q.index(".qw") if ".qw" in q else len(q)
        self.scalars[role].extend((q0 + k, v0 + k) for k in range(n_scalar))
        if n_scalar < len(q):
            place = (q0 + n_scalar, v0 + n_scalar)
            self.quaternions[role].append(place)
            if role is Role.DRIVEN:
                self.rotations[owner + ".rotation"] = place
        return slice(q0, q0 + len(q)), slice(v0, v0 + len(v))

    def finish(self) -> CoordinateTable:
        dynamic, driven = Role.DYNAMIC, Role.DRIVEN
        return CoordinateTable(
            rows=tuple(self.rows),
            q_D=tuple(self.names[dynamic, "q"]),
            v_D=tuple(self.names[dynamic, "v"]),
            q_K=tuple(self.names[driven, "q"]),
            v_K=tuple(self.names[driven, "v"]),
            quaternions_D=tuple(self.quaternions[dynamic]),
            quaternions_K=tuple(self.quaternions[driven]),
            scalars_D=tuple(self.scalars[dynamic]),
            scalars_K=tuple(self.scalars[driven]),
            rotations=dict(self.rotations),
            start_D=np.array(self.start[dynamic], dtype=float),
            start_K=np.array(self.start[driven], dtype=float),
        )


class _Grower:
    """Collects links, rows and coordinates of one puppet after the other."""

    def __init__(self) -> None:
        self.table = _Table()
        self.links: list[Link] = []
        self.strings: list[StringRow] = []
        self.springs: list[SpringRow] = []
        self.limits: list[LimitRow] = []
        self.chains: list[ChainRow] = []
        self.parameters: dict[str, float] = {}

    def puppet(self, puppet: Puppet, prefix: str) -> None:
        place = {"world": WORLD}
        marks = [len(part) for part in self.parts]
        for body in _parents_first(puppet.bodies):
            place[body.name] = self.body(body, place[body.parent], puppet.pose, prefix)
        for string in puppet.strings:
            self.string(string, place, puppet.pose, prefix)
        for spring in puppet.springs:
            ends = tuple(_point(a, place) for a in spring.between)
            self.springs.append(
                SpringRow(prefix + spring.name, ends, spring.stiffness, spring.rest, spring.damping)
            )
        for name, value in puppet.parameters().items():
            self.parameters[prefix + name] = value
        if prefix:
            for part, mark in zip(self.parts, marks, strict=True):
                part[mark:] = [_prefixed(row, prefix) for row in part[mark:]]

    @property
    def parts(self) -> tuple[list, ...]:
        """The lists whose rows may hold parameters."""
        return self.links, self.strings, self.springs, self.chains

    def body(self, body: Body, parent: int, pose: dict, prefix: str) -> int:
        joint = body.joint
        joint_name = joint.name or body.name
        name = prefix + joint_name
        if joint.type == "translation":
            q = v = tuple(f".{a}" for a in joint.axes)
            axes = np.eye(3)[:, [_COLUMN[a] for a in joint.axes]]
        else:
            q, v = _CONFIGURATION[joint.type], _VELOCITY[joint.type]
            axes = np.zeros((3, 0)) if joint.axis is None else np.array(joint.axis)[:, None]
        role = Role.DRIVEN if joint.driven else Role.DYNAMIC
        if joint.type == "fixed":
            role = Role.FIXED
        q_slice, v_slice = self.table.add(
            name, joint.type, role, q, v, _start(joint_name, q, pose)
        )
        index = len(self.links)
        self.links.append(
            Link(
                name=prefix + body.name,
                parent=parent,
                joint=name,
                kind=joint.type,
                axes=axes,
                rotation=np.eye(3) if joint.orientation is None else joint.orientation.matrix,
                offset=tuple(joint.at),
                role=role,
                q=q_slice,
                v=v_slice,
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
        )
        self.joint_limits(joint, name, index)
        return index

    def joint_limits(self, joint, name: str, link: int) -> None:
        def add(side: str, bound: float | None, a=None, b=None) -> None:
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

    def string(self, string: String, place: dict[str, int], pose: dict, prefix: str) -> None:
        points = tuple(
            self.driven_end(string.name, a, prefix) if a.driven else _point(a, place)
            for a in string.path
        )
        length, length_index = string.length, None
        if length == "driven":
            start = [pose.get(f"{string.name}.length", np.nan)]
            q, v = self.table.add(
                prefix + string.name, "length", Role.DRIVEN, (".length",), (".length",), start
            )
            length, length_index = None, (q.start, v.start)
        else:
            self.table.rows.append(
                Coordinate(
                    f"{prefix}{string.name}.length", Role.FIXED, prefix + string.name, "m", None
                )
            )
        if string.chain is not None:
            self.chain(string, points, length, length_index, prefix)
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
            )
        )

    def chain(
        self, string: String, ends: tuple, length: Number | None, length_index, prefix: str
    ) -> None:
        """A string as masses, hand.1 to hand.7, and springs; they are placed when all is there."""
        chain, masses = string.chain, []
        for k in range(1, chain.pieces):
            name = f"{prefix}{string.name}.{k}"
            start = [np.nan] * len(AXES)
            q, v = self.table.add(name, "translation", Role.DYNAMIC, AXES, AXES, start)
            masses.append(Point(len(self.links), (0.0, 0.0, 0.0)))
            self.links.append(mass_link(name, chain.mass, chain.pieces - 1, q, v))
        self.chains.append(
            ChainRow(
                name=prefix + string.name,
                points=(ends[0], *masses, ends[1]),
                stiffness=chain.stiffness,
                damping=chain.damping,
                length=length,
                length_index=length_index,
                colour=string.colour,
            )
        )

    def driven_end(self, string: str, end: Attachment, prefix: str) -> Point:
        """A massless body on driven world axes: `driven: [x, y]` gives hand.x and hand.y."""
        suffixes = tuple(f".{a}" for a in end.driven)
        columns = [_COLUMN[a] for a in end.driven]
        q, v = self.table.add(
            prefix + string,
            "translation",
            Role.DRIVEN,
            suffixes,
            suffixes,
            [_value(end.at[c]) for c in columns],
        )
        fixed = tuple(0.0 if c in columns else end.at[c] for c in range(3))
        self.links.append(
            Link(
                name=f"{prefix}{string}.end",
                parent=WORLD,
                joint=prefix + string,
                kind="translation",
                axes=np.eye(3)[:, columns],
                rotation=np.eye(3),
                offset=fixed,
                role=Role.DRIVEN,
                q=q,
                v=v,
            )
        )
        return Point(len(self.links) - 1, (0.0, 0.0, 0.0))


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
        gravity=_prefixed(tuple(world.gravity), first) if first else tuple(world.gravity),
        links=tuple(grower.links),
        strings=tuple(grower.strings),
        springs=tuple(grower.springs),
        limits=tuple(grower.limits),
        coordinates=grower.table.finish(),
        parameters=grower.parameters,
        chains=tuple(grower.chains),
    )
    table = tree.coordinates
    # A driven length without a start stays nan: the state that is asked for gives it one.
    start_D, _ = placed(tree, table.start_D, table.start_K, _value)
    return dataclasses.replace(tree, coordinates=dataclasses.replace(table, start_D=start_D))


def _prefixed(part, prefix: str):
    """The same part of a tree with its parameters' names preceded by the puppet's."""
    if isinstance(part, Parameter):
        return Parameter.model_construct(parameter=prefix + part.parameter, value=part.value)
    if isinstance(part, tuple):
        return tuple(_prefixed(x, prefix) for x in part)
    if dataclasses.is_dataclass(part):
        return dataclasses.replace(
            part, **{f.name: _prefixed(getattr(part, f.name), prefix) for f in fields(part)}
        )
    return part


def _parents_first(bodies) -> list[Body]:
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


def _start(joint: str, q: tuple[str, ...], pose: dict) -> list[float]:
    start = [float(pose.get(joint + s, 1.0 if s == ".qw" else 0.0)) for s in q]
    rotation = pose.get(joint + ".rotation")
    if rotation is not None and ".qw" in q:
        k = q.index(".qw")
        start[k : k + 4] = rotation
    return start


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


def _six(inertia) -> tuple[Number, ...]:
    return tuple(inertia) if len(inertia) == 6 else (*inertia, 0.0, 0.0, 0.0)


def _value(number: Number) -> float:
    return number.value if isinstance(number, Parameter) else float(number)
