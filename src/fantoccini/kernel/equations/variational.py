"""Discrete Euler-Lagrange equations by the midpoint rule, in the configurations themselves.

A step of length dt goes from q_k to q_k+1 = q_k c(xi/4) c(xi/4), with a tangent vector xi of the
size of the velocities. A scalar moves by xi; a quaternion turns twice by

    c(s) = (1, s) / sqrt(1 + s.s),                   a turn by 2 atan |s| about s (Cayley's map)

so that no orientation is singular. The discrete Lagrangian is evaluated at the midpoint
q_mid = q_k c(xi/4) with v_mid = xi/dt:

    L_d = dt L(q_mid, v_mid),    P = dL/dv,    G = dt/2 (dL/dq + u_D - damping - drag)

With s = xi/4 and the quaternions' tangent vectors in the body's frame, its derivatives give the
momenta at both ends,

    p_k   = P - G,   p_k+1 = P + G                                                 (scalars)
    p_k   = (1 - s.s) P + 2 (s x P) + 2 s (s.P) - (G + s x G)                      (quaternions)
    p_k+1 = (1 - s.s) P - 2 (s x P) + 2 s (s.P) + (G - s x G)

and a step solves p_k - A_D(q_k)^T Lambda = p_k(xi) for xi, with h(q_k+1) <= 0 complementary to
Lambda >= 0. Half of the midpoint's forces act before it and half after it, so that the rule is of
second order with damping, drag and moving inputs, too. Driven coordinates are not unknowns: q_K,mid
lies half-way between the inputs at both ends, v_K,mid leads from one to the other.

P and dL/dq come from two recursions over the tree. With the twist (w, v) of a link and the momentum
H = (H_w, H_v) of its subtree, about its origin and in its frame,

    P = S^T H,     dT/dq = S_w^T (H_w x w_c + H_v x v) + S_v^T (H_v x w_c)

where w_c is w without the joint's own motion.

D stands for dynamic coordinates, K for driven ones. h is the gap of a string and A_D its
derivative, Lambda its impulse.
"""

from __future__ import annotations

from functools import cached_property

import casadi as ca
import numpy as np

from fantoccini.kernel.equations import drives, dynamics
from fantoccini.kernel.equations.algebra import column, cross, dot, elements, scaled, zeros
from fantoccini.kernel.equations.declared import declared
from fantoccini.kernel.equations.functions import Equations
from fantoccini.kernel.equations.kinematics import JointMotion
from fantoccini.model.tree import WORLD, Link, Role


