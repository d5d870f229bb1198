"""Symbolic expressions of a tree in the paper's symbols, each derived on first use.

:mod:`fantoccini.kernel.equations.functions` turns them into functions.

D stands for dynamic coordinates (q_D, v_D, acc_D), K for driven ones (q_K, v_K, acc_K: ends and
lengths of strings, driven joints). A row is a string or a joint limit with its gap. h is the gap of
a string, path length minus string length; hdot and hddot are its rates. A drive moves a coordinate
by a motor towards its command.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from fantoccini.base.documents import Number, Parameter
from fantoccini.kernel.equations import dynamics
from fantoccini.kernel.equations.algebra import (
    REGULAR,
    Expression,
    cross,
    dot,
    elements,
    scaled,
    symbolic,
    zeros,
)
from fantoccini.kernel.equations.elastic import ElasticForce, elastics
from fantoccini.kernel.equations.inertia import BodyInertia, link_inertia, regrouped
from fantoccini.kernel.equations.kinematics import (
    JointMotion,
    LinkMotion,
    configuration_rate,
    joint_motion,
    link_motions,
)
from fantoccini.kernel.equations.rows import PathRow, RowArguments, limit_row, string_row
from fantoccini.kernel.equations.symbols import Symbols
from fantoccini.model.tree import ChainRow, DriveRow, Role, StringRow, Tree


@dataclass(frozen=True)
class Loads:
    """Forces of a motion.

    Attributes:
        f_D, f_K: forces of springs and damping, in the joints.
        wrenches: wrenches of inertia, gravity and drag, on each link.
        loss: power of damping and drag [W].
    """

    f_D: np.ndarray
    f_K: np.ndarray
    wrenches: list[dynamics.Wrench]
    loss: ca.SX


@dataclass(frozen=True)
class System:
    """A tree's symbolic equations.

    Attributes:
        tree: the tree.
        symbols: symbols of the arguments.
    """

    tree: Tree
    symbols: Symbols = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "symbols", Symbols.of(self.tree))

    def value(self, number: Number) -> ca.SX:
        """A constant for a number, the entry of p for a parameter."""
        if isinstance(number, Parameter):
            return self.symbols.p[list(self.tree.parameters).index(number.parameter)]
        return ca.SX(float(number))

    @cached_property
    def gravity(self) -> np.ndarray:
        """(3,) gravitational acceleration."""
        return symbolic([self.value(x) for x in self.tree.gravity])

    @cached_property
    def inertias(self) -> list[BodyInertia]:
        """Inertia of every link about its origin."""
        return [link_inertia(link, self.value) for link in self.tree.links]

    @cached_property
    def regrouped(self) -> list[BodyInertia]:
        """Inertias with more zeros that give the same equations of motion."""
        return regrouped(self.tree, self.inertias, [joint.r for joint in self.joints])

    @cached_property
    def joints(self) -> list[JointMotion]:
        """Pose and motion subspace of every joint."""
        q = self.by_link(elements(self.symbols.q_D), elements(self.symbols.q_K), "q")
        return [joint_motion(link, q[i], self.value) for i, link in enumerate(self.tree.links)]

    def by_link(self, dynamic: np.ndarray, driven: np.ndarray, letter: str) -> list[np.ndarray]:
        """Each link's entries of a dynamic and a driven vector; ``letter`` is ``q`` or ``v``."""
        parts = []
        for link in self.tree.links:
            source = {Role.DYNAMIC: dynamic, Role.DRIVEN: driven}.get(link.role, zeros(0))
            parts.append(source[getattr(link, letter)])
        return parts

    def _zeros(self) -> tuple[np.ndarray, np.ndarray]:
        """Zero vectors (n_vD,) and (n_vK,)."""
        return zeros(self.tree.coordinates.n_vD), zeros(self.tree.coordinates.n_vK)

    def motions(
        self,
        v_D: np.ndarray | None = None,
        v_K: np.ndarray | None = None,
        acc_D: np.ndarray | None = None,
        acc_K: np.ndarray | None = None,
        gravity: np.ndarray | None = None,
    ) -> list[LinkMotion]:
        """Link motions for velocities and accelerations; those not given are zero."""
        zero_D, zero_K = self._zeros()
        velocity, acceleration = (
            self.by_link(zero_D if D is None else D, zero_K if K is None else K, "v")
            for D, K in ((v_D, v_K), (acc_D, acc_K))
        )
        g = self.gravity if gravity is None else gravity
        return link_motions(self.tree, self.joints, velocity, acceleration, g)

    @cached_property
    def free_motions(self) -> list[LinkMotion]:
        """Link motions with acc_D = 0, for the bias and the driven accelerations."""
        s = self.symbols
        return self.motions(elements(s.v_D), elements(s.v_K), acc_K=elements(s.acc_K))

    @cached_property
    def full_motions(self) -> list[LinkMotion]:
        """Link motions with all accelerations."""
        s = self.symbols
        return self.motions(*map(elements, (s.v_D, s.v_K, s.acc_D, s.acc_K)))

    @cached_property
    def resting_motions(self) -> list[LinkMotion]:
        """Link motions at zero velocity and acceleration, with gravity."""
        return self.motions()

    @cached_property
    def ahead_motions(self) -> list[LinkMotion]:
        """:attr:`free_motions` with velocity products of v_ahead, for a step."""
        s = self.symbols
        return self.motions(elements(s.v_ahead), elements(s.v_K), acc_K=elements(s.acc_K))

    def row_arguments(self, motions: list[LinkMotion]) -> RowArguments:
        """Arguments of rows for given motions."""
        return RowArguments(self.tree, self.joints, motions, self.gravity, self.value)

    @cached_property
    def armature(self) -> np.ndarray:
        """(n_vD,) inertia of drives and of joints' rotors, on the diagonal of M_DD."""
        diagonal = zeros(self.tree.coordinates.n_vD)
        for link in self.tree.links:
            if link.role is Role.DYNAMIC:
                diagonal[link.v] = self.value(link.armature)
        for row in self.tree.drives:
            diagonal[row.v] = row.inertia(self.value)
        return diagonal

    def resistance(self, row: DriveRow) -> ca.SX:
        """Friction of a drive divided by its speed: its force is -resistance v [N s/m or N m s]."""
        friction = row.drive.friction
        if friction is None:
            return ca.SX(0)
        n, v = row.ratio(self.value), elements(self.symbols.v_D)[row.v]
        viscous = n * n * self.value(friction.viscous)
        coulomb = self.value(friction.coulomb)
        if coulomb.is_zero():
            return viscous
        speed = self.value(friction.speed)
        return viscous + n * n * coulomb / ca.sqrt(n * n * dot(v, v) + speed * speed)

    @cached_property
    def mass_blocks(self) -> dict[tuple[int, int], np.ndarray]:
        """Blocks of the full mass matrix by links."""
        return dynamics.mass_matrix(self.tree, self.joints, self.regrouped)

    def mass(self, rows: Role, columns: Role) -> np.ndarray:
        """A block of the mass matrix: M_DD, M_DK or M_KK as an object array."""
        table = self.tree.coordinates
        size = {Role.DYNAMIC: table.n_vD, Role.DRIVEN: table.n_vK}
        M = zeros(size[rows], size[columns])
        links = self.tree.links
        for (i, j), block in self.mass_blocks.items():
            if (links[j].role, links[i].role) == (rows, columns):
                M[links[j].v, links[i].v] = block
            if (links[i].role, links[j].role) == (rows, columns):
                M[links[i].v, links[j].v] = block.T
        if rows is columns is Role.DYNAMIC:
            M[np.diag_indices(table.n_vD)] += self.armature
        return M

    @cached_property
    def elastics(self) -> list[ElasticForce]:
        """Springs between points, and the pieces of chains."""
        return elastics(self.row_arguments(self.free_motions), self.unstretched_length)

    def spring_forces(self, f_D: np.ndarray, f_K: np.ndarray) -> None:
        """Adds the gradient of the springs' energy to f_D and f_K."""
        q = self.by_link(elements(self.symbols.q_D), elements(self.symbols.q_K), "q")
        for i, link in enumerate(self.tree.links):
            k = self.value(link.stiffness)
            if link.role is not Role.DYNAMIC or k.is_zero():
                continue
            gradient = (
                scaled(2 * k * q[i][0], q[i][1:])
                if link.kind == "ball"
                else scaled(k, q[i] - symbolic([self.value(link.rest)]))
            )
            f_D[link.v] = f_D[link.v] + gradient
        for elastic in self.elastics:
            elastic.add_gradient(f_D, f_K)

    def dissipation(self) -> tuple[np.ndarray, np.ndarray, list[dynamics.Wrench], ca.SX]:
        """Damping (f_D, f_K) of joints, drives and springs, drag on the links, and lost power."""
        (f_D, f_K), loss = self._zeros(), ca.SX(0)
        v = self.by_link(elements(self.symbols.v_D), elements(self.symbols.v_K), "v")
        wrenches: list[dynamics.Wrench] = []
        for i, link in enumerate(self.tree.links):
            damping = self.value(link.damping)
            if link.role is Role.DYNAMIC and not damping.is_zero():
                f_D[link.v] = f_D[link.v] + scaled(damping, v[i])
                loss = loss + damping * dot(v[i], v[i])
            torque, force, lost = self.drag(i)
            wrenches.append((torque, force))
            loss = loss + lost
        v_D = elements(self.symbols.v_D)
        for row in self.tree.drives:
            friction = scaled(self.resistance(row), v_D[row.v])
            f_D[row.v] = f_D[row.v] + friction
            loss = loss + dot(friction, v_D[row.v])
        for elastic in self.elastics:
            loss = loss + elastic.add_damping(f_D, f_K)
        return f_D, f_K, wrenches, loss

    def drag(self, i: int) -> tuple[np.ndarray, np.ndarray, ca.SX]:
        """Air drag on link i: torque about its origin and force, in its frame; lost power."""
        rate, angular = self.drag_rates[i]
        if rate.is_zero() and angular.is_zero():
            return zeros(3), zeros(3), ca.SX(0)
        motion = self.free_motions[i]
        com = self.centre_of_mass(i)
        v = motion.v + cross(motion.w, com)
        force = scaled(-rate, v)
        torque = cross(com, force) - scaled(angular, motion.w)
        return torque, force, rate * dot(v, v) + angular * dot(motion.w, motion.w)

    @cached_property
    def drag_rates(self) -> list[tuple[ca.SX, ca.SX]]:
        """Drag / speed of the centre of mass [N s/m] and torque / spin [N m s] of every link."""
        rates = []
        for i, link in enumerate(self.tree.links):
            rate, quadratic, angular = (self.value(x) for x in link.drag)
            if not quadratic.is_zero():
                v = self.free_motions[i].v + cross(self.free_motions[i].w, self.centre_of_mass(i))
                rate = rate + quadratic * ca.sqrt(dot(v, v) + REGULAR.square)
            rates.append((rate, angular))
        return rates

    def drag_inertia(self, i: int, dt: ca.SX) -> BodyInertia:
        """The inertia that drag over a step dt adds to link i: dt times its drag rates."""
        rate, angular = (dt * x for x in self.drag_rates[i])
        if rate.is_zero() and angular.is_zero():
            return BodyInertia.zero()
        com = self.centre_of_mass(i)
        J = scaled(0.5 * angular, symbolic(np.eye(3)))
        J = J + np.array([[rate * x * y for y in com] for x in com], dtype=object)
        return BodyInertia(rate, scaled(rate, com), J)

    def centre_of_mass(self, i: int) -> np.ndarray:
        """(3,) centre of mass of link i in its frame; its origin if it is massless."""
        inertia = self.inertias[i]
        return zeros(3) if inertia.m.is_zero() else scaled(1 / inertia.m, inertia.h)

    def loads(self, motions: list[LinkMotion]) -> Loads:
        """Forces of a motion: inertia, gravity, springs, damping and drag."""
        f_D, f_K, drag, loss = self.dissipation()
        self.spring_forces(f_D, f_K)
        inertial = dynamics.link_wrenches(self.regrouped, motions)
        wrenches = [
            (torque - drag_torque, force - drag_force)
            for (torque, force), (drag_torque, drag_force) in zip(inertial, drag, strict=True)
        ]
        return Loads(f_D, f_K, wrenches, loss)

    def generalised(self, loads: Loads) -> tuple[np.ndarray, np.ndarray]:
        """Generalised forces (n_vD,) and (n_vK,) of loads."""
        link_D, link_K = self.by_velocity(
            dynamics.joint_forces(self.tree, self.joints, loads.wrenches)
        )
        return loads.f_D + link_D, loads.f_K + link_K

    def by_velocity(self, forces: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """A dynamic (n_vD,) and a driven (n_vK,) vector from the forces in every link's joint."""
        f_D, f_K = self._zeros()
        for link, force in zip(self.tree.links, forces, strict=True):
            if link.role is Role.DYNAMIC:
                f_D[link.v] = force
            elif link.role is Role.DRIVEN:
                f_K[link.v] = force
        return f_D, f_K

    @cached_property
    def free_loads(self) -> Loads:
        """Loads at acc_D = 0: c + M_DK acc_K, with dissipation."""
        return self.loads(self.free_motions)

    @cached_property
    def step_loads(self) -> Loads:
        """:attr:`free_loads` with velocity products of v_ahead, for a step."""
        return self.loads(self.ahead_motions)

    def inertial(self, acc_D: np.ndarray | None, acc_K: np.ndarray | None) -> np.ndarray:
        """(n_vD,) M_DD acc_D + M_DK acc_K, without M."""
        motions = self.motions(acc_D=acc_D, acc_K=acc_K, gravity=zeros(3))
        wrenches = dynamics.link_wrenches(self.regrouped, motions)
        forces = self.generalised(Loads(*self._zeros(), wrenches, ca.SX(0)))[0]
        return forces if acc_D is None else forces + self.armature * acc_D

    @cached_property
    def bias_D(self) -> np.ndarray:
        """(n_vD,) c(q, v) of Eq. 8: Coriolis, gravity and springs, without dissipation."""
        s = self.symbols
        motions = self.motions(elements(s.v_D), elements(s.v_K))
        return self._conservative(motions)

    @cached_property
    def g_D(self) -> np.ndarray:
        """(n_vD,) g(q) of Eq. 8: gradient of the potential energy."""
        return self._conservative(self.resting_motions)

    def _conservative(self, motions: list[LinkMotion]) -> np.ndarray:
        f_D, f_K = self._zeros()
        self.spring_forces(f_D, f_K)
        wrenches = dynamics.link_wrenches(self.regrouped, motions)
        return self.generalised(Loads(f_D, f_K, wrenches, ca.SX(0)))[0]

    @cached_property
    def dissipation_D(self) -> np.ndarray:
        """(n_vD,) generalised force of damping and drag, with the sign of the bias."""
        f_D, f_K, drag, loss = self.dissipation()
        wrenches = [(-torque, -force) for torque, force in drag]
        return self.generalised(Loads(f_D, f_K, wrenches, loss))[0]

    @cached_property
    def string_rows(self) -> list[PathRow]:
        """h, hdot, gamma, A_D, A_K of every string."""
        arguments = self.row_arguments(self.free_motions)
        return [string_row(arguments, s, *self.unstretched_length(s)) for s in self.tree.strings]

    @cached_property
    def full_string_rows(self) -> list[PathRow]:
        """:attr:`string_rows` with all accelerations, so that ``bias`` is hddot."""
        arguments, rows = self.row_arguments(self.full_motions), []
        for string in self.tree.strings:
            length, rate, acceleration = self.unstretched_length(string)
            if string.wound_length:
                acceleration = self.symbols.acc_D[string.wound_length[1]]
            rows.append(string_row(arguments, string, length, rate, acceleration))
        return rows

    def unstretched_length(self, string: StringRow | ChainRow) -> tuple[ca.SX, ca.SX, ca.SX]:
        """L, its rate, and its acceleration at acc_D = 0."""
        s, zero = self.symbols, ca.SX(0)
        if string.driven_length:
            q, v = string.driven_length
            return Expression(s.q_K[q]), Expression(s.v_K[v]), Expression(s.acc_K[v])
        if string.wound_length:
            q, v = string.wound_length
            return Expression(s.q_D[q]), Expression(s.v_D[v]), zero
        assert string.length is not None, "a length is a coordinate or a number"
        return self.value(string.length), zero, zero

    @cached_property
    def limit_rows(self) -> list[tuple[ca.SX, np.ndarray, ca.SX]]:
        """h, Jacobian by the joint's velocities, and gamma of every limit."""
        q_D, v_D = elements(self.symbols.q_D), elements(self.symbols.v_D)
        rows = []
        for limit in self.tree.limits:
            link = self.tree.links[limit.link]
            rows.append(limit_row(limit, q_D[link.q], v_D[link.v]))
        return rows

    @cached_property
    def rates(self) -> tuple[ca.SX, ca.SX]:
        """(qdot_D, qdot_K) of the configuration numbers."""
        s, t = self.symbols, self.tree.coordinates
        return (
            configuration_rate(s.q_D, s.v_D, t.quaternions_D, t.scalars_D),
            configuration_rate(s.q_K, s.v_K, t.quaternions_K, t.scalars_K),
        )
