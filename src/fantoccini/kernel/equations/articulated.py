"""M_DD = F^T F by the articulated-body recursion: F^-T x and F^-1 x, linear in the number of links.

An acceleration a of a link's frame requires the wrench N a - p for the link and its whole subtree,
where N (6, 6) is its articulated inertia. From the leaves to the root every velocity k, with the
column S of its joint, is eliminated:

    U = N S,  D = S.U + armature,  N <- N - U U^T / D,  w_k = (x_k + S.p) / sqrt D,
    p <- p - U w_k / sqrt D

This gives w = F^-T x for forces x in the joints and wrenches p on the links. From the root to the
leaves,

    y_k = (w_k - U.a / sqrt D) / sqrt D,  a <- a + S y_k

gives y = F^-1 w. Wrenches and motions have six entries, the angular ones first, in the link's
frame. The linear velocities of a free joint are eliminated along the link's own axes, so that F is
not triangular.

A joint without armature transmits no wrench along its own axis, so that rows of N vanish: a ball
joint transmits a force only. Armature is a drive's inertia and, over a step, damping.
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
class Column:
    """An eliminated velocity.

    Attributes:
        S: (6,) motion of the link per unit velocity, a constant.
        U: (6,) U / sqrt D.
        d: 1 / sqrt D.
        place: index of the only nonzero entry of S, for a column without armature: this entry of
            the transmitted wrench is known in advance. None for other columns.
    """

    S: np.ndarray
    U: np.ndarray
    d: ca.SX
    place: int | None

    def solve_transposed(self, x: ca.SX, p: np.ndarray) -> ca.SX:
        """w_k from the force x in the joint; changes the wrench p (6,) to the transmitted one."""
        w = (x + dot(self.S, p)) * self.d
        p -= scaled(w, self.U)
        if self.place is not None:
            p[self.place] = -x * self.S[self.place]
        return w

    def solve(self, w: ca.SX, a: np.ndarray) -> ca.SX:
        """y_k; changes the acceleration a (6,) to the one below the joint."""
        if self.place is None:
            y = (w - dot(self.U, a)) * self.d
            a += scaled(y, self.S)
            return y
        others = [k for k in range(6) if k != self.place]
        sign, before = self.S[self.place], a[self.place]
        a[self.place] = (w - dot(self.U[others], a[others])) * self.d * sign
        return (a[self.place] - before) * sign


@dataclass(frozen=True)
class Elimination:
    """The step of the recursion that eliminates a link's joint.

    Attributes:
        parent: index of the link to which wrenches are transmitted; ``WORLD`` if no joint on the
            way to the world is dynamic.
        R, r: pose of the link in its parent.
        columns: columns of a dynamic joint, in the order of its velocities; empty otherwise.
        v: place of these velocities in v_D.
        turned: (3, 3) orientation in the link of the axes of a free joint's linear velocities;
            None for other joints.
    """

    parent: int
    R: np.ndarray
    r: np.ndarray
    columns: tuple[Column, ...]
    v: slice
    turned: np.ndarray | None

    def solve_transposed(self, x: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """w of the joint from its forces x and the wrench p (6,), and the transmitted wrench."""
        p, own, w = p.copy(), x.copy(), zeros(len(self.columns))
        if self.turned is not None:
            own[:3] = self.turned.dot(own[:3])
        for k in reversed(range(len(self.columns))):
            w[k] = self.columns[k].solve_transposed(own[k], p)
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
            w[step.v], up = step.solve_transposed(x[step.v], p[i])
            if step.parent != WORLD:
                p[step.parent] = p[step.parent] + up
        return w

    def solve_transposed_from(self, link: int, x: np.ndarray) -> dict[int, ca.SX]:
        """Place -> nonzero entry of w = F^-T x, for forces x in one joint only."""
        w: dict[int, ca.SX] = {}
        p = zeros(6)
        while link != WORLD:
            step = self.steps[link]
            own, p = step.solve_transposed(x, p)
            w |= dict(zip(range(step.v.start, step.v.stop), own, strict=True))
            link = step.parent
            x = zeros(6)
        return {k: value for k, value in sorted(w.items()) if not value.is_zero()}

    def solve(self, w: np.ndarray) -> np.ndarray:
        """(n,) y = F^-1 w, from the root to the leaves."""
        y = zeros(self.n)
        a: list[np.ndarray] = []
        for step in self.steps:
            here = zeros(6)
            if step.parent != WORLD:
                up, Rt = a[step.parent], step.R.T
                here[:3] = Rt.dot(up[:3])
                here[3:] = Rt.dot(up[3:] + cross(up[:3], step.r))
            own = [column.solve(w[step.v.start + k], here) for k, column in enumerate(step.columns)]
            if step.turned is not None:
                own[:3] = step.turned.T.dot(np.array(own[:3], dtype=object))
            y[step.v] = own
            a.append(here)
        return y

    def numbers(self, layout: Factor) -> list[ca.SX]:
        """The numbers that store the factor: those that are not constant in a layout.

        Args:
            layout: this factor, or the factor of the same tree with fewer constants.
        """
        numbers: dict[int, ca.SX] = {}
        for entry, own in zip(layout._all(), self._all(), strict=True):
            if not entry.is_constant():
                numbers.setdefault(entry.element_hash(), own)
        return list(numbers.values())

    def stored(self, packed: np.ndarray) -> Factor:
        """The factor with its numbers taken from a vector in its own layout."""
        place = {x.element_hash(): k for k, x in enumerate(self.numbers(self))}
        return self._with(lambda x: x if x.is_constant() else packed[place[x.element_hash()]])

    def _all(self) -> list[ca.SX]:
        """All numbers of the factor."""
        numbers: list[ca.SX] = []

        def collect(x: ca.SX) -> ca.SX:
            numbers.append(x)
            return x

        self._with(collect)
        return numbers

    def _with(self, change: Callable[[ca.SX], ca.SX]) -> Factor:
        """The factor with every number replaced."""

        def every(values: np.ndarray) -> np.ndarray:
            out = values.copy()
            for index in np.ndindex(values.shape):
                out[index] = change(ca.SX(values[index]))
            return out

        steps = []
        for s in self.steps:
            columns = tuple(replace(c, U=every(c.U), d=change(c.d)) for c in s.columns)
            R, r = (every(s.R), every(s.r)) if s.parent != WORLD else (s.R, s.r)
            turned = None if s.turned is None else every(s.turned)
            steps.append(replace(s, R=R, r=r, columns=columns, turned=turned))
        return Factor(steps, self.n)


def factorise(
    tree: Tree,
    joints: list[JointMotion],
    inertias: list[BodyInertia],
    armature: Callable[[Link], np.ndarray],
) -> Factor:
    """The factor of M_DD + armature.

    Args:
        tree: the tree.
        joints, inertias: joint motion and inertia of every link.
        armature: returns the terms (k,) that a link's joint adds to the diagonal.
    """
    n = len(tree.links)
    N = [_spatial(inertia) for inertia in inertias]
    below = _below_dynamic(tree)
    steps: list[Elimination] = []
    for i in reversed(range(n)):
        link, joint = tree.links[i], joints[i]
        dynamic = link.role is Role.DYNAMIC
        columns = _eliminated(N[i], link, joint, armature(link)) if dynamic else ()
        parent = link.parent if below[i] else WORLD
        if parent != WORLD:
            N[parent] = N[parent] + _in_parent(N[i], joint.R, joint.r)
        turned = joint.R_joint.T if dynamic and link.kind == "free" else None
        v = link.v if dynamic else slice(0, 0)
        steps.append(Elimination(parent, joint.R, joint.r, columns, v, turned))
    return Factor(steps[::-1], tree.coordinates.n_vD)


def _below_dynamic(tree: Tree) -> list[bool]:
    """Whether a dynamic joint lies between each link's parent and the world."""
    below: list[bool] = []
    for link in tree.links:
        up = link.parent
        below.append(up != WORLD and (tree.links[up].role is Role.DYNAMIC or below[up]))
    return below


