"""Factor of the dynamic mass matrix, M_DD = F^T F, by the articulated-body recursion.

F^-T x and F^-1 x cost O(n) operations for n links. An acceleration a of a link's frame requires the
wrench N a - p for the link and its whole subtree, where N (6, 6) is its articulated inertia and p
the wrench that acts on it. From the leaves to the root every velocity k, with the column S of its
joint, is eliminated:

    U = N S,  D = S.U + armature,  N <- N - U U^T / D,  w_k = (x_k + S.p) / sqrt D,
    p <- p - U w_k / sqrt D

This gives w = F^-T x for forces x in the joints and wrenches p on the links. From the root to the
leaves,

    y_k = (w_k - U.a / sqrt D) / sqrt D,  a <- a + S y_k

gives y = F^-1 w. Wrenches and motions have six entries, the angular ones first, in the link's
frame. The linear velocities of a free joint are eliminated along the axes of the link, not of the
velocities; so F is not triangular.

Without armature, a joint transmits no inertial wrench along its own axis, and that row of N
vanishes: a ball joint transmits a force only. Armature is what a joint adds to the diagonal of
M_DD: the inertia of its drive and, for an implicit step, dt times its damping.

A wrench is a force with a torque. The leaves of the tree are the links without children, and x are
n_vD forces along the dynamic velocities v_D.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from fantoccini.base import rotation
from fantoccini.kernel.equations.algebra import cross, dot, scaled, symbolic, zeros
from fantoccini.kernel.equations.inertia import BodyInertia, rotated
from fantoccini.kernel.equations.kinematics import JointMotion
from fantoccini.model.tree import WORLD, Link, Role, Tree

Wrench = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class JointColumn:
    """Elimination of one velocity of a joint.

    Attributes:
        S: (6,) motion of the link per unit velocity, a constant.
        scaled_U: (6,) U / sqrt D.
        d: 1 / sqrt D.
        axis: index of the only nonzero entry of S, if the velocity has no armature: that entry of
            the transmitted wrench is then -x S. None for other columns.
    """

    S: np.ndarray
    scaled_U: np.ndarray
    d: ca.SX
    axis: int | None

    def solve_transposed(self, x: ca.SX, p: np.ndarray) -> ca.SX:
        """w_k from the force x in the joint; changes the wrench p (6,) to the transmitted one."""
        w = (x + dot(self.S, p)) * self.d
        p -= scaled(w, self.scaled_U)
        if self.axis is not None:
            p[self.axis] = -x * self.S[self.axis]
        return w

    def solve(self, w: ca.SX, a: np.ndarray) -> ca.SX:
        """y_k; changes the acceleration a (6,) to the one below the joint."""
        if self.axis is None:
            y = (w - dot(self.scaled_U, a)) * self.d
            a += scaled(y, self.S)
            return y
        other_axes = [k for k in range(6) if k != self.axis]
        sign, before = self.S[self.axis], a[self.axis]
        a[self.axis] = (w - dot(self.scaled_U[other_axes], a[other_axes])) * self.d * sign
        return (a[self.axis] - before) * sign


@dataclass(frozen=True)
class Elimination:
    """The step of the recursion that eliminates a link's joint.

    Attributes:
        parent: index of the parent link, to which wrenches are transmitted; ``WORLD`` if no joint
            between it and the world is dynamic.
        R, r: pose of the link in its parent.
        columns: columns of a dynamic joint, in the order of its velocities; empty otherwise.
        v: slice of these velocities in v_D.
        R_linear: (3, 3) rotation from the axes of a free joint's linear velocities to the link;
            None for other joints.
    """

    parent: int
    R: np.ndarray
    r: np.ndarray
    columns: tuple[JointColumn, ...]
    v: slice
    R_linear: np.ndarray | None

    def solve_transposed(self, x: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """w of the joint from its forces x and the wrench p (6,), and the transmitted wrench."""
        p, x, w = p.copy(), x.copy(), zeros(len(self.columns))
        if self.R_linear is not None:
            x[:3] = self.R_linear.dot(x[:3])
        for k in reversed(range(len(self.columns))):
            w[k] = self.columns[k].solve_transposed(x[k], p)
        force = self.R.dot(p[3:])
        return w, np.concatenate([self.R.dot(p[:3]) + cross(self.r, force), force])


@dataclass(frozen=True)
class Factor:
    """F of M_DD = F^T F.

    Attributes:
        steps: elimination of each link's joint, parents before children.
        n: number of dynamic velocities.
    """

    steps: list[Elimination]
    n: int

    def solve_transposed(self, x: np.ndarray, wrenches: dict[int, Wrench]) -> np.ndarray:
        """(n,) w = F^-T (x + J^T p), from the leaves to the root.

        Args:
            x: (n,) forces in the joints.
            wrenches: link -> (torque, force) on it about its origin, in its frame.
        """
        w = zeros(self.n)
        p = [zeros(6) for _ in self.steps]
        for link, wrench in wrenches.items():
            p[link] = np.concatenate(wrench)
        for i in reversed(range(len(self.steps))):
            step = self.steps[i]
            w[step.v], transmitted = step.solve_transposed(x[step.v], p[i])
            if step.parent != WORLD:
                p[step.parent] = p[step.parent] + transmitted
        return w

    def solve_transposed_from(self, link: int, x: np.ndarray) -> dict[int, ca.SX]:
        """Index in v_D -> nonzero entry of w = F^-T x, for forces x in the joint of one link."""
        w: dict[int, ca.SX] = {}
        p = zeros(6)
        while link != WORLD:
            step = self.steps[link]
            w_joint, p = step.solve_transposed(x, p)
            w |= dict(zip(range(step.v.start, step.v.stop), w_joint, strict=True))
            link = step.parent
            x = zeros(6)
        return {k: value for k, value in sorted(w.items()) if not value.is_zero()}

    def solve(self, w: np.ndarray) -> np.ndarray:
        """(n,) y = F^-1 w, from the root to the leaves."""
        y = zeros(self.n)
        a: list[np.ndarray] = []
        for step in self.steps:
            a_link = zeros(6)
            if step.parent != WORLD:
                a_parent, Rt = a[step.parent], step.R.T
                a_link[:3] = Rt.dot(a_parent[:3])
                a_link[3:] = Rt.dot(a_parent[3:] + cross(a_parent[:3], step.r))
            y_joint = [
                column.solve(w[step.v.start + k], a_link) for k, column in enumerate(step.columns)
            ]
            if step.R_linear is not None:
                y_joint[:3] = step.R_linear.T.dot(np.array(y_joint[:3], dtype=object))
            y[step.v] = y_joint
            a.append(a_link)
        return y

    def pack(self, pattern: Factor) -> list[ca.SX]:
        """Entries of the factor that vary; :meth:`unpack` of the pattern rebuilds it from them.

        Args:
            pattern: factor of the same tree, whose constant entries are constant in this one too.
        """
        packed: dict[int, ca.SX] = {}
        for entry, value in zip(pattern._entries(), self._entries(), strict=True):
            if not entry.is_constant():
                packed.setdefault(entry.element_hash(), value)
        return list(packed.values())

    def unpack(self, packed: np.ndarray) -> Factor:
        """The factor with the pattern of this one, and with its varying entries from a vector."""
        index = {x.element_hash(): k for k, x in enumerate(self.pack(self))}
        return self._map(lambda x: x if x.is_constant() else packed[index[x.element_hash()]])

    def _entries(self) -> list[ca.SX]:
        """All numbers of the factor."""
        entries: list[ca.SX] = []

        def collect(x: ca.SX) -> ca.SX:
            entries.append(x)
            return x

        self._map(collect)
        return entries

    def _map(self, change: Callable[[ca.SX], ca.SX]) -> Factor:
        """The factor with every number replaced."""

        def map_array(values: np.ndarray) -> np.ndarray:
            out = values.copy()
            for index in np.ndindex(values.shape):
                out[index] = change(ca.SX(values[index]))
            return out

        steps = []
        for s in self.steps:
            columns = tuple(
                replace(c, scaled_U=map_array(c.scaled_U), d=change(c.d)) for c in s.columns
            )
            R, r = (map_array(s.R), map_array(s.r)) if s.parent != WORLD else (s.R, s.r)
            R_linear = None if s.R_linear is None else map_array(s.R_linear)
            steps.append(replace(s, R=R, r=r, columns=columns, R_linear=R_linear))
        return Factor(steps, self.n)


def factorise(
    tree: Tree,
    joints: list[JointMotion],
    inertias: list[BodyInertia],
    armature: Callable[[Link], np.ndarray],
) -> Factor:
    """The factor of M_DD, including armature.

    Args:
        tree: the tree.
        joints, inertias: joint motion and inertia of every link.
        armature: link -> terms (k,) that its joint adds to the diagonal.
    """
    n = len(tree.links)
    N = [_spatial(inertia) for inertia in inertias]
    is_moved = _parent_is_dynamic(tree)
    steps: list[Elimination] = []
    for i in reversed(range(n)):
        link, joint = tree.links[i], joints[i]
        dynamic = link.role is Role.DYNAMIC
        columns = _eliminate(N[i], link, joint, armature(link)) if dynamic else ()
        parent = link.parent if is_moved[i] else WORLD
        if parent != WORLD:
            N[parent] = N[parent] + _in_parent(N[i], joint.R, joint.r)
        R_linear = joint.R_joint.T if dynamic and link.kind == "free" else None
        v = link.v if dynamic else slice(0, 0)
        steps.append(Elimination(parent, joint.R, joint.r, columns, v, R_linear))
    return Factor(steps[::-1], tree.coordinates.n_vD)


def _parent_is_dynamic(tree: Tree) -> list[bool]:
    """Whether a dynamic joint lies between each link's parent and the world."""
    result: list[bool] = []
    for link in tree.links:
        k = link.parent
        result.append(k != WORLD and (tree.links[k].role is Role.DYNAMIC or result[k]))
    return result


