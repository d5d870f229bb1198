"""Motion of a link in an ancestor's frame: position, orientation, and their rates.

A link is a body on its joint. q_D and q_K are the dynamic and driven coordinates, v_D and v_K their
velocities.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import reduce

import numpy as np

from fantoccini.base import Quaternion, Vec3, rotation
from fantoccini.base.documents import Number
from fantoccini.model.tree import Link, Role
from fantoccini.motion import Trajectory


@dataclass(frozen=True)
class LocalMotion:
    """Pose and rate of a link over time.

    Attributes:
        r: (T, 3) position of its origin [m].
        q: (T, 4) orientation, as unit quaternion w, x, y, z.
        v: (T, 3) rate of ``r`` [m/s].
        w: (T, 3) angular velocity, in the link's frame [rad/s].
    """

    r: Vec3
    q: Quaternion
    v: Vec3
    w: Vec3

    @property
    def q_rate(self) -> Quaternion:
        """(T, 4) rate of the quaternion: qdot = q (0, w) / 2 [1/s]."""
        return 0.5 * rotation.multiply(self.q, _pure_quaternion(self.w))

    def composed_with(self, relative: LocalMotion) -> LocalMotion:
        """Motion of a link that moves by ``relative`` relative to this one."""
        rotation_matrix = rotation.matrix(self.q)
        relative_transposed = np.swapaxes(rotation.matrix(relative.q), -1, -2)
        return LocalMotion(
            self.r + rotation.apply(rotation_matrix, relative.r),
            rotation.multiply(self.q, relative.q),
            self.v + rotation.apply(rotation_matrix, relative.v + np.cross(self.w, relative.r)),
            rotation.apply(relative_transposed, self.w) + relative.w,
        )

    @classmethod
    def composed(cls, motions: Iterable[LocalMotion]) -> LocalMotion:
        """Composition of motions, from the ancestor down."""
        return reduce(cls.composed_with, motions)


def local_motion(link: Link, run: Trajectory, value_of: Callable[[Number], float]) -> LocalMotion:
    """T(offset) R(rotation) J(q) of a link at the samples of a run, and its rate (Eqs. 2 to 4)."""
    dynamic = link.role is Role.DYNAMIC
    q = (run.q_D if dynamic else run.q_K)[:, link.q]
    u = (run.v_D if dynamic else run.v_K)[:, link.v]
    n = len(run)
    zero, identity = np.zeros((n, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    joint_motion = LocalMotion(zero, identity, zero, zero)
    match link.kind:
        case "revolute":
            axis = link.axes[:, 0]
            joint_motion = LocalMotion(zero, rotation.exp(q * axis), zero, u * axis)
        case "prismatic" | "translation":
            joint_motion = LocalMotion(q @ link.axes.T, identity, u @ link.axes.T, zero)
        case "ball":
            joint_motion = LocalMotion(zero, rotation.normalised(q), zero, u)
        case "free":
            joint_motion = LocalMotion(q[:, :3], rotation.normalised(q[:, 3:]), u[:, :3], u[:, 3:])
    offset = np.tile([value_of(x) for x in link.offset], (n, 1))
    fixed_motion = LocalMotion(
        offset, np.tile(rotation.quaternion(link.rotation), (n, 1)), zero, zero
    )
    return fixed_motion.composed_with(joint_motion)


def _pure_quaternion(w: Vec3) -> Quaternion:
    return np.concatenate([np.zeros((len(w), 1)), w], axis=1)
