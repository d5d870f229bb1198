"""Inertia of a link from its shapes and its explicit values.

A link's inertia about its origin is stored as (m, h, J): the mass, the first moment h = m c and the
second moment J = tr(I)/2 1 - I, with I = I_c + m (c.c 1 - c c^T) the rotational inertia.

A link is a body on its joint, c its centre of mass and I_c the rotational inertia about it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from fantoccini.base.documents import Number
from fantoccini.kernel.equations.algebra import cross, dot, scaled, symbolic, zeros
from fantoccini.model.tree import WORLD, Link, Tree

Value = Callable[[Number], ca.SX]


@dataclass(frozen=True)
class BodyInertia:
    """Mass and its first and second moments about a frame's origin.

    Attributes:
        m: mass [kg].
        h: (3,) first moment, the sum of m r [kg m].
        J: (3, 3) second moment, the sum of m r r^T [kg m^2].
    """

    m: ca.SX
    h: np.ndarray
    J: np.ndarray

    def __add__(self, other: BodyInertia) -> BodyInertia:
        return BodyInertia(self.m + other.m, self.h + other.h, self.J + other.J)

    @classmethod
    def zero(cls) -> BodyInertia:
        """The inertia of a massless frame."""
        return cls(ca.SX(0), zeros(3), zeros(3, 3))

    def is_zero(self) -> bool:
        """Whether mass and moments are zero."""
        return all(ca.SX(x).is_zero() for x in (self.m, *self.h.flat, *self.J.flat))

    @property
    def I(self) -> np.ndarray:  # noqa: E743 the quantity's symbol
        """(3, 3) rotational inertia about the origin, tr(J) 1 - J [kg m^2]."""
        out = -self.J
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            out[i, i] = self.J[j, j] + self.J[k, k]
        return out

    def momentum(self, omega: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(I w + h x v, m v - h x w): angular and linear momentum about the origin."""
        return self.I.dot(omega) + cross(self.h, v), scaled(self.m, v) - cross(self.h, omega)

    def wrench(self, a: np.ndarray, U: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(torque about the origin, force) for which all points accelerate by a + U r.

        The force is m a + U h; the torque is h x a plus the skew part of U J.
        """
        J = self.J
        yz, xz, xy = J[1, 2], J[0, 2], J[0, 1]
        torque = [
            U[2, 1] * J[1, 1]
            - U[1, 2] * J[2, 2]
            + yz * (U[2, 2] - U[1, 1])
            + (U[2, 0] * xy - U[1, 0] * xz),
            U[0, 2] * J[2, 2]
            - U[2, 0] * J[0, 0]
            + xz * (U[0, 0] - U[2, 2])
            + (U[0, 1] * yz - U[2, 1] * xy),
            U[1, 0] * J[0, 0]
            - U[0, 1] * J[1, 1]
            + xy * (U[1, 1] - U[0, 0])
            + (U[1, 2] * xz - U[0, 2] * yz),
        ]
        return cross(self.h, a) + np.array(torque, dtype=object), scaled(self.m, a) + U.dot(self.h)

    def in_parent(self, R: np.ndarray, r: np.ndarray) -> BodyInertia:
        """The inertia about the parent's origin, for a link with pose (R, r) in the parent.

        J' = R J R^T + h r^T + r h'^T, with h and h' = h + m r in the parent's axes.
        """
        h = R.dot(self.h)
        first_moment = h + scaled(self.m, r)
        out = rotated(R, self.J)
        for i in range(3):
            for j in range(i + 1):
                out[i, j] = out[j, i] = out[i, j] + (h[i] * r[j] + r[i] * first_moment[j])
        return BodyInertia(self.m, first_moment, out)

    def without_mass(self) -> tuple[BodyInertia, BodyInertia]:
        """(rest, part): the part is a point mass at the origin."""
        nothing = BodyInertia.zero()
        return BodyInertia(ca.SX(0), self.h, self.J), BodyInertia(self.m, nothing.h, nothing.J)

    def without_axis(self, axis: np.ndarray) -> tuple[BodyInertia, BodyInertia]:
        """(rest, part): the part is mass on an axis."""
        e = symbolic(axis)
        h_along, J_along = dot(e, self.h), dot(e, self.J.dot(e))
        axial = np.array([[J_along * x * y for y in e] for x in e], dtype=object)
        h, J = self.h - scaled(h_along, e), self.J - axial
        for k in range(3):
            if abs(axis[k]) == 1.0:
                h[k], J[k, k] = ca.SX(0), ca.SX(0)
        return BodyInertia(ca.SX(0), h, J), BodyInertia(self.m, scaled(h_along, e), axial)

    def without_turning(self) -> tuple[BodyInertia, BodyInertia]:
        """(rest, part): the part is the second moment, which acts in rotation only."""
        return BodyInertia(self.m, self.h, zeros(3, 3)), BodyInertia(ca.SX(0), zeros(3), self.J)


def regrouped(
    tree: Tree, inertias: list[BodyInertia], offsets: list[np.ndarray]
) -> list[BodyInertia]:
    """Inertias with more zeros that give the same equations of motion.

    Mass that a joint does not move relative to the parent is moved to the parent: a link on a fixed
    joint, a point mass at the centre of a ball joint, mass on the axis of a revolute joint, the
    second moment on a prismatic joint. Links are regrouped from the leaves to the root; mass that
    reaches the world is dropped.

    Args:
        tree: the tree.
        inertias: inertias of the links about their origins.
        offsets: (3,) origin of each link in its parent; used if the joint does not move it.
    """
    out = list(inertias)
    for i in reversed(range(len(tree.links))):
        link = tree.links[i]
        if link.kind == "free" or out[i].is_zero():
            continue
        if link.kind == "fixed":
            out[i], moved_inertia = BodyInertia.zero(), out[i]
        elif link.kind == "ball":
            out[i], moved_inertia = out[i].without_mass()
        elif link.kind == "revolute":
            out[i], moved_inertia = out[i].without_axis(link.axes[:, 0])
        else:
            out[i], moved_inertia = out[i].without_turning()
        if link.parent != WORLD:
            moved_inertia = moved_inertia.in_parent(symbolic(link.rotation), offsets[i])
            out[link.parent] = out[link.parent] + moved_inertia
    return out


def rotated(R: np.ndarray, A: np.ndarray) -> np.ndarray:
    """R A R^T of a symmetric A (3, 3)."""
    half = R.dot(A)
    out = zeros(3, 3)
    for i in range(3):
        for j in range(i + 1):
            out[i, j] = out[j, i] = dot(half[i], R[j])
    return out


def link_inertia(link: Link, value: Value) -> BodyInertia:
    """The sum of the mass shares of a link; explicit mass, centre and inertia take precedence.

    Args:
        link: the link.
        value: turns a number or parameter into a CasADi scalar.
    """
    m, h, about_origin = ca.SX(0), zeros(3), zeros(3, 3)
    for share in link.mass_shares:
        mass = value(share.amount) * share.volume
        c = symbolic(share.unit.com)
        m = m + mass
        h = h + scaled(mass, c)
        about_origin = about_origin + scaled(
            mass, _second_moment(symbolic(share.unit.inertia)) + np.outer(c, c)
        )
    massless = m.is_zero()
    com = zeros(3) if massless else scaled(1 / m, h)
    about_com = about_origin - scaled(m, np.outer(com, com))
    if link.mass is not None:
        mass = value(link.mass)
        about_com = zeros(3, 3) if massless else scaled(mass / m, about_com)
        m = mass
    if link.com is not None:
        com = symbolic([value(x) for x in link.com])
    if link.inertia is not None:
        xx, yy, zz, xy, xz, yz = (value(x) for x in link.inertia)
        about_com = _second_moment(symbolic([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    return BodyInertia(m, scaled(m, com), about_com + scaled(m, np.outer(com, com)))


def _second_moment(inertia: np.ndarray) -> np.ndarray:
    """J = tr(I)/2 1 - I."""
    out = -inertia
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[i, i] = 0.5 * (inertia[j, j] + inertia[k, k] - inertia[i, i])
    return out
