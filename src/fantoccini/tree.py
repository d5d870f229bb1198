"""The tree: links in topological order and the table of coordinates.

A :class:`Tree` is what the derivation reads. Every link carries one joint to its parent; every
joint coordinate and every string length is one row of the :class:`CoordinateTable`, with a role:

* ``dynamic``  moves by the equations of motion (q_D, v_D),
* ``driven``   is a kinematic input (q_K, v_K),
* ``fixed``    is a number.

Configuration and velocity differ in size where a joint rotates freely: a ball joint has four
configuration numbers (a unit quaternion w, x, y, z) and three velocities (the angular velocity in
the body's frame).
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field

import numpy as np

from fantoccini.puppet import Attachment, Body, Number, Parameter, Puppet, Shape, String
from fantoccini.puppet.shapes import UnitInertia, shape_inertia
from fantoccini.world import World

WORLD = -1
"""Index of the world where a link's parent or a point's carrier is asked for."""


class Role(enum.StrEnum):
    """What decides a coordinate's motion."""

    DYNAMIC = "dynamic"
    DRIVEN = "driven"
    FIXED = "fixed"


@dataclass(frozen=True)
class Lump:
    """One contribution to a link's inertia.

    Attributes:
        amount: the mass [kg], or the density [kg/m^3] when ``volume`` is not 1.
        volume: factor that turns ``amount`` into a mass.
        unit: centre of mass (3,) [m] and inertia per unit mass about it (3, 3) [m^2].
    """

    amount: Number
    volume: float
    unit: UnitInertia


@dataclass(frozen=True)
class Link:
    """A body, and the joint that carries it.

    The body frame's pose in its parent is T(offset) R(rotation) J(q), with J the joint's motion.

    Attributes:
        name: the body's name.
        parent: index of the parent link, ``WORLD`` for the world.
        joint: the joint's name.
        kind: fixed, revolute, prismatic, translation, ball or free.
        axes: (3, k) unit columns, in the joint frame: the axis of a revolute or prismatic joint,
            the axes of a translation.
        rotation: (3, 3) orientation of the joint frame in the parent.
        offset: origin of the joint frame in the parent [m].
        role: what decides the joint's motion.
        q, v: places of the joint's coordinates in (q_D, v_D) or (q_K, v_K), by role.
        damping: on every velocity of the joint [N s/m or N m s/rad].
        stiffness, rest: joint spring [N/m or N m/rad], [m or rad].
        lumps: contributions of the shapes to the inertia.
        mass, com, inertia: explicit values that override the lumps (None: take theirs);
            the inertia is (ixx, iyy, izz, ixy, ixz, iyz) about the centre of mass.
        drag: (linear [N s/m], quadratic [N s^2/m^2], angular [N m s]).
        shapes: geometry, for pictures and collisions.
    """

    name: str
    parent: int
    joint: str
    kind: str
    axes: np.ndarray
    rotation: np.ndarray
    offset: tuple[Number, Number, Number]
    role: Role
    q: slice
    v: slice
    damping: Number = 0.0
    stiffness: Number = 0.0
    rest: Number = 0.0
    lumps: tuple[Lump, ...] = ()
    mass: Number | None = None
    com: tuple[Number, Number, Number] | None = None
    inertia: tuple[Number, ...] | None = None
    drag: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    shapes: tuple[Shape, ...] = ()


@dataclass(frozen=True)
class Point:
    """A point fixed on a link or on the world.

    Attributes:
        link: index of the link, ``WORLD`` for the world.
        at: place in the link's frame [m].
    """

    link: int
    at: tuple[Number, Number, Number]


@dataclass(frozen=True)
class StringRow:
    """A string: h = (path length) - L <= 0.

    Attributes:
        name: the string's name.
        points: two or more points the string runs through.
        length: L [m], or None when the length is driven.
        length_index: place of the length in q_K and v_K as (q, v); None when it is a number.
        wire: True for a two-sided constraint (Sec. III-B).
        colour: "#rrggbb" or None.
    """

    name: str
    points: tuple[Point, ...]
    length: Number | None
    length_index: tuple[int, int] | None
    wire: bool
    colour: str | None


@dataclass(frozen=True)
class SpringRow:
    """A spring between two points: V = stiffness/2 (d - rest)^2, with damping along the line."""

    name: str
    points: tuple[Point, Point]
    stiffness: Number
    rest: Number
    damping: Number


