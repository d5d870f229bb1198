"""Drives: reflected inertia, friction, and the forces of motors.

n is the rotor angle per unit of the coordinate q, for example g / r for a gear ratio g and a drum
of radius r. A rotor of inertia J and a carriage of mass m add m + n^2 J to the diagonal of M_DD.
For the command r, with the error e = r - q, edot = rdot - v, the force f is

    PD               f = k e + d edot
    computed torque  f = [M_MM a + c] + friction,  a = rddot + 2 zeta w edot + w^2 e
    stepper          f = n T sin(s/4 (angle(r) - n q)),  angle(r) in whole microsteps
    servo            |f| <= n T
    direct current   f = n k i,  |i| <= I,  |R i + k n v| <= U

The index M stands for the coordinates with computed torque. c is the force that gravity, velocities
and driven coordinates require for acc_M = a, with other dynamic accelerations 0 and without
strings. The error of an orientation is 2 e_w (e_x, e_y, e_z) with the quaternion e from q to r, in
the body's frame, so that k phi restores a small rotation phi.

Over a step dt, drives are implicit like the damping of joints: f is evaluated for the error
e + dt edot, and its derivative by the step's acceleration is added to the diagonal of M_DD,

    armature = m + n^2 J + dt (d + friction / v) + dt^2 k

so that drives of any stiffness are stable. If computed torque couples several coordinates, M is
replaced here by the diagonal of its row sums of |M|, which is an upper bound. At its voltage bound
a motor's force has the derivative (n k)^2 / R. dt = 0 gives the exact equations.

A drive moves a driven coordinate by a motor towards its command. k is here the stiffness of a
controller or the motor constant, d the damping, T the largest torque, s the steps per turn, i the
current with its bound I, and U the largest voltage. A link is a body on its joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from fantoccini.kernel.equations import dynamics
from fantoccini.kernel.equations.algebra import (
    REGULAR,
    cross,
    dot,
    elements,
    quaternion_rotation,
    scaled,
    symbolic,
    zeros,
)
from fantoccini.kernel.equations.inertia import Value
from fantoccini.kernel.equations.system import System
from fantoccini.model.puppet import PD, ComputedTorque, Servo, StepperMotor
from fantoccini.model.tree import DriveRow, Role


@dataclass(frozen=True)
class DriveForces:
    """Forces of all drives over a step.

    Attributes:
        f_D: (n_vD,) forces of the motors if the velocity does not change in the step [N or N m].
        velocity_slopes: (n_vD,) decrease of f_D per change of velocity over the step [N s/m or
            N m s].
        armature: (n_vD,) terms that the step adds to the diagonal of M_DD, besides inertia.
    """

    f_D: np.ndarray
    velocity_slopes: np.ndarray
    armature: np.ndarray


def forces(system: System, dt: ca.SX) -> DriveForces:
    """Forces of the motors over a step dt; dt = 0 for the exact equations."""
    n = system.tree.coordinates.n_vD
    f_D, velocity_slopes, friction = zeros(n), zeros(n), zeros(n)
    controllers = _Controllers(system, dt)
    v_D = elements(system.symbols.v_D)
    for row in system.tree.drives:
        force, stiffness, damping = controllers.force(row)
        force, torque_ratio, back_emf_slope = _limit_force(row, force, v_D[row.v], system.value)
        f_D[row.v] = force
        n = len(force)
        velocity_slopes[row.v] = scaled(torque_ratio, damping + scaled(dt, stiffness)) + _repeated(
            back_emf_slope, n
        )
        friction[row.v] = _repeated(system.resistance(row), n)
    return DriveForces(f_D, velocity_slopes, scaled(dt, velocity_slopes + friction))


def motor_lags(system: System) -> dict[str, np.ndarray]:
    """The results of ``motor_lags``: lags of watched drives behind their commands.

    ``angle`` and ``command`` are positions [m or rad]; for an orientation, ``angle`` is its angle
    from
    its command, and ``command`` is 0. ``lag`` is in periods of four full steps of a stepper motor,
    which holds at most half a period.
    """
    s, entries = system.symbols, []
    for row in system.tree.watched:
        q, actual, lag = _command_indices(row)[0], elements(s.q_D)[row.q], ca.SX(0)
        if row.is_rotation:
            target = elements(s.q_K)[q : q + 4]
            vector = _vector_part(actual, target)
            sine = ca.sqrt(dot(vector, vector) + REGULAR.square)
            cosine = ca.sqrt(dot(actual, target) ** 2 + REGULAR.square)
            angle, command = 2 * ca.atan(sine / cosine), ca.SX(0)
        else:
            angle, command = actual[0], s.q_K[q]
        motor = row.drive.motor
        if isinstance(motor, StepperMotor):
            periods = _pole_pairs(system, row, motor) / (2 * np.pi) * row.ratio(system.value)
            lag = periods * (command - angle)
        entries.append((angle, command, lag))
    columns = zip(*entries, strict=True) if entries else ((), (), ())
    return {n: symbolic(list(c)) for n, c in zip(("at", "command", "lag"), columns, strict=True)}


def available_shares(system: System) -> np.ndarray:
    """Share of the demanded force that the motor of each watched drive can exert, at most 1."""
    controllers, v_D = _Controllers(system, ca.SX(0)), elements(system.symbols.v_D)
    out = []
    for row in system.tree.watched:
        force, _, _ = controllers.force(row)
        out.append(_limit_force(row, force, v_D[row.v], system.value)[1])
    return symbolic(out)


def demanded_forces(system: System) -> np.ndarray:
    """(n_vD,) forces that controllers demand, without the bounds of motors [N or N m]."""
    controllers, f_D = _Controllers(system, ca.SX(0)), zeros(system.tree.coordinates.n_vD)
    for row in system.tree.drives:
        f_D[row.v] = controllers.force(row)[0]
    return f_D


def _command_indices(row: DriveRow) -> tuple[int, int]:
    """Indices of a drive's command in q_K and v_K."""
    assert row.command is not None, "the drive has no command"
    return row.command


