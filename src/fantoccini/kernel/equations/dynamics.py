"""M and c of the equations of motion.

M_DD acc_D + M_DK acc_K + c(q, v) = u_D + A_D^T lambda                        (Eq. 10)

M comes from the composite-rigid-body recursion, the bias from recursive Newton-Euler: Lagrange's
equations (Eqs. 5-8) without redundant work. The factor of M_DD is derived without M
(:mod:`fantoccini.kernel.equations.articulated`).

D stands for dynamic coordinates, K for driven ones (ends and lengths of strings, driven joints);
lambda is minus the tension, and c the bias: Coriolis and centrifugal forces, gravity. A wrench is a
force with a torque. A link is a body on its joint.
"""

from __future__ import annotations

import numpy as np

from fantoccini.kernel.equations.algebra import cross, dot, scaled, symbolic, zeros
from fantoccini.kernel.equations.inertia import BodyInertia
from fantoccini.kernel.equations.kinematics import JointMotion, LinkMotion
from fantoccini.model.tree import WORLD, Tree

Wrench = tuple[np.ndarray, np.ndarray]
"""(torque, force) about a link's origin, in its frame."""


def mass_matrix(
    tree: Tree, joints: list[JointMotion], inertias: list[BodyInertia]
) -> dict[tuple[int, int], np.ndarray]:
    """Blocks of M between the joints of links i and j, for j an ancestor of i or i itself.

    H_ij = S_j^T (X_ij^T I_i^c S_i), with I_i^c the inertia of the whole subtree below i.

    Returns:
        (i, j) -> (k_j, k_i) block, for links with moving joints.
    """
    composite = list(inertias)
    for i in reversed(range(len(tree.links))):
        parent = tree.links[i].parent
        if parent != WORLD and not composite[i].is_zero():
            composite[parent] = composite[parent] + composite[i].in_parent(joints[i].R, joints[i].r)
    blocks: dict[tuple[int, int], np.ndarray] = {}
    for i in range(len(tree.links)):
        n_i = joints[i].S_w.shape[1]
        if n_i == 0 or composite[i].is_zero():
            continue
        momenta = [
            composite[i].momentum(joints[i].S_w[:, k], joints[i].S_v[:, k]) for k in range(n_i)
        ]
        for j in tree.ancestors(i):
            projected = [project(joints[j], *momentum) for momentum in momenta]
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


def link_wrenches(inertias: list[BodyInertia], motions: list[LinkMotion]) -> list[Wrench]:
    """The wrench on each link that causes its motion."""
    zero = zeros(3), zeros(3)
    return [
        zero if inertia.is_zero() else inertia.wrench(motion.a, motion.U)
        for inertia, motion in zip(inertias, motions, strict=True)
    ]


def joint_forces(tree: Tree, joints: list[JointMotion], wrenches: list[Wrench]) -> list[np.ndarray]:
    """Generalised forces of wrenches on the links: tau_i = S_i^T f_i, with f summed to the root.

    Args:
        tree, joints: the tree and its joints at the configuration.
        wrenches: wrench on each link.

    Returns:
        (k,) forces for the joint of each link.
    """
    sums = summed(tree, joints, wrenches)
    return [project(joint, *total) for joint, total in zip(joints, sums, strict=True)]


def summed(tree: Tree, joints: list[JointMotion], wrenches: list[Wrench]) -> list[Wrench]:
    """Total wrench, or momentum, of every link's subtree about the link's origin."""
    torque, force = ([wrench[k] for wrench in wrenches] for k in range(2))
    for i in reversed(range(len(wrenches))):
        joint, parent = joints[i], tree.links[i].parent
        if parent != WORLD:
            force_in_parent = joint.R.dot(force[i])
            force[parent] = force[parent] + force_in_parent
            torque[parent] = torque[parent] + (
                joint.R.dot(torque[i]) + cross(joint.r, force_in_parent)
            )
    return list(zip(torque, force, strict=True))


def project(joint: JointMotion, angular: np.ndarray, linear: np.ndarray) -> np.ndarray:
    """(k,) projection S^T (angular, linear)."""
    if joint.S_w.shape[1] == 6:
        return np.concatenate([joint.R_joint.dot(linear), angular])
    columns = range(joint.S_w.shape[1])
    return np.array(
        [dot(joint.S_w[:, k], angular) + dot(joint.S_v[:, k], linear) for k in columns],
        dtype=object,
    )