def _eliminated(
    N: np.ndarray, link: Link, joint: JointMotion, armature: np.ndarray
) -> tuple[Column, ...]:
    """The columns of a joint; changes N to the inertia that its parent sees.

    The last velocity is eliminated first.
    """
    S = np.vstack([joint.S_w, joint.S_v])
    if link.kind == "free":
        S = np.roll(symbolic(np.eye(6)), 3, axis=0)
    columns: list[Column] = []
    for k in reversed(range(S.shape[1])):
        s = S[:, k]
        U = N.dot(s)
        root = ca.sqrt(dot(s, U) + armature[k])
        d = 1 / root
        U = scaled(d, U)
        place = _single(s) if armature[k].is_zero() else None
        for i in range(6):
            for j in range(i + 1):
                N[i, j] = N[j, i] = N[i, j] - U[i] * U[j]
        if place is not None:
            N[place, :] = N[:, place] = ca.SX(0)
            U[place] = root * s[place]
        columns.append(Column(s, U, d, place))
    return tuple(reversed(columns))


def _single(s: np.ndarray) -> int | None:
    """The index of the only nonzero entry, if it is 1 or -1; else None."""
    places = [i for i in range(6) if not s[i].is_zero()]
    return places[0] if len(places) == 1 and abs(float(s[places[0]])) == 1.0 else None


def _spatial(inertia: BodyInertia) -> np.ndarray:
    """(6, 6) spatial inertia [[I, [h]], [-[h], m 1]]."""
    N, h = zeros(6, 6), inertia.h
    skew = symbolic(rotation.skew_rows(*h))
    N[:3, :3], N[:3, 3:], N[3:, :3] = inertia.I, skew, skew.T
    for k in range(3, 6):
        N[k, k] = inertia.m
    return N


def _in_parent(N: np.ndarray, R: np.ndarray, r: np.ndarray) -> np.ndarray:
    """The articulated inertia about the parent's origin, for a link with pose (R, r) in it."""
    A, C = rotated(R, N[:3, :3]), rotated(R, N[3:, 3:])
    B = R.dot(N[:3, 3:]).dot(R.T)
    across = np.array([cross(r, B[i]) for i in range(3)], dtype=object)  # -B [r], row by row
    moved = B + np.array([cross(r, C[:, j]) for j in range(3)], dtype=object).T
    out = zeros(6, 6)
    for i in range(3):
        for j in range(i + 1):
            shift = across[j, i] + cross(r, moved[i])[j]
            out[i, j] = out[j, i] = A[i, j] + shift
    out[:3, 3:], out[3:, :3], out[3:, 3:] = moved, moved.T, C
    return out
