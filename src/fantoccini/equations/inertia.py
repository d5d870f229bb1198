"""Inertia of a link from its shapes and its explicit values.

A link's inertia about its own origin is kept as (m, h, I): the mass, the first moment h = m c and
the rotational inertia about the origin, I = I_c + m (c.c 1 - c c^T).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from fantoccini.equations.algebra import cross, dot, scaled, symbolic, zeros
from fantoccini.puppet import Number
from fantoccini.tree import Link

Value = Callable[[Number], ca.SX]


@dataclass(frozen=True)
class BodyInertia:
    """Spatial inertia about a frame's origin.

    Attributes:
        m: mass [kg].
        h: (3,) first moment m c [kg m].
        I: (3, 3) rotational inertia about the origin [kg m^2].
    """

    m: ca.SX
    h: np.ndarray
    I: np.ndarray  # noqa: E741 the field's symbol

    def __add__(self, other: BodyInertia) -> BodyInertia:
        return BodyInertia(self.m + other.m, self.h + other.h, self.I + other.I)

    def is_zero(self) -> bool:
        """True when nothing here has mass or inertia."""
        return all(ca.SX(x).is_zero() for x in (self.m, *self.h.flat, *self.I.flat))

    def momentum(self, omega: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(I w + h x v, m v - h x w): angular and linear momentum about the origin."""
        return self.I.dot(omega) + cross(self.h, v), scaled(self.m, v) - cross(self.h, omega)

    def in_parent(self, R: np.ndarray, r: np.ndarray) -> BodyInertia:
        """The same inertia about the parent's origin, with pose (R, r) of the link in the parent.

        I' = R I R^T + r.(h + h') 1 - h r^T - r h'^T, with h and h' = h + m r in parent's axes.
        """
        h = R.dot(self.h)
        moved = h + scaled(self.m, r)
        half = R.dot(self.I)
        trace = dot(r, h + moved)
        out = zeros(3, 3)
        for i in range(3):
            for j in range(i + 1):
                entry = dot(half[i], R[j]) - h[i] * r[j] - r[i] * moved[j]
                out[i, j] = out[j, i] = entry + trace if i == j else entry
        return BodyInertia(self.m, moved, out)


def link_inertia(link: Link, value: Value) -> BodyInertia:
    """The sum of a link's lumps, with the explicit mass, centre and inertia in their place.

    Args:
        link: the link.
        value: turns a number or parameter into a CasADi scalar.
    """
    m, h, about_origin = ca.SX(0), zeros(3), zeros(3, 3)
    for lump in link.lumps:
        mass = value(lump.amount) * lump.volume
        c = symbolic(lump.unit.com)
        m = m + mass
        h = h + scaled(mass, c)
        about_origin = about_origin + scaled(
            mass, symbolic(lump.unit.inertia) + _steiner(c)
        )
    massless = m.is_zero()
    com = zeros(3) if massless else scaled(1 / m, h)
    about_com = about_origin - scaled(m, _steiner(com))
    if link.mass is not None:
        mass = value(link.mass)
        about_com = zeros(3, 3) if massless else scaled(mass / m, about_com)
        m = mass
    if link.com is not None:
        com = symbolic([value(x) for x in link.com])
    if link.inertia is not None:
        xx, yy, zz, xy, xz, yz = (value(x) for x in link.inertia)
        about_com = symbolic([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return BodyInertia(m, scaled(m, com), about_com + scaled(m, _steiner(com)))


def _steiner(c: np.ndarray) -> np.ndarray:
    """c.c 1 - c c^T."""
    out = zeros(3, 3)
    square = dot(c, c)
    for i, j in np.ndindex(3, 3):
        out[i, j] = (square if i == j else 0.0) - c[i] * c[j]
    return out
