"""One-sided rows: strings and limits, their rates and their Jacobians.

String (Sec. III-B):  h = sum_k |p_k+1 - p_k| - L,  hdot = A_D v_D + A_K v_K          (Eq. 9)
                      hddot = A_D acc_D + gamma,    gamma = Adot v + A_K acc_K        (Eq. 11)

A segment's length is sqrt(d.d + eps^2), so that a slack string through coincident points is finite.

p_k are the points of a string and L its length; D stands for dynamic coordinates, K for driven ones
(ends and lengths of strings, driven joints). A link is a body on its joint.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np

from fantoccini.kernel.equations.algebra import (
    REGULAR,
    cross,
    dot,
    quaternion_rotation,
    scaled,
    symbolic,
    zeros,
)
from fantoccini.kernel.equations.inertia import Value
from fantoccini.kernel.equations.kinematics import JointMotion, LinkMotion
from fantoccini.model.tree import WORLD, ChainRow, LimitRow, Point, Role, StringRow, Tree


@dataclass(frozen=True)
class RowArguments:
    """Arguments of the rows of a tree: joints, motions, gravity, and ``System.value``."""

    tree: Tree
    joints: list[JointMotion]
    motions: list[LinkMotion]
    gravity: np.ndarray
    value: Value

    def local(self, point: Point) -> np.ndarray:
        """(3,) position of a point in its link's frame."""
        return symbolic([self.value(x) for x in point.at])

    def position(self, point: Point) -> np.ndarray:
        """(3,) world position of a point."""
        local_position = self.local(point)
        return (
            local_position
            if point.link == WORLD
            else self.motions[point.link].point(local_position)
        )

    def velocity(self, point: Point) -> np.ndarray:
        """(3,) world velocity of a point."""
        if point.link == WORLD:
            return zeros(3)
        return self.motions[point.link].point_velocity(self.local(point))

    def add_pull(self, point: Point, direction: np.ndarray, role: Role, row: np.ndarray) -> None:
        """Adds direction . d(point velocity)/dv to a row: the pull J^T direction.

        Args:
            point: point on which the pull acts.
            direction: (3,) direction of the pull, in the world.
            role: role of the joints whose velocities the row has.
            row: (n_vD,) or (n_vK,) row, by role.
        """
        if point.link == WORLD:
            return
        position = self.position(point)
        for i in self.tree.ancestors(point.link):
            link = self.tree.links[i]
            if link.role is not role:
                continue
            v0 = link.v.start
            motion, joint = self.motions[i], self.joints[i]
            linear = motion.R.T.dot(direction)
            if link.kind in ("prismatic", "translation"):
                for k in range(link.v.stop - v0):
                    row[v0 + k] = row[v0 + k] + dot(joint.S_v[:, k], linear)
                continue
            arm = cross(position - motion.r, direction)
            if link.kind == "revolute":
                row[v0] = row[v0] + dot(motion.R.dot(joint.S_w[:, 0]), arm)
                continue
            if link.kind == "free":
                force_in_parent = joint.R_joint.dot(linear)
                if link.parent == WORLD:
                    # The joint frame is fixed in the world: fewer products than through the body.
                    force_in_parent = symbolic(link.rotation).T.dot(direction)
                row[v0 : v0 + 3] = row[v0 : v0 + 3] + force_in_parent
                v0 = v0 + 3
            row[v0 : v0 + 3] = row[v0 : v0 + 3] + motion.R.T.dot(arm)


@dataclass(frozen=True)
class PathRow:
    """A path's length, possibly minus a string's length, and its derivatives.

    Attributes:
        arguments: arguments of the row.
        points: points of the path.
        pulls: (3,) derivative of the length by each point's position, in the world.
        length: sum of the segments, minus the string's length [m].
        rate: d length / dt.
        bias: d^2 length / dt^2 for the accelerations of the motions.
        string: string or chain whose length is subtracted, or None.
        factor: factor of that length.
    """

    arguments: RowArguments
    points: tuple[Point, ...]
    pulls: list[np.ndarray]
    length: ca.SX
    rate: ca.SX
    bias: ca.SX
    string: StringRow | ChainRow | None = None
    factor: float = 1.0

    @cached_property
    def A_D(self) -> np.ndarray:
        """(n_vD,) derivative of the rate by v_D."""
        return self._jacobian(Role.DYNAMIC, self.arguments.tree.coordinates.n_vD) + self.winding

    @cached_property
    def A_K(self) -> np.ndarray:
        """(n_vK,) derivative of the rate by v_K."""
        row = self._jacobian(Role.DRIVEN, self.arguments.tree.coordinates.n_vK)
        if self.string is not None and self.string.driven_length:
            row[self.string.driven_length[1]] -= self.factor
        return row

    @cached_property
    def wrenches(self) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """Link -> (torque, force) about its origin, in its frame, of a unit multiplier."""
        sums: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        for point, pull in zip(self.points, self.pulls, strict=True):
            if point.link == WORLD:
                continue
            force = self.arguments.motions[point.link].R.T.dot(pull)
            torque = cross(self.arguments.local(point), force)
            before = sums.get(point.link, (zeros(3), zeros(3)))
            sums[point.link] = (before[0] + torque, before[1] + force)
        return sums

    @property
    def winding(self) -> np.ndarray:
        """(n_vD,) force of a unit multiplier on the drive that winds the length."""
        row = zeros(self.arguments.tree.coordinates.n_vD)
        if self.string is not None and self.string.wound_length:
            row[self.string.wound_length[1]] -= self.factor
        return row

    def _jacobian(self, role: Role, n: int) -> np.ndarray:
        row = zeros(n)
        for point, pull in zip(self.points, self.pulls, strict=True):
            self.arguments.add_pull(point, pull, role, row)
        return row


