"""The tree: links in topological order, and the rows of strings, springs, limits and drives.

The equations of motion are derived from a :class:`Tree`. Every link has one joint to its parent.
Every joint coordinate and every string length is one row of its
:class:`~fantoccini.model.tree.coordinates.CoordinateTable`.

Coordinates are dynamic (q_D, moved by the equations of motion) or driven (q_K, given as functions
of time), v_D and v_K are their velocities. A drive is a motor that moves a coordinate towards its
command. A winch changes the length of a string.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from fantoccini.base.documents import Number
from fantoccini.model.puppet import Drive, Shape, StepperMotor, UnitInertia
from fantoccini.model.tree.coordinates import CoordinateTable, Role

WORLD = -1
"""Index of the world, as the parent of a link or the carrier of a point."""


@dataclass(frozen=True)
class MassShare:
    """Contribution of one shape to a link's inertia.

    Attributes:
        amount: mass [kg], or density [kg/m^3].
        volume: factor on the amount: 1 for a mass, the volume [m^3] for a density.
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
        name: name of the body.
        parent: index of the parent link, ``WORLD`` for the world.
        joint: name of the joint.
        kind: fixed, revolute, prismatic, translation, ball or free.
        axes: (3, k) unit columns, in the joint frame: the axis of a revolute or prismatic joint,
            the axes of a translation.
        rotation: (3, 3) orientation of the joint frame in the parent.
        offset: origin of the joint frame in the parent [m].
        role: role of the joint's coordinates.
        q, v: indices of the joint's coordinates in (q_D, v_D) or (q_K, v_K), by role.
        damping: damping of every velocity of the joint [N s/m or N m s/rad].
        armature: rotor inertia of every velocity of the joint [kg or kg m^2].
        stiffness: stiffness of the joint's spring [N/m or N m/rad].
        rest: rest position of that spring [m or rad].
        mass_shares: contributions of the shapes to the inertia.
        mass, com, inertia: explicit values that override those of the shapes, or None;
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
    armature: Number = 0.0
    stiffness: Number = 0.0
    rest: Number = 0.0
    mass_shares: tuple[MassShare, ...] = ()
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
        at: position in the link's frame [m].
    """

    link: int
    at: tuple[Number, Number, Number]


class WithLength:
    """Base of strings and chains: their length L is a number, or a coordinate of the puppet."""

    name: str
    points: tuple[Point, ...]
    length: Number | None
    length_index: tuple[int, int] | None
    length_role: Role

    @property
    def driven_length(self) -> tuple[int, int] | None:
        """Indices of the length in (q_K, v_K); None if it is not driven."""
        return self.length_index if self.length_role is Role.DRIVEN else None

    @property
    def wound_length(self) -> tuple[int, int] | None:
        """Indices of the length in (q_D, v_D), as a drive's winch moves it; None otherwise."""
        return self.length_index if self.length_role is Role.DYNAMIC else None

    def set_unknown_length(self, span: float, q_D: np.ndarray, q_K: np.ndarray) -> None:
        """Sets the length to that of the path, if it is a coordinate whose value is NaN.

        Args:
            span: length of the path [m].
            q_D, q_K: (n_qD,) dynamic, (n_qK,) kinematic (driven) configuration, changed in place.
        """
        for indices, q in ((self.driven_length, q_K), (self.wound_length, q_D)):
            if indices is not None and np.isnan(q[indices[0]]):
                q[indices[0]] = span

    def unstretched_length(
        self, q_D: np.ndarray, q_K: np.ndarray, number: Callable[[Number], float]
    ) -> np.ndarray:
        """Length L [m], of shape (...) or (), at configurations (..., n_qD), (..., n_qK)."""
        if self.length_index is not None:
            return (q_K if self.driven_length else q_D)[..., self.length_index[0]]
        assert self.length is not None, "a length is a coordinate or a number"
        return np.array(number(self.length), dtype=float)


@dataclass(frozen=True)
class StringRow(WithLength):
    """A string: h = (path length) - L <= 0.

    Attributes:
        name: name of the string.
        points: two or more points that the string runs through.
        length: L [m]; None if it is driven.
        length_index: indices of the length in (q_K, v_K), or in (q_D, v_D) if a drive moves it;
            None if it is a number.
        wire: True for a two-sided constraint (Sec. III-B).
        colour: "#rrggbb" or None.
        restitution: coefficient of restitution when the string comes taut.
        max_tension: tension at which its winch slips [N]; None for no slip.
        rewind_speed: speed at which the winch rewinds the slip [m/s]; None for no rewinding.
        length_role: whether the length is a driven or a dynamic coordinate, if it is one.
    """

    name: str
    points: tuple[Point, ...]
    length: Number | None
    length_index: tuple[int, int] | None
    wire: bool
    colour: str | None
    restitution: Number = 0.0
    max_tension: Number | None = None
    rewind_speed: Number | None = None
    length_role: Role = Role.DRIVEN


