"""The Coriolis matrix C(q, v) of Eq. 8.

If every joint is scalar, it consists of Christoffel symbols:

    C_ij = sum_k 1/2 (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) v_k

Otherwise it is the sum over bodies of J^T (I Jdot + B J), with B the skew matrix of the body's
momentum (angular l, linear p), B (w, v) = (-l x w - p x v, -p x w). In both cases C v is the
velocity-dependent part of the bias and dM/dt - 2 C is skew, over all dynamic and driven velocities.

J and Jdot are the Jacobian of a body's twist (velocity) and its rate, I is its inertia. v_D and v_K
are the dynamic and the driven velocities. A link is a body on its joint.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from fantoccini.kernel.equations.algebra import cross, dot, elements, matrix, zeros
from fantoccini.kernel.equations.inertia import BodyInertia
from fantoccini.kernel.equations.kinematics import JointMotion, LinkMotion
from fantoccini.kernel.equations.system import System
from fantoccini.model.tree import WORLD, Role

_SCALAR = ("fixed", "revolute", "prismatic", "translation")
Columns = dict[int, tuple[np.ndarray, ...]]
"""Velocity -> (w, v, wdot, vdot) of a body per unit velocity."""


def coriolis_matrix(system: System) -> ca.SX:
    """C over (v_D, v_K), (n_vD + n_vK, n_vD + n_vK)."""
    if all(link.kind in _SCALAR for link in system.tree.links):
        return _christoffel(system)
    return _from_bodies(system)


def _christoffel(system: System) -> ca.SX:
    s = system.symbols
    q, v = ca.vertcat(s.q_D, s.q_K), ca.vertcat(s.v_D, s.v_K)
    dynamic, driven = Role.DYNAMIC, Role.DRIVEN
    M_DK = system.mass(dynamic, driven)
    M = matrix(
        np.block([[system.mass(dynamic, dynamic), M_DK], [M_DK.T, system.mass(driven, driven)]])
    )
    n = v.numel()
    derivative = ca.jacobian(ca.vec(M), q)
    C = ca.SX.zeros(n, n)
    for i in range(n):
        for j in range(n):
            for k in range(n):
                term = (
                    derivative[i + n * j, k] + derivative[i + n * k, j] - derivative[j + n * k, i]
                )
                C[i, j] += 0.5 * term * v[k]
    return C


def _from_bodies(system: System) -> ca.SX:
    s, tree, table = system.symbols, system.tree, system.tree.coordinates
    n_D, n = table.n_vD, table.n_vD + table.n_vK
    velocity = system.by_link(elements(s.v_D), elements(s.v_K), "v")
    C = zeros(n, n)
    jacobians: list[Columns] = []
    for i, link in enumerate(tree.links):
        joint = system.joints[i]
        w_joint, v_joint = joint.S_w.dot(velocity[i]), joint.S_v.dot(velocity[i])
        columns: Columns = {}
        if link.parent != WORLD:
            for c, (w, v, wdot, vdot) in jacobians[link.parent].items():
                w_here, v_here = _in_link_frame(joint, w, v)
                wdot_here, vdot_here = _in_link_frame(joint, wdot, vdot)
                # Xdot = -(joint velocity) x X
                wdot_here = wdot_here - cross(w_joint, w_here)
                vdot_here = vdot_here - cross(w_joint, v_here) - cross(v_joint, w_here)
                columns[c] = (w_here, v_here, wdot_here, vdot_here)
        first = link.v.start + (n_D if link.role is Role.DRIVEN else 0)
        for k in range(joint.S_w.shape[1]):
            if link.role is Role.FIXED:
                continue
            turning = cross(joint.S_v[:, k], w_joint) if link.kind == "free" else zeros(3)
            columns[first + k] = (joint.S_w[:, k], joint.S_v[:, k], zeros(3), turning)
        jacobians.append(columns)
        _add_body(C, system.inertias[i], system.free_motions[i], columns)
    return matrix(C)


def _in_link_frame(
    joint: JointMotion, w: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """A motion of the parent, transformed to the link's frame."""
    Rt = joint.R.T
    return Rt.dot(w), Rt.dot(v + cross(w, joint.r))


def _add_body(C: np.ndarray, inertia: BodyInertia, motion: LinkMotion, columns: Columns) -> None:
    """Adds J^T (I Jdot + B J) of one body."""
    if inertia.is_zero():
        return
    angular, linear = inertia.momentum(motion.w, motion.v)
    for j, (w, v, wdot, vdot) in columns.items():
        torque, force = inertia.momentum(wdot, vdot)
        torque = torque - cross(angular, w) - cross(linear, v)
        force = force - cross(linear, w)
        for i, (w_i, v_i, _, _) in columns.items():
            C[i, j] = C[i, j] + dot(w_i, torque) + dot(v_i, force)