@dataclass(frozen=True)
class LimitRow:
    """A one-sided limit of a joint, h <= 0.

    ``lower``: bound - q; ``upper``: q - bound; ``cone``: cos(bound) - a . R b;
    ``twist.lower``, ``twist.upper``: the same as lower and upper for the twist of R about b.

    Attributes:
        name: joint name, dot, side.
        link: index of the link whose joint is limited.
        side: lower, upper, cone, twist.lower or twist.upper.
        bound: [rad or m].
        a, b: unit axes (3,) in the joint frame and in the body frame (ball joints only).
    """

    name: str
    link: int
    side: str
    bound: float
    a: np.ndarray | None = None
    b: np.ndarray | None = None


@dataclass(frozen=True)
class Coordinate:
    """One row of the coordinate table.

    Attributes:
        name: for example ``elbow``, ``torso.qw``, ``hand.length``.
        role: dynamic, driven or fixed.
        owner: the joint or string it belongs to.
        unit: unit of the configuration number.
        index: place in q_D or q_K; None when fixed.
    """

    name: str
    role: Role
    owner: str
    unit: str
    index: int | None


@dataclass(frozen=True)
class CoordinateTable:
    """Names and places of all coordinates.

    Attributes:
        rows: every configuration number, in order.
        q_D, v_D, q_K, v_K: names of the entries of each vector.
        quaternions_D, quaternions_K: (q, v) places where a quaternion and its angular velocity
            begin.
        scalars_D, scalars_K: (q, v) places of all other coordinates.
        rotations: name of the rotation channel (``bar.rotation``) -> (q, v), driven ones only.
        start_D, start_K: configuration in the file's pose; nan for driven lengths without one.
    """

    rows: tuple[Coordinate, ...]
    q_D: tuple[str, ...]
    v_D: tuple[str, ...]
    q_K: tuple[str, ...]
    v_K: tuple[str, ...]
    quaternions_D: tuple[tuple[int, int], ...]
    quaternions_K: tuple[tuple[int, int], ...]
    scalars_D: tuple[tuple[int, int], ...]
    scalars_K: tuple[tuple[int, int], ...]
    rotations: dict[str, tuple[int, int]]
    start_D: np.ndarray
    start_K: np.ndarray

    @property
    def n_qD(self) -> int:
        """Number of dynamic configuration numbers."""
        return len(self.q_D)

    @property
    def n_vD(self) -> int:
        """Number of dynamic velocities: the puppet's degrees of freedom."""
        return len(self.v_D)

    @property
    def n_qK(self) -> int:
        """Number of driven configuration numbers."""
        return len(self.q_K)

    @property
    def n_vK(self) -> int:
        """Number of driven velocities."""
        return len(self.v_K)


@dataclass(frozen=True)
class Tree:
    """Links, strings, springs, limits and coordinates of a world, in the order of the equations.

    Attributes:
        name: of the world.
        gravity: [m/s^2].
        links: parents before children.
        strings, springs, limits: one-sided rows are strings first, then limits.
        coordinates: the coordinate table.
        parameters: names and values of the argument p.
    """

    name: str
    gravity: tuple[Number, Number, Number]
    links: tuple[Link, ...]
    strings: tuple[StringRow, ...]
    springs: tuple[SpringRow, ...]
    limits: tuple[LimitRow, ...]
    coordinates: CoordinateTable
    parameters: dict[str, float] = field(default_factory=dict)

    @property
    def n_rows(self) -> int:
        """Number of one-sided rows: strings, then limits."""
        return len(self.strings) + len(self.limits)

    @property
    def row_names(self) -> tuple[str, ...]:
        """Names of the one-sided rows: strings, then limits."""
        return tuple(r.name for r in self.strings) + tuple(r.name for r in self.limits)

    def ancestors(self, link: int) -> list[int]:
        """Indices of ``link`` and all links between it and the world, nearest first."""
        path = []
        while link != WORLD:
            path.append(link)
            link = self.links[link].parent
        return path


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
        self.parameters: dict[str, float] = {}

    def puppet(self, puppet: Puppet, prefix: str) -> None:
        place = {"world": WORLD}
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
            self.parameters[prefix + name if prefix else name] = value

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
        self.strings.append(
            StringRow(
                prefix + string.name, points, length, length_index, string.wire, string.colour
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
    return Tree(
        name=world.name,
        gravity=tuple(world.gravity),
        links=tuple(grower.links),
        strings=tuple(grower.strings),
        springs=tuple(grower.springs),
        limits=tuple(grower.limits),
        coordinates=grower.table.finish(),
        parameters=grower.parameters,
    )


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
