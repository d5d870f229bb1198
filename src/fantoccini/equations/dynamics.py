"""M, c and the tree-sparse factor of M.

M_DD acc_D + M_DK acc_K + c(q, v) = u_D + A_D^T lambda                        (Eq. 10)

The composite-rigid-body recursion gives M, the recursive Newton-Euler recursion gives the bias.
They are Lagrange's equations (Eqs. 5-8) without redundant work. M_DD = L^T L, with L lower
triangular, has no fill-in: L_kj differs from zero only where j lies between k and the root.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from fantoccini.equations.algebra import cross, dot, scaled, symbolic, zeros
from fantoccini.equations.inertia import BodyInertia
from fantoccini.equations.kinematics import JointMotion, LinkMotion
from fantoccini.tree import WORLD, Role, Tree


@dataclass(frozen=True)
class Column:
    """One velocity of the system: the link whose joint it belongs to and its place there."""

    link: int
    k: int


def velocity_columns(tree: Tree, role: Role) -> list[Column]:
    """The joint columns behind v_D or v_K, in order; string lengths of v_K have link WORLD."""
    n = tree.coordinates.n_vD if role is Role.DYNAMIC else tree.coordinates.n_vK
    columns = [Column(WORLD, 0)] * n
    for i, link in enumerate(tree.links):
        if link.role is role:
            for k in range(link.v.stop - link.v.start):
                columns[link.v.start + k] = Column(i, k)
    return columns


def mass_matrix(
    tree: Tree, joints: list[JointMotion], inertias: list[BodyInertia]
) -> dict[tuple[int, int], np.ndarray]:
    """Blocks of M between the joints of links i and j, j an ancestor of i or i itself.

    H_ij = S_j^T (X_ij^T I_i^c S_i), with I_i^c the inertia of the whole subtree below i.

    Returns:
        (i, j) -> (k_j, k_i) block, for links that have moving joints.
    """
    composite = list(inertias)
    for i in reversed(range(len(tree.links))):
        parent = tree.links[i].parent
        if parent != WORLD and not composite[i].is_zero():
            composite[parent] = composite[parent] + composite[i].in_parent(
                joints[i].R, joints[i].r
            )
    blocks: dict[tuple[int, int], np.ndarray] = {}
    for i in range(len(tree.links)):
        n_i = joints[i].S_w.shape[1]
        if n_i == 0 or composite[i].is_zero():
            continue
        momenta = [
            composite[i].momentum(joints[i].S_w[:, k], joints[i].S_v[:, k]) for k in range(n_i)
        ]
        for j in tree.ancestors(i):
            projected = [_project(joints[j], *momentum) for momentum in momenta]
            block = np.array(projected, dtype=object).T
            if j == i:
                if tree.links[i].kind == "free":
                    block[:3, :3] = scaled(composite[i].m, symbolic(np.eye(3)))
                for a, b in zip(*np.triu_indices(n_i, 1), strict=True):
                    block[a, b] = block[b, a]
            blocks[i, j] = block
            if tree.links[j].parent != WORLD:
                R, r = joints[j].R, joints[j].r
                momenta = [
                    (R.dot(angular) + cross(r, R.dot(linear)), R.dot(linear))
                    for angular, linear in momenta
                ]
    return blocks


def link_wrenches(
    inertias: list[BodyInertia], motions: list[LinkMotion]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """(torque, force) about each link's origin, in its frame, that make it move as given."""
    none = zeros(3), zeros(3)
    return [
        none if inertia.is_zero() else inertia.wrench(motion.a, motion.U)
        for inertia, motion in zip(inertias, motions, strict=True)
    ]


def joint_forces(
    tree: Tree, joints: list[JointMotion], wrenches: list[tuple[np.ndarray, np.ndarray]]
) -> list[np.ndarray]:
    """Generalised forces of wrenches on the links: tau_i = S_i^T f_i, f summed towards the root.

    Args:
        tree, joints: as elsewhere.
        wrenches: (torque, force) on each link about its origin, in its frame.

    Returns:
        (k,) forces for the joint of each link.
    """
    torque, force = ([wrench[k] for wrench in wrenches] for k in range(2))
    out: list[np.ndarray] = [zeros(0)] * len(wrenches)
    for i in reversed(range(len(wrenches))):
        joint, parent = joints[i], tree.links[i].parent
        out[i] = _project(joint, torque[i], force[i])
        if parent != WORLD:
            moved = joint.R.dot(force[i])
            force[parent] = force[parent] + moved
            torque[parent] = torque[parent] + (joint.R.dot(torque[i]) + cross(joint.r, moved))
    return out


def _project(joint: JointMotion, angular: np.ndarray, linear: np.ndarray) -> np.ndarray:
    """S^T (angular, linear), (k,)."""
    if joint.S_w.shape[1] == 6:
        return np.concatenate([joint.R_joint.dot(linear), angular])
    columns = range(joint.S_w.shape[1])
    return np.array(
        [dot(joint.S_w[:, k], angular) + dot(joint.S_v[:, k], linear) for k in columns],
        dtype=object,
    )


def factor_pattern(tree: Tree) -> list[list[int]]:
    """For every dynamic velocity k, the dynamic velocities on the way to the root, nearest first.

    These are the columns of row k of L left of the diagonal.
    """
    columns = velocity_columns(tree, Role.DYNAMIC)
    pattern = []
    for k, column in enumerate(columns):
        before = []
        for link in tree.ancestors(column.link):
            other = tree.links[link]
            if other.role is Role.DYNAMIC:
                before.extend(j for j in reversed(range(other.v.start, other.v.stop)) if j < k)
        pattern.append(before)
    return pattern


def factorise(M: np.ndarray, pattern: list[list[int]]) -> np.ndarray:
    """L of M = L^T L, with the reciprocals 1 / L_kk on the diagonal.

    Eliminates the leaves first, so only the pattern's entries are touched.

    Args:
        M: (n, n) object array; the lower triangle is read.
        pattern: from :func:`factor_pattern`.
    """
    n = len(pattern)
    H = M.copy()
    L = zeros(n, n)
    for k in reversed(range(n)):
        L[k, k] = 1 / ca.sqrt(H[k, k])
        for j in pattern[k]:
            L[k, j] = H[k, j] * L[k, k]
        for a, i in enumerate(pattern[k]):
            for j in pattern[k][a:]:
                H[i, j] = H[i, j] - L[k, i] * L[k, j]
    return L


def solve_transposed(L: np.ndarray, x: np.ndarray, pattern: list[list[int]]) -> np.ndarray:
    """w = L^-T x, from the leaves to the root (n,)."""
    w = x.copy()
    for k in reversed(range(len(pattern))):
        w[k] = w[k] * L[k, k]
        for j in pattern[k]:
            w[j] = w[j] - L[k, j] * w[k]
    return w


def solve_lower(L: np.ndarray, w: np.ndarray, pattern: list[list[int]]) -> np.ndarray:
    """y = L^-1 w, from the root to the leaves (n,)."""
    y = w.copy()
    for k in range(len(pattern)):
        for j in pattern[k]:
            y[k] = y[k] - L[k, j] * y[j]
        y[k] = y[k] * L[k, k]
    return y
