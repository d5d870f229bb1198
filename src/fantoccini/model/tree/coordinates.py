"""The table of coordinates: their names, roles and places.

The role of a coordinate:

* ``dynamic``  moves by the equations of motion (q_D, v_D),
* ``driven``   is a kinematic input (q_K, v_K),
* ``fixed``    is a constant.

Configuration and velocity differ in size where a joint rotates freely: a ball joint has four
configuration numbers (a unit quaternion w, x, y, z) and three velocities (the angular velocity in
the body's frame).

A driven coordinate is an end or length of a string, or a driven joint. Where a drive, a motor with
a controller, moves it, it is dynamic and its command is driven.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

COMMAND = ".command"
"""Part of a command's name, after the owner's name: ``hand.command.length``."""


class Role(enum.StrEnum):
    """Role of a coordinate: moved by the equations of motion, by an input, or not at all."""

    DYNAMIC = "dynamic"
    DRIVEN = "driven"
    FIXED = "fixed"


@dataclass(frozen=True)
class Coordinate:
    """One row of the coordinate table.

    Attributes:
        name: for example ``elbow``, ``torso.qw``, ``hand.length``.
        role: dynamic, driven or fixed.
        owner: name of its joint or string.
        unit: unit of the configuration number.
        index: place in q_D or q_K; None when fixed.
    """

    name: str
    role: Role
    owner: str
    unit: str
    index: int | None


@dataclass(frozen=True, repr=False)
class CoordinateTable:
    """Names and places of all coordinates.

    Attributes:
        rows: every configuration number, in order.
        q_D, v_D, q_K, v_K: names of the entries of each vector.
        quaternions_D, quaternions_K: (q, v) places where a quaternion and its angular velocity
            begin.
        scalars_D, scalars_K: (q, v) places of all other coordinates.
        rotations: name of the rotation channel (``bar.rotation``) -> (q, v), driven ones only.
        start_D, start_K: configuration in the file's pose; nan for driven lengths not in it.
        commands: coordinate with a drive -> name of its command.
        axes: driven coordinate of a revolute or prismatic joint -> its axis, in the frame of the
            body that carries the joint.
        carried: joints and strings that a moving body carries: driven, free and translating ones,
            and the commands of their drives.
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
    commands: dict[str, str] = field(default_factory=dict)
    axes: dict[str, tuple[float, ...]] = field(default_factory=dict)
    carried: tuple[str, ...] = ()

    def __repr__(self) -> str:
        names = [*self.q_D, *self.q_K]
        shown = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
        return f"<CoordinateTable: {self.n_qD} dynamic, {self.n_qK} driven: {shown}>"

    @cached_property
    def scalar_indices_K(self) -> tuple[np.ndarray, np.ndarray]:
        """``scalars_K`` as two arrays: places in q_K and in v_K."""
        index_pairs = np.array(self.scalars_K, dtype=np.intp).reshape(-1, 2)
        return index_pairs[:, 0], index_pairs[:, 1]

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
