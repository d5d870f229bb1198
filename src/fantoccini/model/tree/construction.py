"""Construction of a puppet's tree: links in topological order, rows, coordinates.

A link is a body on its joint, a driven string end, or a point mass of a chain. A row is a string,
limit, spring or drive.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from fantoccini.base.documents import Number, value_of
from fantoccini.model.puppet import Attachment, Body, Chain, Joint, Puppet, String, shape_inertia
from fantoccini.model.tree.chains import mass_link, placed
from fantoccini.model.tree.coordinates import Coordinate, Role
from fantoccini.model.tree.joints import AXES, Joints, carriage, suffixes
from fantoccini.model.tree.structure import (
    WORLD,
    ChainRow,
    LimitRow,
    MassShare,
    Point,
    SpringRow,
    StringRow,
    Tree,
)

MAX_CONTACTS = 64
"""Maximum number of contact points in a step, for puppets with contact."""

Pose = dict[str, float | tuple[float, ...]]
"""Coordinate -> start value, or ``joint.rotation`` -> quaternion."""


class _TreeBuilder:
    """Collects the links, rows and coordinates of a puppet."""

    def __init__(self) -> None:
        self.joints = Joints()
        self.strings: list[StringRow] = []
        self.springs: list[SpringRow] = []
        self.limits: list[LimitRow] = []
        self.chains: list[ChainRow] = []
        self.parameters: dict[str, float] = {}

    def add_puppet(self, puppet: Puppet) -> None:
        link_of = {"world": WORLD}
        self.joints.motors = {name: drive for drive in puppet.drives for name in drive.on}
        for body in _parents_first(puppet.bodies):
            link_of[body.name] = self.add_body(body, link_of[body.parent], puppet.pose)
        for string in puppet.strings:
            self.add_string(string, link_of, puppet.pose)
        for spring in puppet.springs:
            start, end = (_point(a, link_of) for a in spring.between)
            row = SpringRow(
                spring.name, (start, end), spring.stiffness, spring.rest, spring.damping
            )
            self.springs.append(row)
        self.parameters = puppet.parameters()

    def add_body(self, body: Body, parent: int, pose: Pose) -> int:
        joint = body.joint
        name = joint.name or body.name
        link = replace(
            carriage(body.name, name),
            parent=parent,
            damping=joint.damping,
            armature=joint.armature,
            stiffness=joint.spring.stiffness if joint.spring else 0.0,
            rest=joint.spring.rest if joint.spring else 0.0,
            mass_shares=_mass_shares(body),
            mass=body.mass,
            com=body.com,
            inertia=None if body.inertia is None else _six_entries(body.inertia),
            drag=(body.drag.linear, body.drag.quadratic, body.drag.angular)
            if body.drag
            else (0.0, 0.0, 0.0),
            shapes=tuple(body.shapes),
        )
        index = self.joints.body(link, joint, _start(name, pose))
        self.add_limits(joint, name, index)
        return index

    def add_limits(self, joint: Joint, name: str, link: int) -> None:
        def add_limit(
            side: str,
            bound: float | None,
            a: tuple[float, ...] | None = None,
            b: tuple[float, ...] | None = None,
        ) -> None:
            if bound is not None:
                axes = (None if axis is None else np.array(axis) for axis in (a, b))
                self.limits.append(LimitRow(f"{name}.{side}", link, side, bound, *axes))

        if joint.limits:
            add_limit("lower", joint.limits.lower)
            add_limit("upper", joint.limits.upper)
        if joint.cone:
            add_limit("cone", joint.cone.max, joint.cone.axis, joint.cone.body_axis)
        if joint.twist:
            b = joint.twist.axis or (joint.cone.body_axis if joint.cone else None)
            add_limit("twist.lower", joint.twist.lower, None, b)
            add_limit("twist.upper", joint.twist.upper, None, b)

    def add_string(self, string: String, link_of: dict[str, int], pose: Pose) -> None:
        points = tuple(
            self.driven_end(string.name, a, a.driven, link_of) if a.driven else _point(a, link_of)
            for a in string.path
        )
        length: Number | None = None
        length_index: tuple[int, int] | None = None
        if string.length == "driven":
            start = _start(string.name, pose).get(".length", np.nan)
            role, length_index = self.joints.length(string.name, start)
        else:
            length, role = string.length, Role.FIXED
            row = Coordinate(f"{string.name}.length", role, string.name, "m", None)
            self.joints.table.rows.append(row)
        if string.chain is not None:
            self.add_chain(string, string.chain, points, length, length_index, role)
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

    def add_chain(
        self,
        string: String,
        chain: Chain,
        ends: tuple[Point, ...],
        length: Number | None,
        length_index: tuple[int, int] | None,
        role: Role,
    ) -> None:
        """Adds a string as springs and point masses, hand.1 to hand.7."""
        masses = []
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

    def driven_end(
        self, string: str, end: Attachment, axes: tuple[str, ...], link_of: dict[str, int]
    ) -> Point:
        """A massless body on driven axes: `driven: [x, y]` gives hand.x and hand.y."""
        return Point(self.joints.end(string, link_of[end.parent], axes, end.at), (0.0, 0.0, 0.0))


def grow(puppet: Puppet) -> Tree:
    """The tree of a puppet: links in topological order, rows, the coordinate table."""
    builder = _TreeBuilder()
    builder.add_puppet(puppet.expanded())
    tree = Tree(
        name=puppet.name,
        gravity=puppet.gravity,
        links=tuple(builder.joints.links),
        strings=tuple(builder.strings),
        springs=tuple(builder.springs),
        limits=tuple(builder.limits),
        coordinates=builder.joints.table.finish(),
        parameters=builder.parameters,
        drives=tuple(builder.joints.drives),
        chains=tuple(builder.chains),
        n_contacts=MAX_CONTACTS if puppet.touching else 0,
    )
    table = tree.coordinates
    # A driven length without a start stays NaN: the initial state sets it.
    start_D, _ = placed(tree, table.start_D, table.start_K, value_of)
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


def _start(joint: str, pose: Pose) -> dict[str, float]:
    """Suffixes of a joint's or length's configuration numbers -> their values in the pose."""
    values: dict[str, float] = {}
    for key, value in pose.items():
        if joint not in (key, key.rpartition(".")[0]):
            continue
        if isinstance(value, tuple):
            values |= dict(zip(suffixes("ball")[0], value, strict=True))
        else:
            values[key[len(joint) :]] = value
    return values


def _point(attachment: Attachment, link_of: dict[str, int]) -> Point:
    if attachment.world is not None:
        return Point(WORLD, attachment.world)
    assert attachment.body is not None, "a driven end has a body of its own"
    return Point(link_of[attachment.body], attachment.at)


def _mass_shares(body: Body) -> tuple[MassShare, ...]:
    mass_shares = []
    for shape in body.shapes:
        if shape.mass is not None:
            mass_shares.append(MassShare(shape.mass, 1.0, shape_inertia(shape)[1]))
        elif shape.density is not None:
            mass_shares.append(MassShare(shape.density, *shape_inertia(shape)))
    return tuple(mass_shares)


def _six_entries(inertia: tuple[Number, ...]) -> tuple[Number, ...]:
    return inertia if len(inertia) == 6 else (*inertia, 0.0, 0.0, 0.0)