def _pole_pairs(system: System, row: DriveRow, motor: StepperMotor) -> float:
    """Periods of a stepper motor's torque per turn; of a linear one 2 pi times those per metre."""
    pairs = motor.steps / 4
    return 2 * np.pi * pairs if _is_linear(system, row) else pairs


def _is_linear(system: System, row: DriveRow) -> bool:
    """Whether a motor is linear: its coordinate is in metres, and it has no drum."""
    return row.drive.drum is None and system.tree.links[row.link].kind != "revolute"


class _Controllers:
    """Forces that controllers demand, without the bounds of motors.

    Args:
        system: the equations.
        dt: step over which the controllers are implicit.
    """

    def __init__(self, system: System, dt: ca.SX):
        self.system, self.dt = system, dt
        s = system.symbols
        self.v_D, self.q_D = elements(s.v_D), elements(s.q_D)
        self.q_K, self.v_K, self.acc_K = (elements(x) for x in (s.q_K, s.v_K, s.acc_K))
        self.computed_torque = self._inverse_dynamics()

    def force(self, row: DriveRow) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Force at the coordinate, and its derivatives by the error and by the error's rate."""
        value, control, zero = self.system.value, row.drive.control, zeros(row.v.stop - row.v.start)
        if row.command is None:
            return zero, zero, zero
        if isinstance(row.drive.motor, StepperMotor):
            return self._stepper(row, row.drive.motor)
        if isinstance(control, PD):
            error, rate, _ = self._error(row)
            k, d = value(control.stiffness), value(control.damping)
            return (
                scaled(k, error) + scaled(d, rate),
                _repeated(k, len(zero)),
                _repeated(d, len(zero)),
            )
        assert control is not None, "a command is followed by a stepper motor or a controller"
        w, zeta = value(control.bandwidth), value(control.damping_ratio)
        inertia = self.inertia[row.v]
        return self.computed_torque[row.v], scaled(w * w, inertia), scaled(2 * zeta * w, inertia)

    def _error(self, row: DriveRow) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """e and edot at the end of the step, and rddot; for an orientation in the body's frame.

        Over a step v_K is the command's mean velocity and acc_K its mean acceleration.
        """
        q, v = _command_indices(row)
        actual, w = self.q_D[row.q], self.v_D[row.v]
        n = row.v.stop - row.v.start
        mean, acceleration = self.v_K[v : v + n], self.acc_K[v : v + n]
        final_rate = mean + scaled(0.5 * self.dt, acceleration)
        if not row.is_rotation:
            error = self.q_K[q : q + 1] - actual + scaled(self.dt, mean - w)
            return error, final_rate - w, acceleration
        target = self.q_K[q : q + 4]
        scalar = dot(actual, target)
        vector = _vector_part(actual, target)
        R = quaternion_rotation(np.concatenate([[scalar], vector]))
        error = scaled(2 * scalar, vector) + scaled(self.dt, R.dot(mean) - w)
        return error, R.dot(final_rate) - w, R.dot(acceleration)

    def _inverse_dynamics(self) -> np.ndarray:
        """(n_vD,) forces of computed torque for the error at the end of the step."""
        system, tree = self.system, self.system.tree
        acc, is_used = zeros(tree.coordinates.n_vD), False
        for row in tree.drives:
            control = row.drive.control
            if not isinstance(control, ComputedTorque):
                continue
            is_used = True
            w, zeta = system.value(control.bandwidth), system.value(control.damping_ratio)
            error, rate, acceleration = self._error(row)
            acc[row.v] = acceleration + scaled(2 * zeta * w, rate) + scaled(w * w, error)
        if not is_used:
            return acc
        motions = system.motions(self.v_D, self.v_K, acc, self.acc_K)
        wrenches = dynamics.link_wrenches(system.regrouped, motions)
        joint_forces = dynamics.joint_forces(tree, system.joints, wrenches)
        f_D = system.by_velocity(joint_forces)[0] + system.armature * acc
        for row in tree.drives:
            f_D[row.v] += scaled(system.resistance(row), self.v_D[row.v])
        return f_D

    @cached_property
    def inertia(self) -> np.ndarray:
        """(n_vD,) row sums of |M|, over the coordinates with computed torque."""
        sums, links = self.system.armature.copy(), self.system.tree.links
        rows = [d for d in self.system.tree.drives if isinstance(d.drive.control, ComputedTorque)]
        controlled = {k for row in rows for k in range(row.v.start, row.v.stop)}
        for (i, j), block in self.system.mass_blocks.items():
            for a, b in np.ndindex(block.shape):
                k, m = links[j].v.start + a, links[i].v.start + b
                dynamic = links[i].role is links[j].role is Role.DYNAMIC
                entry: Any = block[a, b]
                if not dynamic or not {k, m} <= controlled or entry.is_zero():
                    continue
                magnitude = entry if k == m else ca.sqrt(entry**2 + REGULAR.square)
                sums[k] = sums[k] + magnitude
                if i != j:
                    sums[m] = sums[m] + magnitude
        return sums

    def _stepper(
        self, row: DriveRow, motor: StepperMotor
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Force n T sin(s/4 (angle(r) - n q)) and its derivatives; see :meth:`force`."""
        value, (q, v) = self.system.value, _command_indices(row)
        n, pairs = row.ratio(value), _pole_pairs(self.system, row, motor)
        distance_per_turn = 1.0 if _is_linear(self.system, row) else 2 * np.pi
        microstep = distance_per_turn / (motor.steps * motor.microsteps)
        command, q_index = self.q_K[q] + self.dt * self.v_K[v], row.q.start
        angle = microstep * ca.floor(n * command / microstep + 0.5)
        torque = value(motor.torque)
        if motor.corner_speed is not None:
            corner = value(motor.corner_speed)
            speed = ca.sqrt((n * self.v_K[v]) ** 2 + REGULAR.square)
            torque = torque * ca.fmin(1, corner / ca.fmax(speed, corner))
        lag = pairs * (angle - n * (self.q_D[q_index] + self.dt * self.v_D[row.v.start]))
        stiffness = n * n * torque * pairs * ca.fmax(ca.cos(lag), 0)
        return symbolic([n * torque * ca.sin(lag)]), symbolic([stiffness]), zeros(1)


def _limit_force(
    row: DriveRow, force: np.ndarray, v: np.ndarray, value: Value
) -> tuple[np.ndarray, ca.SX, ca.SX]:
    """Limits a demanded force to the bounds of the motor.

    Returns:
        The force; its derivative by the demanded one (1 within the bounds); and -d force/dv of a
        motor at its voltage bound.
    """
    motor, zero = row.drive.motor, ca.SX(0)
    if motor is None or isinstance(motor, StepperMotor):
        return force, ca.SX(1), zero
    n = row.ratio(value)
    if isinstance(motor, Servo):
        limit = n * value(motor.torque)
        if row.is_rotation:
            size = ca.sqrt(dot(force, force) + REGULAR.square)
            ratio = limit / ca.fmax(size, limit)
            return scaled(ratio, force), ratio, zero
        clipped = _clipped(force[0], -limit, limit)
        return symbolic([clipped]), _equality(force[0], clipped, limit), zero
    gain = n * value(motor.constant)
    limit, R = gain * value(motor.current), value(motor.resistance)
    stall, back_emf = gain * value(motor.voltage) / R, gain * gain / R * v[0]
    by_current = _clipped(force[0], -limit, limit)
    by_both = _clipped(by_current, -stall - back_emf, stall - back_emf)
    # Above its no-load speed the motor brakes, at most with the largest current.
    exerted = _clipped(by_both, -limit, limit)
    at_voltage = (1 - _equality(by_current, by_both, limit)) * _equality(by_both, exerted, limit)
    return symbolic([exerted]), _equality(force[0], exerted, limit), at_voltage * gain * gain / R


def _vector_part(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(3,) vector part of the quaternion from one orientation to another."""
    return scaled(p[0], q[1:]) - scaled(q[0], p[1:]) - cross(p[1:], q[1:])


def _repeated(x: ca.SX, n: int) -> np.ndarray:
    """(n,) n times x."""
    return symbolic([x] * n)


def _clipped(x: ca.SX, lower: ca.SX, upper: ca.SX) -> ca.SX:
    return ca.fmax(lower, ca.fmin(upper, x))


def _equality(a: ca.SX, b: ca.SX, size: ca.SX) -> ca.SX:
    """1 if a equals b, 0 if they differ, with a smooth transition."""
    return ca.fmax(0, 1 - ((a - b) / (REGULAR.same * size)) ** 2)
