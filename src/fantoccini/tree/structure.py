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
from functools import cached_property

import numpy as np

from fantoccini.puppet import Number, Shape
from fantoccini.puppet.shapes import UnitInertia

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
        restitution: part of the speed that a catch gives back.
        max_tension: tension at which its winch slips [N]; None for a winch that does not.
        rewind_speed: speed at which the winch takes back what slipped [m/s]; None for never.
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


@dataclass(frozen=True)
class SpringRow:
    """A spring between two points: V = stiffness/2 (d - rest)^2, with damping along the line."""

    name: str
    points: tuple[Point, Point]
    stiffness: Number
    rest: Number
    damping: Number


@dataclass(frozen=True)
class ChainRow:
    """A string of point masses joined by springs: V = sum_k EA/(2 l) (d_k - l)^2, l = L / pieces.

    Attributes:
        name: the string's name.
        points: its ends, and between them the masses.
        stiffness: EA [N].
        damping: force per unit of strain rate [N s].
        length: L, relaxed [m], or None when it is driven.
        length_index: place of the length in q_K and v_K as (q, v); None when it is a number.
        colour: "#rrggbb" or None.
    """

    name: str
    points: tuple[Point, ...]
    stiffness: Number
    damping: Number
    length: Number | None
    length_index: tuple[int, int] | None
    colour: str | None = None

    @property
    def pieces(self) -> int:
        """Number of springs."""
        return len(self.points) - 1


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

    @cached_property
    def places_K(self) -> tuple[np.ndarray, np.ndarray]:
        """``scalars_K`` as two arrays: places in q_K and in v_K."""
        places = np.array(self.scalars_K, dtype=np.intp).reshape(-1, 2)
        return places[:, 0], places[:, 1]

    @cached_property
    def lengths_K(self) -> np.ndarray:
        """Places of the driven lengths in v_K."""
        return np.array([v for q, v in self.scalars_K if self.q_K[q].endswith(".length")], np.intp)

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
        chains: strings that are masses and springs, and no rows.
    """

    name: str
    gravity: tuple[Number, Number, Number]
    links: tuple[Link, ...]
    strings: tuple[StringRow, ...]
    springs: tuple[SpringRow, ...]
    limits: tuple[LimitRow, ...]
    coordinates: CoordinateTable
    parameters: dict[str, float] = field(default_factory=dict)
    chains: tuple[ChainRow, ...] = ()

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