def _eliminate(
    N: np.ndarray, link: Link, joint: JointMotion, armature: np.ndarray
) -> tuple[JointColumn, ...]:
    """The columns of a joint; reduces N to the inertia that acts on the parent.

    The last velocity is eliminated first.
    """
    S = np.vstack([joint.S_w, joint.S_v])
    if link.kind == "free":
        S = np.roll(symbolic(np.eye(6)), 3, axis=0)
    columns: list[JointColumn] = []
    for k in reversed(range(S.shape[1])):
        s = S[:, k]
        U = N.dot(s)
        sqrt_D = ca.sqrt(dot(s, U) + armature[k])
        d = 1 / sqrt_D
        U = scaled(d, U)
        axis = _unit_axis(s) if armature[k].is_zero() else None
        for i in range(6):
            for j in range(i + 1):
                N[i, j] = N[j, i] = N[i, j] - U[i] * U[j]
        if axis is not None:
            N[axis, :] = N[:, axis] = ca.SX(0)
            U[axis] = sqrt_D * s[axis]
        columns.append(JointColumn(s, U, d, axis))
    return tuple(reversed(columns))


def _unit_axis(s: np.ndarray) -> int | None:
    """The index of the only nonzero entry, if it is 1 or -1; else None."""
    nonzero = [i for i in range(6) if not s[i].is_zero()]
    return nonzero[0] if len(nonzero) == 1 and abs(float(s[nonzero[0]])) == 1.0 else None


