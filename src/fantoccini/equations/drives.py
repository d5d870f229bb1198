"""Drives: reflected inertia, friction, and the forces of motors.

With n rotor turns per unit of the coordinate q (a gear g on a drum of radius r: n = g / r), a rotor
of inertia J and a carriage of mass m put m + n^2 J on the diagonal of M_DD. The motor follows the
command r by the error e = r - q, edot = rdot - v:

    PD               f = k e + d edot
    computed torque  f = [M_MM a + c + friction],  a = rddot + 2 zeta w edot + w^2 e
    stepper          f = n T sin(s/4 (angle(r) - n q)),  angle(r) in whole microsteps
    servo            |f| <= n T
    direct current   f = n k i,  |i| <= I,  |R i + k n v| <= U

c is what gravity, velocities and the driven coordinates need of the mechanism, at acc_M = a and
acc_D = 0 elsewhere; strings are not in it. Orientations have the error 2 e_w (e_x, e_y, e_z) of the
quaternion from q to r, in the body's frame, so that k phi pulls back a small turn phi.

Over a step dt drives act implicitly, like the damping of joints: f is taken at the error to come,
e + dt edot, and what the step's own acceleration changes of it is put on the diagonal of M_DD,

    armature = m + n^2 J + dt (d + friction / v) + dt^2 k

which leaves nothing to be unstable however stiff a drive is. dt = 0 gives the exact equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from fantoccini.equations import dynamics
from fantoccini.equations.algebra import (
    cross,
    dot,
    elements,
    quaternion_rotation,
    scaled,
    symbolic,
    zeros,
)
from fantoccini.puppet import PD, ComputedTorque, DirectCurrent, Number, Stepper
from fantoccini.tree import DriveRow

if TYPE_CHECKING:
    from fantoccini.equations.system import System

_STILL = 1e-300
"""Added to squares under a root, so that its derivative at 0 is 0."""


@dataclass(frozen=True)
class DriveForces:
    """What all drives do over a step.

    Attributes:
        f_D: (n_vD,) forces of the motors [N or N m].
        armature: (n_vD,) what the step puts on the diagonal of M_DD, over the drives' inertia.
    """

    f_D: np.ndarray
    armature: np.ndarray


def ratio(row: DriveRow, value) -> ca.SX:
    """n: turns of the rotor [rad] per unit of the coordinate."""
    gear = value(row.drive.gear)
    return gear if row.drive.drum is None else gear / value(row.drive.drum)


def inertia(row: DriveRow, value) -> ca.SX:
    """m + n^2 J: what resists an acceleration of the coordinate [kg or kg m^2]."""

    def own(number: Number | None) -> ca.SX:
        return ca.SX(0) if number is None else value(number)

    n = ratio(row, value)
    return own(row.drive.mass) + own(row.drive.inertia) * n * n


def resistance(row: DriveRow, v: np.ndarray, value) -> ca.SX:
    """Friction over speed, at the coordinate: -resistance v is its force [N s/m or N m s]."""
    friction = row.drive.friction
    if friction is None:
        return ca.SX(0)
    n = ratio(row, value)
    found = n * n * value(friction.viscous)
    coulomb = value(friction.coulomb)
    if coulomb.is_zero():
        return found
    speed = value(friction.speed)
    return found + n * n * coulomb / ca.sqrt(n * n * dot(v, v) + speed * speed)


def forces(system: System, dt: ca.SX) -> DriveForces:
    """Forces of the motors at the system's symbols, over a step dt."""
    n = system.tree.coordinates.n_vD
    f_D, armature = zeros(n), zeros(n)
    wanted = _Wanted(system, dt)
    v_D = elements(system.symbols.v_D)
    for row in system.tree.drives:
        force, stiffness, damping = wanted.of(row)
        force, share = _bounded(row, force, v_D[row.v], system.value)
        f_D[row.v] = force
        slope = share * (damping + dt * stiffness) + resistance(row, v_D[row.v], system.value)
        armature[row.v] = scaled(slope * dt, symbolic(np.ones(len(force))))
    return DriveForces(f_D, armature)