class Variational:
    """The discrete equations of a tree as CasADi functions.

    Attributes:
        equations: continuous equations of the tree.
    """

    def __init__(self, equations: Equations):
        self.equations = equations

    def functions(self) -> dict[str, ca.Function]:
        """Name -> compiled function; all results are dense."""
        return {
            "node": self._node(),
            "midpoint_rule": self._midpoint_rule(),
            "momenta": self._momenta(),
        }

    def _node(self) -> ca.Function:
        exact, firm = self.equations["dynamics"], self.equations["step_dynamics"]
        symbols = self.equations.system.symbols
        arguments = {**symbols, "v_ahead": symbols["v_D"]}
        results, with_damping = (
            dict(zip(f.name_out(), f.call([arguments[a] for a in f.name_in()]), strict=True))
            for f in (exact, firm)
        )
        results |= {f"{name}_firm": with_damping[name] for name in ("L", "W", "G")}
        results["power0"] = with_damping["power0"]  # the motors' work is added at the midpoint
        return declared("node", symbols, results)

    def _midpoint_rule(self) -> ca.Function:
        system = self.equations.system
        s = system.symbols
        q_mid, q_next = self._moved(s.xi, 1), self._moved(s.xi, 2)
        P, force, motors = self._at(q_mid, s.xi / s.dt, s.q_mid, s.v_mid, s.acc_mid, s.u_D, s.p)
        before, after = self._ends(elements(P), elements(force), elements(s.xi))
        results = {
            "before": before,
            "after": after,
            "q_next": q_next,
            "h": self.equations["rows"](q_next, s.q_K, s.p),
            "work_M": dot(elements(motors), elements(s.xi)),
        }
        return declared("midpoint_rule", s, results)

    def _momenta(self) -> ca.Function:
        s = self.equations.system.symbols
        P, _, _ = self._at(s.q_D, s.v_D, s.q_K, s.v_K, s.acc_K, s.u_D, s.p)
        return declared("momenta", s, {"p_D": P})

    def _moved(self, xi: ca.SX, times: int) -> ca.SX:
        """q_D moved by c(xi/4) once or twice."""
        s, table = self.equations.system.symbols, self.equations.tree.coordinates
        q = elements(s.q_D)
        for i, j in table.scalars_D:
            q[i] = q[i] + 0.5 * times * xi[j]
        for i, j in table.quaternions_D:
            quarter_rotation = scaled(0.25, elements(xi[j : j + 3]))
            square = dot(quarter_rotation, quarter_rotation)
            if times == 1:
                scale = 1 / ca.sqrt(1 + square)
                real, vector = scale, scaled(scale, quarter_rotation)
            else:
                scale = 1 / (1 + square)
                real, vector = (1 - square) * scale, scaled(2 * scale, quarter_rotation)
            w, u = q[i], q[i + 1 : i + 4].copy()
            q[i] = w * real - dot(u, vector)
            q[i + 1 : i + 4] = scaled(w, vector) + scaled(real, u) + cross(u, vector)
        return column(q)

    def _ends(self, P: np.ndarray, force: np.ndarray, xi: np.ndarray) -> tuple[ca.SX, ca.SX]:
        """p_k and p_k+1 from P and dL/dq + u_D - damping - drag."""
        table, dt = self.equations.tree.coordinates, self.equations.system.symbols.dt
        G = scaled(0.5 * dt, force)
        before, after = P - G, P + G
        for _, j in table.quaternions_D:
            components = slice(j, j + 3)
            quarter_rotation, momentum = scaled(0.25, xi[components]), P[components]
            even = scaled(1 - dot(quarter_rotation, quarter_rotation), momentum) + scaled(
                2 * dot(quarter_rotation, momentum), quarter_rotation
            )
            even = even - cross(quarter_rotation, G[components])
            odd = scaled(2, cross(quarter_rotation, momentum)) - G[components]
            before[components], after[components] = even + odd, even - odd
        return column(before), column(after)

    @cached_property
    def _at(self) -> ca.Function:
        """(q_D, v_D, q_K, v_K, acc_K, u_D, p) -> P (n_vD,), dL/dq + u_D - damping - drag (n_vD,).

        The third result is the motors' forces (n_vD,), which the second one includes.
        """
        system = self.equations.system
        s, tree = system.symbols, system.tree
        loads = system.loads(system.resting_motions)
        static, _ = system.generalised(loads)
        P = system.armature * elements(s.v_D)
        motors = drives.forces(system, ca.SX(0)).f_D
        slope = elements(s.u_D) + motors - static
        velocities, twists = self._twists()
        momenta = [
            inertia.momentum(*twist)
            for inertia, twist in zip(system.regrouped, twists, strict=True)
        ]
        sums = dynamics.summed(tree, system.joints, momenta)
        for link, joint, H, w_c, twist in zip(
            tree.links, system.joints, sums, velocities, twists, strict=True
        ):
            if link.role is Role.DYNAMIC:
                P[link.v] = P[link.v] + dynamics.project(joint, *H)
                slope[link.v] = slope[link.v] + _slope(link, joint, H, w_c, twist[1])
        arguments = [s.q_D, s.v_D, s.q_K, s.v_K, s.acc_K, s.u_D, s.p]
        return ca.Function("at", arguments, [column(P), column(slope), column(motors)])

    def _twists(self) -> tuple[list[np.ndarray], list[dynamics.Wrench]]:
        """w_c and (w, v) of every link, in its frame."""
        system = self.equations.system
        s, tree = system.symbols, system.tree
        velocity = system.by_link(elements(s.v_D), elements(s.v_K), "v")
        velocities: list[np.ndarray] = []
        twists: list[tuple[np.ndarray, np.ndarray]] = []
        for i, link in enumerate(tree.links):
            joint = system.joints[i]
            w_up, v_up = (zeros(3), zeros(3)) if link.parent == WORLD else twists[link.parent]
            w, v = joint.R.T.dot(w_up), joint.R.T.dot(v_up + cross(w_up, joint.r))
            velocities.append(w)
            joint_velocity = velocity[i]
            twists.append((w + joint.S_w.dot(joint_velocity), v + joint.S_v.dot(joint_velocity)))
        return velocities, twists


def _slope(
    link: Link, joint: JointMotion, H: dynamics.Wrench, w_c: np.ndarray, v: np.ndarray
) -> np.ndarray:
    """dT/dq of a joint, along its tangent vectors."""
    H_w, H_v = H
    turning = cross(H_w, w_c) + cross(H_v, v)
    sliding = cross(H_v, w_c)
    if link.kind == "free":
        # The linear velocity is in the joint's frame, which does not turn with the link.
        return np.concatenate([joint.R_joint.dot(sliding), turning])
    columns = range(joint.S_w.shape[1])
    return np.array(
        [dot(joint.S_w[:, k], turning) + dot(joint.S_v[:, k], sliding) for k in columns],
        dtype=object,
    )