@dataclass(frozen=True)
class SpringRow:
    """A spring between two points at distance d: V = stiffness/2 (d - rest)^2; damping along d."""

    name: str
    points: tuple[Point, Point]
    stiffness: Number
    rest: Number
    damping: Number


@dataclass(frozen=True)
class DriveRow:
    """A coordinate that a drive moves: one number, or the orientation of a ball joint.

    Attributes:
        name: name of the coordinate: ``hand.length``, ``bar.rotation``.
        link: index of the link whose joint has the coordinate.
        q, v: indices of the coordinate in q_D and v_D.
        command_name: name of the command, ``hand.command.length``; empty without a command.
        command: indices of the command in (q_K, v_K); None without a command.
        drive: drive of the puppet's file.
    """

    name: str
    link: int
    q: slice
    v: slice
    command_name: str
    command: tuple[int, int] | None
    drive: Drive

    @property
    def has_stepper(self) -> bool:
        """Whether a stepper motor moves the coordinate."""
        return isinstance(self.drive.motor, StepperMotor)

    @property
    def is_rotation(self) -> bool:
        """Whether the coordinate is an orientation."""
        return self.v.stop - self.v.start == 3

    def ratio(self, number: Callable[[Number], Any]) -> Any:
        """n: angle of the rotor [rad] per unit of the coordinate.

        Args:
            number: function from a number of the file, or its parameter, to the value or symbol.
        """
        drum = self.drive.drum
        return number(self.drive.gear) / (1.0 if drum is None else number(drum))

    def inertia(self, number: Callable[[Number], Any]) -> Any:
        """m + n^2 J: inertia of the drive at the coordinate [kg or kg m^2]."""
        mass, rotor = self.drive.mass, self.drive.inertia
        direct = 0.0 if mass is None else number(mass)
        return direct + (0.0 if rotor is None else number(rotor) * self.ratio(number) ** 2)


@dataclass(frozen=True)
class ChainRow(WithLength):
    """A string of point masses joined by springs: V = sum_k EA/(2 l) (d_k - l)^2, l = L / pieces.

    Attributes:
        name: name of the string.
        points: first end, masses, last end.
        stiffness: EA [N].
        damping: force per unit of strain rate [N s].
        length: relaxed length L [m]; None if it is driven.
        length_index: indices of the length, as in :class:`StringRow`.
        colour: "#rrggbb" or None.
        length_role: whether the length is a driven or a dynamic coordinate, if it is one.
    """

    name: str
    points: tuple[Point, ...]
    stiffness: Number
    damping: Number
    length: Number | None
    length_index: tuple[int, int] | None
    colour: str | None = None
    length_role: Role = Role.DRIVEN

    @property
    def pieces(self) -> int:
        """Number of springs."""
        return len(self.points) - 1


@dataclass(frozen=True)
class LimitRow:
    """A one-sided limit of a joint, h <= 0.

    ``lower``: bound - q; ``upper``: q - bound; ``cone``: cos(bound) - a . R b;
    ``twist.lower``, ``twist.upper``: lower and upper for the twist of R about b.

    Attributes:
        name: name of the joint and side: ``elbow.upper``.
        link: index of the link whose joint is limited.
        side: lower, upper, cone, twist.lower or twist.upper.
        bound: limit of the coordinate or angle [rad or m].
        a, b: unit axes (3,) in the joint frame and in the body frame (ball joints only).
    """

    name: str
    link: int
    side: str
    bound: float
    a: np.ndarray | None = None
    b: np.ndarray | None = None


