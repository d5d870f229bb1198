"""Derivatives of contacts in a mode: of their forces and of the rows that they hold.

With u the velocity of the first solid relative to the second at point P, n the normal, t1 and t2
tangents, and U = du/dv_D, a point that

    sticks  holds n.u, t1.u and t2.u          by f = x_n n + x_1 t1 + x_2 t2,
    slides  holds n.u                         by f = x_n (n - mu d),  d = u_T/|u_T|.

An open one holds nothing. Q = U^T f are generalised forces. Tangents turn with the normal and not
about it; d turns with u:  dd = (1 - d d^T) du_T/|u_T|.

x_n, x_1 and x_2 are the parts of the force, u_T is the tangential part of u, and mu the coefficient
of friction; v_D are the dynamic velocities. The gap of two solids is their distance, negative in an
overlap. A link is a body on its joint. A twist is a velocity of a link, linear and angular; a screw
is the twist per unit of one joint velocity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from fantoccini.base import Array, cross, perpendicular, rotation
from fantoccini.dynamics.compiled import Screws, Touch, bracket


class ContactMode(StrEnum):
    """Contact mode of a point that pushes: sticking or sliding."""

    STICK = "stick"
    SLIDE = "slide"


@dataclass(frozen=True, eq=False)
class PointMode:
    """A point that pushes, and its mode.

    Attributes:
        name: names of the two parts, ``foot|floor``.
        pair, feature: indices of the pair and of its point.
        mode: contact mode.
        friction: coefficient of friction mu.
        along: (3,) direction d of sliding, in the world; 0 for sticking points.
        turns: whether d turns with u. Without u_T it has no derivative, and d is constant.
    """

    name: str
    pair: int
    feature: int
    mode: ContactMode
    friction: float
    along: Array
    turns: bool


@dataclass(frozen=True, eq=False)
class HeldPoint(PointMode):
    """A point that pushes in its mode.

    Attributes:
        touch: place of the point, and its derivatives.
        force: (3,) force on the first solid, in the world [N].
        velocity: (3,) velocity u of the first solid relative to the second [m/s].
        closing_rate: d(gap speed)/d(gap) in the normal row [1/s]: 1/dt for fixed steps.
        restitution: restitution in the normal row.
    """

    touch: Touch
    force: Array
    velocity: Array
    closing_rate: float = 0.0
    restitution: float = 0.0

    @property
    def directions(self) -> Array:
        """Unit vectors (k, 3) along which the velocity is held."""
        n = self.touch.normal
        return np.concatenate([n[None], tangents(n)]) if self.mode is ContactMode.STICK else n[None]

    @property
    def pushes(self) -> Array:
        """Force (k, 3) for a unit value of each multiplier."""
        if self.mode is ContactMode.STICK:
            return self.directions
        return self.directions - self.friction * self.along

    @property
    def multipliers(self) -> Array:
        """Multipliers (k,) of the force."""
        return np.asarray(self.directions @ self.force)

    @classmethod
    def in_mode(cls, point: PointMode, touch: Touch, force: Array, velocity: Array) -> HeldPoint:
        """A point with its touch, force and velocity."""
        mode_fields = (
            point.name,
            point.pair,
            point.feature,
            point.mode,
            point.friction,
            point.along,
        )
        return cls(*mode_fields, point.turns, touch, force, velocity)


def tangents(normal: Array) -> Array:
    """Unit vectors (2, 3) across a normal and each other."""
    first_tangent = -perpendicular(normal)
    return np.stack([first_tangent, cross(normal, first_tangent)])


@dataclass(eq=False)
class HeldRows:
    """Rows that points hold, and the forces that hold them.

    Attributes:
        names: names of the points.
        rows: (k, n_vD) derivatives of -u along the held directions.
        forces: (k, n_vD) generalised forces of the multipliers, negated.
        drags: (j, n_vD) factors of friction that turns with the velocity.
    """

    names: str
    rows: Array
    forces: Array
    drags: Array


class ContactRows(HeldRows):
    """Rows and forces of points at a state, with signs as for strings: -u closes.

    Args:
        screws: screws of the links; their accelerations count for :attr:`accelerations`.
        points: points in their modes.
        step: s in du/dacc_D = s U: length of a fixed step [s]; 0 if u is that of the state.
    """

    def __init__(self, screws: Screws, points: Sequence[HeldPoint], step: float):
        self._screws, self._step = screws, step
        self._at = [_MovingPoint(screws, point) for point in points]
        n = screws.n_D
        super().__init__(
            ", ".join(dict.fromkeys(point.name for point in points)),
            _stacked([-at.point.directions @ at.U for at in self._at], n),
            _stacked([-at.point.pushes @ at.U for at in self._at], n),
            _stacked([at.drag(step) for at in self._at], n),
        )
        self.multipliers = np.concatenate([np.zeros(0), *(p.multipliers for p in points)])

    def force_by(self) -> Array:
        """Changes (n_vD, m) of -Q, at fixed multipliers and acc_D."""
        out = np.zeros((self._screws.n_D, self._screws.n_columns))
        for at in self._at:
            out -= at.force_by()
        return out

    def gap_by(self) -> Array:
        """Changes (points, m) of -gap."""
        return _stacked([-at.gap_by[None] for at in self._at], self._screws.n_columns)

    def velocity_by(self) -> Array:
        """Changes (k, m) of -(u_n + closes gap) and of -u_T, at fixed acc_D."""
        return _stacked([at.velocity_by() for at in self._at], self._screws.n_columns)

    def bounce_by(self) -> Array:
        """Changes (k, m) of -e u_n in the normal rows, with the velocities before an impact."""
        return _stacked([at.bounce_by() for at in self._at], self._screws.n_columns)

    def accelerations(self) -> Array:
        """Accelerations -du/dt (k,) along the held directions."""
        return np.concatenate([np.zeros(0), *(at.accelerations() for at in self._at)])

    def acceleration_by(self) -> Array:
        """Changes (k, m) of :meth:`accelerations` at fixed acc_D."""
        return _stacked([at.acceleration_by() for at in self._at], self._screws.n_columns)

    def push_by(self, multiplier_changes: Array, acc_changes: Array) -> Array:
        """Changes (3 points, m) of the forces, in the world.

        Args:
            multiplier_changes: (k, m) changes of the multipliers.
            acc_changes: (n_vD, m) changes of acc_D.
        """
        changes, first = [], 0
        for at in self._at:
            last = first + len(at.point.directions)
            changes.append(
                at.push_by(multiplier_changes[first:last], self._step * at.U @ acc_changes)
            )
            first = last
        return _stacked(changes, self._screws.n_columns)


class _MovingPoint:
    """A point with the changes of P, n, gap and u."""

    def __init__(self, screws: Screws, point: HeldPoint):
        self.screws, self.point = screws, point
        touch = point.touch
        self.P, self.n = touch.point, touch.normal
        a, b = touch.links
        self.U = _at_point(screws.subspace(a) - screws.subspace(b), self.P)
        self._pose_b, self._twist_b = screws.pose_by(b), screws.twist(b)
        self._relative_pose_by = screws.pose_by(a) - self._pose_b  # xi_1 - xi_2
        self._twist = screws.twist(a) - self._twist_b
        self._twist_by = screws.twist_by(a) - screws.twist_by(b)
        changes = touch.by_twist @ self._relative_pose_by
        self.gap_by = changes[0]
        self.P_by = changes[1:4] + _at_point(self._pose_b, self.P)
        self.n_by = changes[4:] + _cross(self._pose_b[3:], self.n)
        self.u = self._twist[:3] + _cross(self._twist[3:], self.P)
        self.u_by = _at_point(self._twist_by, self.P) + _cross(self._twist[3:], self.P_by)

    @property
    def _speed(self) -> float:
        return float(np.linalg.norm(self.u - self.n * (self.n @ self.u)))

    def drag(self, step: float) -> Array:
        """Row z (0 or 1, n_vD) with z^T z acc_D the force from the turning of friction."""
        point, direction = self.point, self.point.along
        if point.mode is ContactMode.STICK or not point.turns or step == 0.0:
            return np.zeros((0, self.screws.n_D))
        factor = point.friction * float(self.n @ point.force) * step / self._speed
        return np.sqrt(factor) * (_cross(self.n, direction) @ self.U)[None]

    def _turned_force(self, u_by: Array) -> Array:
        """Changes (3, m) of f at fixed multipliers for changes of u."""
        n, point = self.n, self.point
        if not point.turns:
            return _cross(_cross(n, self.n_by), point.force)
        direction = point.along
        tangential = u_by - np.outer(n, n @ u_by)
        tangential -= self.n_by * (n @ self.u) + np.outer(n, self.u @ self.n_by)
        direction_by = (tangential - np.outer(direction, direction @ tangential)) / self._speed
        return (n @ point.force) * (self.n_by - point.friction * direction_by)

    def force_by(self) -> Array:
        """Changes (n_vD, m) of Q at fixed multipliers and acc_D."""
        f, screws, (a, b) = self.point.force, self.screws, self.point.touch.links
        f_by = self._turned_force(self.u_by)
        wrench = np.concatenate([f, _cross(self.P, f)])
        wrench_by = np.concatenate([f_by, _cross(self.P_by, f) + _cross(self.P, f_by)])
        return screws.force_by(a, wrench, wrench_by) - screws.force_by(b, wrench, wrench_by)

    def push_by(self, multiplier_changes: Array, extra_u_by: Array) -> Array:
        """Changes (3, m) of f; ``extra_u_by`` are changes of u through acc_D."""
        return self.point.pushes.T @ multiplier_changes + self._turned_force(self.u_by + extra_u_by)

    def velocity_by(self) -> Array:
        out = -self._along_directions(self.u, self.u_by)
        out[0] -= self.point.closing_rate * self.gap_by
        return out

    def bounce_by(self) -> Array:
        out = np.zeros((len(self.point.directions), self.screws.n_columns))
        if self.point.restitution:
            out[0] = -self.point.restitution * self._along_directions(self.u, self.u_by)[0]
        return out

    def _along_directions(self, u: Array, u_by: Array) -> Array:
        """Changes (k, m) of a vector along the held directions, which turn with the normal."""
        n, directions = self.n, self.point.directions
        out = directions @ u_by
        out[0] += u @ self.n_by
        out[1:] -= (n @ u) * (directions[1:] @ self.n_by)
        return out

    def accelerations(self) -> Array:
        _, n_dot, u_dot = self._rates
        directions = self.point.directions
        out = directions @ u_dot
        out[0] += n_dot @ self.u
        out[1:] -= (self.n @ self.u) * (directions[1:] @ n_dot)
        return -out

    @cached_property
    def _rates(self) -> tuple[Array, Array, Array]:
        """Time derivatives of P, n and u."""
        a, b = self.point.touch.links
        rates = self.point.touch.by_twist @ self._twist
        P_dot = rates[1:4] + self._twist_b[:3] + _cross(self._twist_b[3:], self.P)
        n_dot = rates[4:] + _cross(self._twist_b[3:], self.n)
        A = self.screws.acceleration(a) - self.screws.acceleration(b)
        u_dot = A[:3] + _cross(A[3:], self.P) + _cross(self._twist[3:], P_dot)
        return P_dot, n_dot, u_dot

    def acceleration_by(self) -> Array:
        """Changes (k, m) of ``accelerations``."""
        screws, touch, (a, b) = self.screws, self.point.touch, self.point.touch.links
        P_dot, n_dot, u_dot = self._rates
        twist_b_by = screws.twist_by(b)
        # The derivatives by the first link's twist move along with the second link.
        rates_by = touch.rate_by_twist @ self._relative_pose_by + touch.by_twist @ (
            self._twist_by - bracket(self._pose_b.T, self._twist).T
        )
        rates_by[1:4] += _cross(self._pose_b[3:], touch.by_twist[1:4] @ self._twist)
        rates_by[4:] += _cross(self._pose_b[3:], touch.by_twist[4:] @ self._twist)
        P_dot_by = rates_by[1:4] + _at_point(twist_b_by, self.P)
        P_dot_by += _cross(self._twist_b[3:], self.P_by)
        n_dot_by = rates_by[4:] + _cross(twist_b_by[3:], self.n)
        n_dot_by += _cross(self._twist_b[3:], self.n_by)
        A = screws.acceleration(a) - screws.acceleration(b)
        u_dot_by = (
            _at_point(screws.acceleration_by(a) - screws.acceleration_by(b), self.P)
            + _cross(A[3:], self.P_by)
            + _cross(self._twist_by[3:], P_dot)
            + _cross(self._twist[3:], P_dot_by)
        )
        directions, n, u = self.point.directions, self.n, self.u
        out = self._along_directions(u_dot, u_dot_by)
        out[0] += n_dot @ self.u_by + u @ n_dot_by
        # t_dot = -(t.n_dot) n, and t turns with n.
        normal, normal_by = n @ u, n @ self.u_by + u @ self.n_by
        for i, t in enumerate(directions[1:], 1):
            tangent_change = t @ n_dot_by - (t @ self.n_by) * (n @ n_dot)
            out[i] -= (t @ n_dot) * normal_by + normal * tangent_change
        return -out


def _at_point(twist: Array, point: Array) -> Array:
    """Velocities (3, m) at a point from twists (6, m)."""
    return np.asarray(twist[:3] + _cross(twist[3:], point))


def _cross(a: Array, b: Array) -> Array:
    """Cross products a x b of columns (3, m); a or b must be a vector (3,)."""
    return rotation.skew(a) @ b if a.ndim == 1 else -rotation.skew(b) @ a


def _stacked(parts: list[Array], width: int) -> Array:
    return np.concatenate(parts) if parts else np.zeros((0, width))
