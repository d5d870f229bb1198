"""One-sided rows: strings and limits, their rates and their Jacobians.

String (Sec. III-B):  h = sum_k |p_k+1 - p_k| - L,  hdot = A_D v_D + A_K v_K          (Eq. 9)
                      hddot = A_D acc_D + gamma,    gamma = Adot v + A_K acc_K        (Eq. 11)

A segment's length is sqrt(d.d + eps^2): a slack string through coincident points stays finite.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np

from fantoccini.equations.algebra import (
    cross,
    dot,
    quaternion_rotation,
    scaled,
    symbolic,
    zeros,
)
from fantoccini.equations.inertia import Value
from fantoccini.equations.kinematics import JointMotion, LinkMotion
from fantoccini.tree import WORLD, LimitRow, Point, Role, StringRow, Tree

EPS = 1e-9
"""Rounding of a segment's length at coincident points [m]."""


@dataclass(frozen=True)
class PathRow:
    """A path's length and how it changes.

    Attributes:
        length: sum of the segments [m].
        rate: d length / dt.
        bias: d^2 length / dt^2 for the accelerations the motions were computed with.
        A_D, A_K: (n_vD,), (n_vK,) derivative of the rate by the velocities.
    """

    length: ca.SX
    rate: ca.SX
    bias: ca.SX
    A_D: np.ndarray
    A_K: np.ndarray


@dataclass(frozen=True)
class Surroundings:
    """What the rows of a tree are computed from."""

    tree: Tree
    joints: list[JointMotion]
    motions: list[LinkMotion]
    gravity: np.ndarray
    value: Value

    def place(self, point: Point) -> np.ndarray:
        """World position of a point (3,)."""
        at = symbolic([self.value(x) for x in point.at])
        return at if point.link == WORLD else self.motions[point.link].point(at)

    def velocity(self, point: Point) -> np.ndarray:
        """World velocity of a point (3,)."""
        if point.link == WORLD:
            return zeros(3)
        at = symbolic([self.value(x) for x in point.at])
        return self.motions[point.link].point_velocity(at)

    def acceleration(self, point: Point) -> np.ndarray:
        """World acceleration of a point (3,)."""
        if point.link == WORLD:
            return zeros(3)
        at = symbolic([self.value(x) for x in point.at])
        return self.motions[point.link].point_acceleration(at, self.gravity)

    def add_pull(
        self, point: Point, direction: np.ndarray, A: dict[Role, np.ndarray]
    ) -> None:
        """Adds direction . d(point velocity)/dv to the rows A: the pull J^T direction."""
        if point.link == WORLD:
            return
        place = self.place(point)
        for i in self.tree.ancestors(point.link):
            link = self.tree.links[i]
            if link.role is Role.FIXED:
                continue
            row, v0 = A[link.role], link.v.start
            motion, joint = self.motions[i], self.joints[i]
            linear = motion.R.T.dot(direction)
            if link.kind in ("prismatic", "translation"):
                for k in range(link.v.stop - v0):
                    row[v0 + k] = row[v0 + k] + dot(joint.S_v[:, k], linear)
                continue
            arm = cross(place - motion.r, direction)
            if link.kind == "revolute":
                row[v0] = row[v0] + dot(motion.R.dot(joint.S_w[:, 0]), arm)
                continue
            if link.kind == "free":
                moved = joint.R_joint.dot(linear)
                if link.parent == WORLD:
                    # The joint frame stands still in the world: no detour through the body.
                    moved = symbolic(link.rotation).T.dot(direction)
                row[v0 : v0 + 3] = row[v0 : v0 + 3] + moved
                v0 = v0 + 3
            row[v0 : v0 + 3] = row[v0 : v0 + 3] + motion.R.T.dot(arm)


def path_row(around: Surroundings, points: tuple[Point, ...]) -> PathRow:
    """Length, rate, bias and Jacobians of a path through points."""
    table = around.tree.coordinates
    A = {Role.DYNAMIC: zeros(table.n_vD), Role.DRIVEN: zeros(table.n_vK)}
    length, rate, bias = ca.SX(0), ca.SX(0), ca.SX(0)
    pulls = [zeros(3) for _ in points]
    for k, (first, second) in enumerate(pairwise(points)):
        if first.link == second.link:
            length = length + _rounded(around.place(second) - around.place(first))
            continue
        d = around.place(second) - around.place(first)
        dv = around.velocity(second) - around.velocity(first)
        da = around.acceleration(second) - around.acceleration(first)
        segment = _rounded(d)
        u = scaled(1 / segment, d)
        along = dot(u, dv)
        length, rate = length + segment, rate + along
        bias = bias + dot(u, da) + (dot(dv, dv) - along * along) / segment
        pulls[k] = pulls[k] - u
        pulls[k + 1] = pulls[k + 1] + u
    for point, pull in zip(points, pulls, strict=True):
        around.add_pull(point, pull, A)
    return PathRow(length, rate, bias, A[Role.DYNAMIC], A[Role.DRIVEN])


def string_row(
    around: Surroundings, string: StringRow, q_K: np.ndarray, v_K: np.ndarray, acc_K: np.ndarray
) -> PathRow:
    """h, hdot, gamma, A_D and A_K of a string: its path's row less its length."""
    row = path_row(around, string.points)
    if string.length_index is None:
        h = row.length - around.value(string.length)
        return PathRow(h, row.rate, row.bias, row.A_D, row.A_K)
    i_q, i_v = string.length_index
    A_K = row.A_K.copy()
    A_K[i_v] = A_K[i_v] - 1
    return PathRow(
        row.length - q_K[i_q], row.rate - v_K[i_v], row.bias - acc_K[i_v], row.A_D, A_K
    )


def limit_row(
    limit: LimitRow, q: np.ndarray, w: np.ndarray
) -> tuple[ca.SX, np.ndarray, ca.SX]:
    """h, Jacobian by the joint's own velocities, and bias of a limit.

    Args:
        limit: the limit.
        q: the joint's configuration numbers.
        w: the joint's velocities; the angular velocity in the body's frame for ball joints.

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
    # The twist is an angle modulo one turn; atan of the ratio gives the one nearest to zero.
    twist = 2 * ca.atan(x / scalar)
    # With n = scalar^2 + x^2 the rate is (scalar alpha + x beta) / n; the second derivatives of
    # scalar and x at wdot = 0 are both -|w|^2/4 of them, so that only n's rate is left.
    n = scalar * scalar + x * x
    J = scaled(1 / n, scaled(scalar, scaled(scalar, b) + cross(b, vector)) + scaled(x, vector))
    alpha, beta = dot(b, scaled(scalar, w) + cross(vector, w)), dot(vector, w)
    gamma = (scalar * alpha + x * beta) * (scalar * beta - x * alpha) / (n * n)
    return sign * (twist - limit.bound), scaled(sign, J), sign * gamma


def _rounded(d: np.ndarray) -> ca.SX:
    return ca.sqrt(dot(d, d) + EPS**2)
