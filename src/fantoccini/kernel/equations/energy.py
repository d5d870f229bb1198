"""Kinetic and potential energy of a system.

q_D and q_K are the dynamic and driven coordinates, v_D and v_K their velocities. A link is a body
on its joint.
"""

from __future__ import annotations

import casadi as ca

from fantoccini.kernel.equations.algebra import cross, dot, elements
from fantoccini.kernel.equations.elastic import elastics
from fantoccini.kernel.equations.system import System
from fantoccini.model.tree import Role


def kinetic_energy(system: System) -> ca.SX:
    """T = sum_i 1/2 V_i . I_i V_i (Eq. 5)."""
    total = ca.SX(0)
    for inertia, motion in zip(system.regrouped, system.free_motions, strict=True):
        if inertia.is_zero():
            continue
        v, w_cross_h = motion.v, cross(motion.w, inertia.h)
        turning = dot(motion.w, inertia.I.dot(motion.w)) + inertia.m * dot(v, v)
        total = total + (0.5 * turning + dot(v, w_cross_h))
    v_D = elements(system.symbols.v_D)
    return total + 0.5 * dot(system.armature * v_D, v_D)


def potential_energy(system: System) -> ca.SX:
    """V = -sum_i m_i g . p_i (Eq. 6 with gravity's acceleration), plus the springs' energy."""
    total = ca.SX(0)
    for i, motion in enumerate(system.resting_motions):
        m = system.inertias[i].m
        if not m.is_zero():
            total = total - m * dot(system.gravity, motion.point(system.centre_of_mass(i)))
    q = system.by_link(elements(system.symbols.q_D), elements(system.symbols.q_K), "q")
    for i, link in enumerate(system.tree.links):
        k = system.value(link.stiffness)
        if link.role is not Role.DYNAMIC or k.is_zero():
            continue
        if link.kind == "ball":
            total = total + 2 * k * (1 - q[i][0] ** 2)
        else:
            total = total + 0.5 * k * (q[i][0] - system.value(link.rest)) ** 2
    for elastic in elastics(
        system.row_arguments(system.resting_motions), system.unstretched_length
    ):
        total = total + elastic.energy
    return total
