"""Links of joints, and the indices of their coordinates in q_D, v_D, q_K, v_K.

A driven joint with a drive has dynamic coordinates, and driven commands. If only some coordinates
of a joint have drives, the joint is split: the part without drives carries the part with drives.

q_D and v_D are the dynamic coordinates and velocities, q_K and v_K the driven ones, given as
functions of time. A drive is a motor that follows a command. A link is a body on its joint. A row
of the tree describes a string, limit, spring or drive, a row of the coordinate table one
coordinate.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from fantoccini.base.documents import Number, value_of
from fantoccini.model.puppet import Drive, Joint
from fantoccini.model.tree.coordinates import COMMAND, Coordinate, CoordinateTable, Role
from fantoccini.model.tree.structure import WORLD, DriveRow, Link

AXES = ("x", "y", "z")

_QUATERNION = (".qw", ".qx", ".qy", ".qz")
_ANGULAR_VELOCITY = (".wx", ".wy", ".wz")
TURNS_WITH_LINK: dict[str, tuple[int, ...]] = {"ball": (0, 1, 2), "free": (3, 4, 5)}
"""Kind of joint -> indices of its velocities whose axes turn with the link that it carries."""
_UNITS = {"revolute": "rad", ".x": "m", ".y": "m", ".z": "m", "prismatic": "m", ".length": "m"}


def suffixes(kind: str, axes: tuple[str, ...] = ()) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Suffixes of the names of a joint's coordinates in q and in v."""
    if kind == "translation":
        names = tuple(f".{a}" for a in axes)
        return names, names
    if kind == "length":
        return (".length",), (".length",)
    scalars = {"revolute": ("",), "prismatic": ("",), "free": suffixes("translation", AXES)[0]}
    scalar_names, can_rotate = scalars.get(kind, ()), kind in ("ball", "free")
    return scalar_names + _QUATERNION * can_rotate, scalar_names + _ANGULAR_VELOCITY * can_rotate


class Table:
    """Assigns indices in q_D, v_D, q_K, v_K while the tree is built."""

    def __init__(self) -> None:
        self.rows: list[Coordinate] = []
        self.names: dict[tuple[Role, str], list[str]] = {
            (role, letter): [] for role in (Role.DYNAMIC, Role.DRIVEN) for letter in "qv"
        }
        self.start: dict[Role, list[float]] = {Role.DYNAMIC: [], Role.DRIVEN: []}
        self.quaternions: dict[Role, list[tuple[int, int]]] = {Role.DYNAMIC: [], Role.DRIVEN: []}
        self.scalars: dict[Role, list[tuple[int, int]]] = {Role.DYNAMIC: [], Role.DRIVEN: []}
        self.rotations: dict[str, tuple[int, int]] = {}
        self.commands: dict[str, str] = {}
        self.axes: dict[str, tuple[float, ...]] = {}
        self.carried: dict[str, None] = {}

    def add(
        self,
        owner: str,
        kind: str,
        role: Role,
        q: tuple[str, ...],
        v: tuple[str, ...],
        start: list[float],
    ) -> tuple[slice, slice]:
        """Adds coordinates of one role, and returns their indices in q and v.

        Args:
            owner: prefix of the names: name of the joint or string.
            kind: kind of the joint, or ``length``.
            role: role of the coordinates.
            q, v: suffixes of the names in q and in v.
            start: values of q in the file's pose.
        """
        if role is Role.FIXED or not q:
            return slice(0, 0), slice(0, 0)
        q_names, v_names = self.names[role, "q"], self.names[role, "v"]
        q0, v0 = len(q_names), len(v_names)
        for k, suffix in enumerate(q):
            unit = _UNITS.get(suffix) or _UNITS.get(kind) or "1"
            self.rows.append(Coordinate(owner + suffix, role, owner, unit, q0 + k))
        q_names.extend(owner + s for s in q)
        v_names.extend(owner + s for s in v)
        self.start[role].extend(start)
        n_scalar = q.index(".qw") if ".qw" in q else len(q)
        self.scalars[role].extend((q0 + k, v0 + k) for k in range(n_scalar))
        if n_scalar < len(q):
            pair = (q0 + n_scalar, v0 + n_scalar)
            self.quaternions[role].append(pair)
            if role is Role.DRIVEN:
                self.rotations[owner + ".rotation"] = pair
        return slice(q0, q0 + len(q)), slice(v0, v0 + len(v))

    def finish(self) -> CoordinateTable:
        """The coordinate table."""
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
            commands=dict(self.commands),
            axes=dict(self.axes),
            carried=tuple(self.carried),
            start_D=np.array(self.start[dynamic], dtype=float),
            start_K=np.array(self.start[driven], dtype=float),
        )