def path_row(arguments: RowArguments, points: tuple[Point, ...]) -> PathRow:
    """Length, rate and bias of a path through points."""
    length, rate, bias = ca.SX(0), ca.SX(0), ca.SX(0)
    pulls = [zeros(3) for _ in points]
    for k, (first, second) in enumerate(pairwise(points)):
        d = arguments.position(second) - arguments.position(first)
        segment = segment_length(d)
        length = length + segment
        if first.link == second.link:
            continue
        dv = arguments.velocity(second) - arguments.velocity(first)
        u = scaled(1 / segment, d)
        speed_along = dot(u, dv)
        rate = rate + speed_along
        bias = bias + (dot(dv, dv) - speed_along * speed_along) / segment
        pulls[k] = pulls[k] - u
        pulls[k + 1] = pulls[k + 1] + u
    for point, pull in zip(points, pulls, strict=True):
        if point.link == WORLD:
            # Links' accelerations exclude gravity, and the pulls sum to zero.
            bias = bias - dot(pull, arguments.gravity)
        else:
            motion = arguments.motions[point.link]
            acceleration = motion.a + motion.U.dot(arguments.local(point))
            bias = bias + dot(motion.R.T.dot(pull), acceleration)
    return PathRow(arguments, points, pulls, length, rate, bias)


def string_row(
    arguments: RowArguments, string: StringRow, length: ca.SX, rate: ca.SX, acceleration: ca.SX
) -> PathRow:
    """h, hdot, gamma, A_D and A_K of a string: the row of its path minus its length.

    Args:
        arguments: arguments of the row.
        string: string of the row.
        length, rate, acceleration: L and its time derivatives.
    """
    row = path_row(arguments, string.points)
    return replace(
        row,
        length=row.length - length,
        rate=row.rate - rate,
        bias=row.bias - acceleration,
        string=string,
    )


def limit_row(limit: LimitRow, q: np.ndarray, w: np.ndarray) -> tuple[ca.SX, np.ndarray, ca.SX]:
    """h, Jacobian by the joint's own velocities, and bias of a limit.

    Args:
        limit: limit of the row.
        q: configuration numbers of the joint.
        w: velocities of the joint; for ball joints, the angular velocity in the body's frame.

    Returns:
        h, J (k,), gamma with hdot = J w and hddot = J wdot + gamma.
    """
    if limit.side in ("lower", "upper"):
        sign = -1.0 if limit.side == "lower" else 1.0
        return sign * (q[0] - limit.bound), symbolic([sign]), ca.SX(0)
    b = symbolic(limit.b)
    if limit.side == "cone":
        R = quaternion_rotation(q)
        a = R.T.dot(symbolic(limit.a))
        cosine = dot(a, b)
        gamma = cosine * dot(w, w) - dot(a, w) * dot(b, w)
        return np.cos(limit.bound) - cosine, cross(a, b), gamma
    sign = -1.0 if limit.side == "twist.lower" else 1.0
    scalar, vector = q[0], q[1:]
    x = dot(vector, b)
    # The twist is known modulo one turn; atan of the ratio gives the value nearest to zero.
    twist = 2 * ca.atan(x / scalar)
    # With n = scalar^2 + x^2 the rate is (scalar alpha + x beta) / n. At wdot = 0 the second
    # derivatives of scalar and x are -|w|^2/4 times themselves and cancel; n's rate remains.
    n = scalar * scalar + x * x
    J = scaled(1 / n, scaled(scalar, scaled(scalar, b) + cross(b, vector)) + scaled(x, vector))
    alpha, beta = dot(b, scaled(scalar, w) + cross(vector, w)), dot(vector, w)
    gamma = (scalar * alpha + x * beta) * (scalar * beta - x * alpha) / (n * n)
    return sign * (twist - limit.bound), scaled(sign, J), sign * gamma


def segment_length(d: np.ndarray) -> ca.SX:
    """|d| [m], regularised for coincident ends of the segment."""
    return ca.sqrt(dot(d, d) + REGULAR.segment**2)
