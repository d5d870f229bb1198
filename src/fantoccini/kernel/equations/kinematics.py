"""Poses, velocities and accelerations of the links, from the world outward.

g_i = g_parent T(offset) R(rotation) J_i(q)                                  (Eqs. 2, 3)
V_i = Ad(g_i^-1 g_parent) V_parent + S_i v_i                                  (Eq. 4)

Accelerations are those of the link's origin, in the link's frame; other points of the link have
a(r) = a + U r with U = [alpha] + [w][w]. The world's acceleration is -gravity, so that forces
computed from accelerations contain gravity.

g_i is the pose of link i, V_i its twist (linear and angular velocity), J_i the motion of its joint
and S_i the columns of this motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from fantoccini.kernel.equations.algebra import cross, scaled, symbolic, zeros
from fantoccini.kernel.equations.inertia import Value
from fantoccini.model.tree import WORLD, Link, Tree, joint_transform

IndexPairs = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class JointMotion:
    """A joint's pose in its parent link and its motion subspace, in the link's frame.

    Attributes:
        R: (3, 3) orientation of the link in its parent.
        r: (3,) origin of the link in its parent [m].
        S_w, S_v: (3, k) angular and linear motion per unit velocity.
        R_joint: (3, 3) orientation of the link in its joint frame.
    """

    R: np.ndarray
    r: np.ndarray
    S_w: np.ndarray
    S_v: np.ndarray
    R_joint: np.ndarray


@dataclass(frozen=True)
class LinkMotion:
    """Motion of a link.

    Attributes:
        R, r: orientation (3, 3) and origin (3,) in the world.
        rate: velocity of the origin, in the world's axes.
        w, alpha: angular velocity and acceleration, in the link's axes.
        a: acceleration of the origin minus gravity, in the link's axes.
        U: (3, 3) [alpha] + [w][w], in the link's axes; a point at r has the acceleration a + U r.
    """

    R: np.ndarray
    r: np.ndarray
    rate: np.ndarray
    w: np.ndarray
    alpha: np.ndarray
    a: np.ndarray
    U: np.ndarray

    @property
    def v(self) -> np.ndarray:
        """Velocity of the origin, in the link's frame (Eq. 4)."""
        return self.R.T.dot(self.rate)

    def point(self, local_position: np.ndarray) -> np.ndarray:
        """World position of a point fixed on the link."""
        return self.r + self.R.dot(local_position)

    def point_velocity(self, local_position: np.ndarray) -> np.ndarray:
        """World velocity of a point fixed on the link."""
        return self.rate + self.R.dot(cross(self.w, local_position))


def joint_motion(link: Link, q: np.ndarray, value: Value) -> JointMotion:
    """Pose and motion subspace of a joint at its configuration.

    Args:
        link: link that the joint carries.
        q: configuration numbers of the joint.
        value: turns a number or parameter into a CasADi scalar.
    """
    R0 = symbolic(link.rotation)
    r0 = symbolic([value(x) for x in link.offset])
    rotation, translation = joint_transform(link, list(q), ca.cos, ca.sin)
    R, axes = symbolic(rotation), symbolic(link.axes)
    identity, empty = symbolic(np.eye(3)), zeros(3, 0)
    S_w, S_v = zeros(*axes.shape), axes
    match link.kind:
        case "fixed":
            S_w, S_v = empty, empty
        case "revolute":
            S_w, S_v = axes, zeros(3, 1)
        case "ball":
            S_w, S_v = identity, zeros(3, 3)
        case "free":
            S_w, S_v = np.hstack([zeros(3, 3), identity]), np.hstack([R.T, zeros(3, 3)])
    return JointMotion(R0.dot(R), r0 + R0.dot(symbolic(translation)), S_w, S_v, R)


def link_motions(
    tree: Tree,
    joints: list[JointMotion],
    velocity: list[np.ndarray],
    acceleration: list[np.ndarray],
    gravity: np.ndarray,
) -> list[LinkMotion]:
    """Motions of all links for joint velocities and accelerations.

    Args:
        tree: the tree.
        joints: joint of each link at the configuration.
        velocity, acceleration: (k,) velocity and acceleration of each link's joint.
        gravity: (3,) acceleration of gravity [m/s^2].
    """
    zero = zeros(3)
    world = LinkMotion(symbolic(np.eye(3)), zero, zero, zero, zero, np.array(-gravity), zeros(3, 3))
    motions: list[LinkMotion] = []
    for i, link in enumerate(tree.links):
        joint = joints[i]
        parent_motion = world if link.parent == WORLD else motions[link.parent]
        Rt = joint.R.T
        w_joint, v_joint = joint.S_w.dot(velocity[i]), joint.S_v.dot(velocity[i])
        w_carried = Rt.dot(parent_motion.w)
        w = w_carried + w_joint
        # A free joint's linear velocity is in its joint frame already.
        slide = (
            symbolic(link.rotation).dot(velocity[i][:3])
            if link.kind == "free"
            else joint.R.dot(v_joint)
        )
        rate = parent_motion.rate + parent_motion.R.dot(cross(parent_motion.w, joint.r) + slide)
        alpha = (
            Rt.dot(parent_motion.alpha) + joint.S_w.dot(acceleration[i]) + cross(w_carried, w_joint)
        )
        a = (
            Rt.dot(parent_motion.a + parent_motion.U.dot(joint.r))
            + joint.S_v.dot(acceleration[i])
            + cross(scaled(2, w_carried), v_joint)
        )
        motions.append(
            LinkMotion(
                parent_motion.R.dot(joint.R),
                parent_motion.r + parent_motion.R.dot(joint.r),
                rate,
                w,
                alpha,
                a,
                turning(w, alpha),
            )
        )
    return motions


def turning(w: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """U = [alpha] + [w][w] (3, 3)."""
    xx, yy, zz = (x * x for x in w)
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    x, y, z = alpha
    return np.array(
        [[-(yy + zz), xy - z, xz + y], [xy + z, -(xx + zz), yz - x], [xz - y, yz + x, -(xx + yy)]],
        dtype=object,
    )


def configuration_rate(q: ca.SX, v: ca.SX, quaternions: IndexPairs, scalars: IndexPairs) -> ca.SX:
    """qdot = N(q) v: v for scalars, 1/2 q (0, w) for quaternions.

    Args:
        q: (n_q,) configuration.
        v: (n_v,) velocity.
        quaternions, scalars: (q, v) places as in the coordinate table.
    """
    rate = ca.SX.zeros(q.numel(), 1)
    for i, j in scalars:
        rate[i] = v[j]
    for i, j in quaternions:
        w, x, y, z = (q[i + k] for k in range(4))
        a, b, c = (v[j + k] for k in range(3))
        rate[i] = -0.5 * (x * a + y * b + z * c)
        rate[i + 1] = 0.5 * (w * a + y * c - z * b)
        rate[i + 2] = 0.5 * (w * b + z * a - x * c)
        rate[i + 3] = 0.5 * (w * c + x * b - y * a)
    return rate