def _spatial(inertia: BodyInertia) -> np.ndarray:
    """(6, 6) spatial inertia [[I, [h]], [-[h], m 1]]."""
    N, h = zeros(6, 6), inertia.h
    skew = symbolic(rotation.skew_rows(*h))
    N[:3, :3], N[:3, 3:], N[3:, :3] = inertia.I, skew, skew.T
    for k in range(3, 6):
        N[k, k] = inertia.m
    return N


def _in_parent(N: np.ndarray, R: np.ndarray, r: np.ndarray) -> np.ndarray:
    """The articulated inertia of a link about its parent's origin, for its pose (R, r) there."""
    A, C = rotated(R, N[:3, :3]), rotated(R, N[3:, 3:])
    B = R.dot(N[:3, 3:]).dot(R.T)
    minus_B_r = np.array([cross(r, B[i]) for i in range(3)], dtype=object)  # -B [r], row by row
    B_shifted = B + np.array([cross(r, C[:, j]) for j in range(3)], dtype=object).T  # B + [r] C
    out = zeros(6, 6)
    for i in range(3):
        for j in range(i + 1):
            shift = minus_B_r[j, i] + cross(r, B_shifted[i])[j]
            out[i, j] = out[j, i] = A[i, j] + shift
    out[:3, 3:], out[3:, :3], out[3:, 3:] = B_shifted, B_shifted.T, C
    return out