@dataclass(frozen=True)
class Tree:
    """Links, strings, springs, limits and coordinates of a puppet, in the order of the equations.

    Attributes:
        name: name of the puppet.
        gravity: acceleration of gravity [m/s^2].
        links: links, parents before children.
        strings, springs, limits: rows; the one-sided rows are the strings, then the limits.
        drives: coordinates that drives move.
        coordinates: the coordinate table.
        parameters: names and values of the argument p.
        chains: strings modelled as masses and springs; they have no rows.
        n_contacts: maximum number of contact points in a step; 0 without contact.
        n_pieces: number of solids of dented meshes, which consist of several, beyond one for each.
    """

    name: str
    gravity: tuple[Number, Number, Number]
    links: tuple[Link, ...]
    strings: tuple[StringRow, ...]
    springs: tuple[SpringRow, ...]
    limits: tuple[LimitRow, ...]
    coordinates: CoordinateTable
    parameters: dict[str, float] = field(default_factory=dict)
    drives: tuple[DriveRow, ...] = ()
    chains: tuple[ChainRow, ...] = ()
    n_contacts: int = 0
    n_pieces: int = 0

    @property
    def n_rows(self) -> int:
        """Number of one-sided rows: strings, then limits."""
        return len(self.strings) + len(self.limits)

    @cached_property
    def sizes(self) -> dict[str, int]:
        """Names of sizes in :mod:`fantoccini.kernel.contract` -> their values."""
        t = self.coordinates
        return {
            "n_qD": t.n_qD,
            "n_vD": t.n_vD,
            "n_qK": t.n_qK,
            "n_vK": t.n_vK,
            "n_v": t.n_vD + t.n_vK,
            "n_strings": len(self.strings),
            "n_limits": len(self.limits),
            "n_rows": self.n_rows,
            "n_p": len(self.parameters),
            "n_links": len(self.links),
            "n_points": sum(len(s.points) for s in self.strings),
            "n_motors": len(self.driven_v_D),
            "n_watched": len(self.watched),
            "n_contacts": self.n_contacts,
            "n_solids": self.n_pieces + sum(len(i.shapes) for i in self.links)
            if self.n_contacts
            else 0,
        }

    @cached_property
    def row_names(self) -> tuple[str, ...]:
        """Names of the one-sided rows: strings, then limits."""
        return tuple(r.name for r in self.strings) + tuple(r.name for r in self.limits)

    @cached_property
    def limit_entries(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Entries of the limits in A_D: index of the limit, axis of its joint, and index in v_D."""
        slices = [self.links[limit.link].v for limit in self.limits]
        rows = [(i, k - v.start, k) for i, v in enumerate(slices) for k in range(v.start, v.stop)]
        limit, axis, velocity = np.array(rows, dtype=np.intp).reshape(-1, 3).T
        return limit, axis, velocity

    @property
    def driven_v_D(self) -> list[int]:
        """Indices in v_D of the coordinates with drives, in the order of the drives."""
        return [k for row in self.drives for k in range(row.v.start, row.v.stop)]

    @property
    def watched(self) -> tuple[DriveRow, ...]:
        """Drives whose motor or controller may be too weak to follow the command."""
        return tuple(d for d in self.drives if d.command)

    @cached_property
    def attributable(self) -> tuple[str, ...]:
        """Names to which a run's status may be attributed: rows, then watched drives."""
        return (*self.row_names, *(row.name for row in self.watched))

    def commanding(self, link: int) -> tuple[slice, slice] | None:
        """Indices in (q_K, v_K) of a driven joint's coordinates, or of its drives' commands.

        None for a winch, and for a joint with a coordinate that is neither driven nor commanded.
        """
        joint = self.links[link]
        if joint.role is Role.DRIVEN:
            return joint.q, joint.v
        rows = [(row, row.command) for row in self.drives if row.link == link and row.command]
        if sum(row.v.stop - row.v.start for row, _ in rows) != joint.v.stop - joint.v.start:
            return None
        if not rows or rows[0][0].name.endswith(".length"):
            return None
        (first_row, (q, v)), (last_row, _) = rows[0], rows[-1]
        return slice(q, q + last_row.q.stop - first_row.q.start), slice(
            v, v + last_row.v.stop - first_row.v.start
        )

    def commanding_length(self, string: WithLength) -> tuple[int, int] | None:
        """Indices in (q_K, v_K) of a string's length if it is driven, or of its drive's command."""
        if string.wound_length is None:
            return string.driven_length
        rows = [row for row in self.drives if row.name == f"{string.name}.length"]
        return rows[0].command

    def string_lengths(
        self, q_D: np.ndarray, q_K: np.ndarray, number: Callable[[Number], float]
    ) -> np.ndarray:
        """(..., n_strings) lengths of the strings [m].

        Args:
            q_D, q_K: (..., n_qD), (..., n_qK) configurations.
            number: function from a number of the file, or its parameter, to the value.
        """
        q_D, q_K = np.asarray(q_D, dtype=float), np.asarray(q_K, dtype=float)
        lengths = np.zeros((*q_K.shape[:-1], len(self.strings)))
        for i, string in enumerate(self.strings):
            lengths[..., i] = string.unstretched_length(q_D, q_K, number)
        return lengths

    def ancestors(self, link: int) -> list[int]:
        """Indices of ``link`` and of all links between it and the world, nearest first."""
        ancestors = []
        while link != WORLD:
            ancestors.append(link)
            link = self.links[link].parent
        return ancestors