@dataclass
class Joints:
    """The links and drives of all joints.

    Attributes:
        table: table that assigns indices.
        links: links, parents before children.
        drives: rows of the drives.
        motors: coordinate -> drive that moves it.
    """

    table: Table = field(default_factory=Table)
    links: list[Link] = field(default_factory=list)
    drives: list[DriveRow] = field(default_factory=list)
    motors: dict[str, Drive] = field(default_factory=dict)

    def body(self, last_link: Link, joint: Joint, start: dict[str, float]) -> int:
        """Adds the links of a body's joint.

        Args:
            last_link: link of the body, without the fields that depend on the joint; it is the
                last of the joint's links.
            joint: joint of the file.
            start: suffix -> value of q in the file's pose.

        Returns:
            Index of the body's link.
        """
        rotation = np.eye(3) if joint.orientation is None else joint.orientation.matrix
        offset, parent = joint.at, last_link.parent
        parts = list(self._split_joint(last_link.joint, joint.type, joint.axes or (), joint.driven))
        for n, (kind, axes, role) in enumerate(parts, 1):
            link = (
                last_link
                if n == len(parts)
                else carriage(f"{last_link.name}.carriage{n}", last_link.joint)
            )
            link = replace(
                link,
                parent=parent,
                kind=kind,
                role=role,
                rotation=rotation,
                offset=offset,
                axes=unit_columns(axes, joint.axis),
            )
            parent = self.add(link, kind, axes, start)
            rotation, offset = np.eye(3), (0.0, 0.0, 0.0)
        return parent

    def end(
        self,
        string: str,
        parent: int,
        axes: tuple[str, ...],
        position: tuple[Number, Number, Number],
    ) -> int:
        """Adds a massless body on driven axes at a string's end; returns its index."""
        start = {f".{a}": value_of(x) for a, x in zip(AXES, position, strict=True)}
        x, y, z = (0.0 if a in axes else x for a, x in zip(AXES, position, strict=True))
        parts = list(self._split_joint(string, "translation", axes, True))
        for n, (kind, part_axes, role) in enumerate(parts, 1):
            name = f"{string}.end" if n == len(parts) else f"{string}.carriage{n}"
            link = replace(
                carriage(name, string),
                parent=parent,
                kind=kind,
                role=role,
                offset=(x, y, z),
                axes=unit_columns(part_axes, None),
            )
            parent = self.add(link, kind, part_axes, start)
            x = y = z = 0.0
        return parent

    def length(self, string: str, start: float) -> tuple[Role, tuple[int, int]]:
        """Adds a string's driven length; returns its role and its indices in q and v.

        A length with a drive is the coordinate of an extra link, the winch.
        """
        role = self._role(string, (".length",))
        if role is Role.DRIVEN:
            names = suffixes("length")
            q, v = self.table.add(string, "length", role, *names, [start])
        else:
            link = carriage(f"{string}.winch", string)
            link = replace(link, kind="prismatic", role=role, axes=np.eye(3)[:, :1])
            index = self.add(link, "length", (), {".length": start})
            q, v = self.links[index].q, self.links[index].v
        return role, (q.start, v.start)

    def add(self, link: Link, kind: str, axes: tuple[str, ...], start: dict[str, float]) -> int:
        """Adds a link with the indices of its coordinates, and the rows of their drives.

        Args:
            link: link without q and v.
            kind: kind of the joint, or ``length``.
            axes: axes of a translation.
            start: suffix -> value of q in the file's pose; 0 by default.
        """
        names = suffixes(kind, axes)
        values = {s: start.get(s, 1.0 if s == ".qw" else 0.0) for s in names[0]}
        q, v = self.table.add(link.joint, kind, link.role, *names, list(values.values()))
        self.links.append(replace(link, q=q, v=v))
        index, next_q, next_v = len(self.links) - 1, q.start, v.start
        axis = tuple((link.rotation @ link.axes).T.ravel().tolist())
        if kind in ("revolute", "prismatic") and link.role is Role.DRIVEN:
            self.table.axes[link.joint] = axis
        has_position = link.role is Role.DRIVEN or kind in ("free", "translation")
        is_carried = has_position and self._is_moved_by_others(link.parent, link.joint)
        if is_carried:
            self.table.carried[link.joint] = None
        for name, drive_q, drive_v in _drivable_coordinates(names):
            n_q, n_v = len(drive_q), len(drive_v)
            slices = slice(next_q, next_q + n_q), slice(next_v, next_v + n_v)
            next_q, next_v = next_q + n_q, next_v + n_v
            drive = self.motors.get(link.joint + name) if link.role is Role.DYNAMIC else None
            if drive is None:
                continue
            command, command_name = None, ""
            if drive.follows:
                owner = link.joint + COMMAND
                drive_start = [values[s] for s in drive_q]
                q_K, v_K = self.table.add(owner, kind, Role.DRIVEN, drive_q, drive_v, drive_start)
                command, command_name = (q_K.start, v_K.start), owner + name
                self.table.commands[link.joint + name] = command_name
                if is_carried:
                    self.table.carried[owner] = None
                if kind in ("revolute", "prismatic"):
                    self.table.axes[command_name] = axis
            row = DriveRow(link.joint + name, index, *slices, command_name, command, drive)
            self.drives.append(row)
        return index

    def _is_moved_by_others(self, i: int, joint: str) -> bool:
        """Whether joints other than a given one move a link."""
        while i != WORLD:
            if self.links[i].role is not Role.FIXED and self.links[i].joint != joint:
                return True
            i = self.links[i].parent
        return False

    def _split_joint(
        self, name: str, kind: str, axes: tuple[str, ...], driven: bool
    ) -> Iterator[tuple[str, tuple[str, ...], Role]]:
        """Kind, axes and role of the joints into which a joint is split."""
        if not driven:
            yield kind, axes, Role.FIXED if kind == "fixed" else Role.DYNAMIC
            return
        with_drive = [
            s for s, _, _ in _drivable_coordinates(suffixes(kind, axes)) if name + s in self.motors
        ]
        if kind == "free" and with_drive:
            yield from self._split_joint(name, "translation", AXES, True)
            yield from self._split_joint(name, "ball", (), True)
            return
        if kind != "translation":
            yield kind, axes, Role.DYNAMIC if with_drive else Role.DRIVEN
            return
        hand_axes = tuple(a for a in axes if f".{a}" not in with_drive)
        motor_axes = tuple(a for a in axes if f".{a}" in with_drive)
        if hand_axes:
            yield kind, hand_axes, Role.DRIVEN
        if motor_axes:
            yield kind, motor_axes, Role.DYNAMIC

    def _role(self, name: str, name_suffixes: tuple[str, ...]) -> Role:
        return Role.DYNAMIC if any(name + s in self.motors for s in name_suffixes) else Role.DRIVEN


def carriage(name: str, joint: str) -> Link:
    """A massless link on a driven joint, on the world."""
    empty = slice(0, 0)
    return Link(
        name=name,
        parent=WORLD,
        joint=joint,
        kind="translation",
        axes=np.eye(3)[:, :0],
        rotation=np.eye(3),
        offset=(0.0, 0.0, 0.0),
        role=Role.DRIVEN,
        q=empty,
        v=empty,
    )


def unit_columns(axes: tuple[str, ...], axis: tuple[float, float, float] | None) -> np.ndarray:
    """(3, k) unit columns: the axes of a translation, or a joint's one axis."""
    if axis is not None:
        return np.array(axis)[:, None]
    return np.eye(3)[:, [AXES.index(a) for a in axes]]


def _drivable_coordinates(
    names: tuple[tuple[str, ...], tuple[str, ...]],
) -> Iterator[tuple[str, tuple[str, ...], tuple[str, ...]]]:
    """Suffix of each coordinate that a drive can move, and suffixes of its entries in q and v."""
    q, v = names
    scalars = [s for s in q if s not in _QUATERNION]
    yield from ((s, (s,), (s,)) for s in scalars)
    if len(scalars) < len(q):
        yield ".rotation", q[len(scalars) :], v[len(scalars) :]