class _Wanted:
    """What controllers want, before the motors' bounds.

    Args:
        system: whose symbols it is in.
        dt: step over which it is implicit.
    """

    def __init__(self, system: System, dt: ca.SX):
        self.system, self.dt = system, dt
        s = system.symbols
        self.v_D, self.q_D = elements(s.v_D), elements(s.q_D)
        self.q_K, self.v_K, self.acc_K = (elements(x) for x in (s.q_K, s.v_K, s.acc_K))
        self.needed = self._inverse_dynamics()

    def of(self, row: DriveRow) -> tuple[np.ndarray, ca.SX, ca.SX]:
        """Force, and its slopes by the error and the error's rate, at the coordinate."""
        none, value, drive = ca.SX(0), self.system.value, row.drive
        if row.command is None:
            return zeros(row.v.stop - row.v.start), none, none
        error, rate, _ = self._error(row)
        late = error + scaled(self.dt, rate)
        if isinstance(drive.motor, Stepper):
            return self._stepper(row)
        if isinstance(drive.control, PD):
            k, d = value(drive.control.stiffness), value(drive.control.damping)
            return scaled(k, late) + scaled(d, rate), k, d
        w, zeta = value(drive.control.bandwidth), value(drive.control.damping_ratio)
        own = self._own_inertia(row)
        return self.needed[row.v], own * w * w, 2 * own * zeta * w

    def _error(self, row: DriveRow) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """e, edot and rddot of a drive; of an orientation in the body's frame."""
        q, v = row.command
        own, w = self.q_D[row.q], self.v_D[row.v]
        if not row.turns:
            at, rate = self.q_K[q : q + 1], self.v_K[v : v + 1]
            return at - own, rate - w, self.acc_K[v : v + 1]
        there, w_there = self.q_K[q : q + 4], self.v_K[v : v + 3]
        scalar = dot(own, there)
        vector = scaled(own[0], there[1:]) - scaled(there[0], own[1:]) - cross(own[1:], there[1:])
        R = quaternion_rotation(np.concatenate([[scalar], vector]))
        return scaled(2 * scalar, vector), R.dot(w_there) - w, R.dot(self.acc_K[v : v + 3])

    def _inverse_dynamics(self) -> np.ndarray:
        """(n_vD,) forces that computed torque asks of its drives, at the error to come."""
        system, tree = self.system, self.system.tree
        acc, some = zeros(tree.coordinates.n_vD), False
        for row in tree.drives:
            control = row.drive.control
            if not isinstance(control, ComputedTorque):
                continue
            some = True
            w, zeta = system.value(control.bandwidth), system.value(control.damping_ratio)
            error, rate, curve = self._error(row)
            late = error + scaled(self.dt, rate)
            acc[row.v] = curve + scaled(2 * zeta * w, rate) + scaled(w * w, late)
        if not some:
            return acc
        motions = system.motions(self.v_D, self.v_K, acc, self.acc_K)
        wrenches = dynamics.link_wrenches(system.regrouped, motions)
        found = dynamics.joint_forces(tree, system.joints, wrenches)
        needed = system.by_velocity(found)[0] + system.armature * acc
        for row in tree.drives:
            needed[row.v] += scaled(
                resistance(row, self.v_D[row.v], system.value), self.v_D[row.v]
            )
        return needed

    def _own_inertia(self, row: DriveRow) -> ca.SX:
        """The diagonal of M at the drive: its own inertia and that of what it carries."""
        M = self.system.mass_blocks.get((row.link, row.link))
        own = self.system.armature[row.v.start]
        if M is None:
            return own
        k = row.v.start - self.system.tree.links[row.link].v.start
        return own + M[k, k]

    def _stepper(self, row: DriveRow) -> tuple[np.ndarray, ca.SX, ca.SX]:
        """n T sin(s/4 (angle(r) - n q)) with angle(r) in whole microsteps."""
        motor, value = row.drive.motor, self.system.value
        q, v = row.command
        n, pairs = ratio(row, value), motor.steps / 4
        micro = 2 * np.pi / (motor.steps * motor.microsteps)
        if row.drive.drum is None and self.system.tree.links[row.link].kind != "revolute":
            pairs, micro = 2 * np.pi * pairs, 1.0 / (motor.steps * motor.microsteps)
        coming, own = self.q_K[q] + self.dt * self.v_K[v], row.q.start
        angle = micro * ca.floor(n * coming / micro + 0.5)
        torque = value(motor.torque)
        if motor.corner_speed is not None:
            corner = value(motor.corner_speed)
            speed = ca.sqrt((n * self.v_K[v]) ** 2 + _STILL)
            torque = torque * ca.fmin(1, corner / ca.fmax(speed, corner))
        lag = pairs * (angle - n * (self.q_D[own] + self.dt * self.v_D[row.v.start]))
        stiffness = n * n * torque * pairs * ca.fmax(ca.cos(lag), 0)
        return symbolic([n * torque * ca.sin(lag)]), stiffness, ca.SX(0)


def _bounded(
    row: DriveRow, force: np.ndarray, v: np.ndarray, value
) -> tuple[np.ndarray, ca.SX]:
    """A force within the motor's bounds, and 1 where it is, 0 where the bounds decide."""
    motor = row.drive.motor
    if motor is None or isinstance(motor, Stepper):
        return force, ca.SX(1)
    n = ratio(row, value)
    if row.turns:
        most = n * value(motor.torque)
        size = ca.sqrt(dot(force, force) + _STILL)
        share = most / ca.fmax(size, most)
        return scaled(share, force), share
    if isinstance(motor, DirectCurrent):
        k, least_current = value(motor.constant), -value(motor.current)
        R, U, back = value(motor.resistance), value(motor.voltage), k * n * v[0]
        high = ca.fmin(-least_current, (U - back) / R)
        low = ca.fmax(least_current, (-U - back) / R)
        # Beyond the speed without load the winding brakes, at most with the largest current.
        high = ca.fmax(high, least_current) * n * k
        low = ca.fmin(low, -least_current) * n * k
    else:
        high = n * value(motor.torque)
        low = -high
    held = ca.fmax(low, ca.fmin(high, force[0]))
    return symbolic([held]), ca.fmax(0, 1 - ca.fabs(force[0] - held) / (1e-12 * (high - low)))
