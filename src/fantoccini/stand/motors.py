"""Motors and transmissions of a stand's axes: largest torque, and travel per turn.

With gear ratio g and a transmission with travel h per turn, the motor turns by n = 2 pi g / h
radians per metre (or radian) of the axis.

A transmission is the drum, belt or screw between a motor and the driven coordinate: the end or
length of a string, or a joint.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from fantoccini.base import Array
from fantoccini.base.documents import Model, NotNegative, Size, read_real, shown, validation_error
from fantoccini.model.puppet import Count

RAD_PER_TURN = 2.0 * math.pi
"""A turn [rad]."""
CURVE_SCHEMA = {
    "type": "array",
    "minItems": 2,
    "items": {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2},
}


def _torque_curve(value: Any) -> Any:
    """A torque curve: one number, or points [turns per second, N m] of increasing speed."""
    if not isinstance(value, list | tuple):
        number = read_real(value)
        if number <= 0.0:
            raise validation_error(f"found {number:g}; needed: a positive number")
        return ((0.0, number),)
    if len(value) < 2:
        raise validation_error(
            f"found {len(value)} points; needed: a torque, or two points or more"
        )
    points = []
    for point in value:
        if not isinstance(point, list | tuple) or len(point) != 2:
            raise validation_error(f"found {shown(point)}; needed: points [turns per second, N m]")
        points.append((read_real(point[0]), read_real(point[1])))
    if points[0][0] != 0.0:
        raise validation_error(f"the first point is at {points[0][0]:g} turns/s; needed: one at 0")
    for (slow, _), (fast, _) in pairwise(points):
        if not slow < fast:
            raise validation_error(
                f"found {fast:g} turns/s after {slow:g}; needed: speeds that increase"
            )
    for speed, torque in points:
        if torque < 0.0:
            raise validation_error(f"found {torque:g} N m at {speed:g} turns/s; needed: at least 0")
    if points[0][1] <= 0.0:
        raise validation_error("found no torque at rest; needed: a positive one")
    return tuple(points)


Torque = Annotated[
    tuple[tuple[float, float], ...],
    BeforeValidator(_torque_curve),
    WithJsonSchema({"anyOf": [{"type": "number", "exclusiveMinimum": 0}, CURVE_SCHEMA]}),
]
"""A torque [N m], or a curve of points [turns per second, N m]: linear between them, 0 beyond."""


def _torque_at(curve: tuple[tuple[float, float], ...], speed: Array) -> Array:
    points = np.array(curve)
    if len(points) == 1:
        return np.full_like(speed, points[0, 1])
    return np.interp(np.abs(speed) / RAD_PER_TURN, points[:, 0], points[:, 1], right=0.0)


class Stepper(Model):
    """A stepper motor without feedback: beyond its pull-out torque it loses steps."""

    type: Literal["stepper"]
    """Kind of motor."""
    torque: Torque
    """Pull-out torque [N m], or points [turns per second, N m]."""
    steps: Count = 200
    """Full steps per turn."""
    microsteps: Count = 16
    """Microsteps per full step."""
    inertia: Size
    """Moment of inertia of the rotor [kg m^2]."""

    @property
    def counts(self) -> int:
        """Microsteps per turn."""
        return self.steps * self.microsteps

    def max_torque(self, speed: Array, torque: Array) -> Array:
        """(...) largest torques [N m] at speeds [rad/s], for torques with these signs."""
        return _torque_at(self.torque, speed)


class ServoMotor(Model):
    """A motor with feedback whose controller sets its torque, up to a bound."""

    type: Literal["servo"]
    """Kind of motor."""
    torque: Torque
    """Largest torque [N m], or points [turns per second, N m]."""
    counts: Annotated[int, Field(ge=1, le=100_000_000)] = 4096
    """Resolution of its encoder [positions per turn]."""
    inertia: Size
    """Moment of inertia of the rotor [kg m^2]."""

    def max_torque(self, speed: Array, torque: Array) -> Array:
        """(...) largest torques [N m] at speeds [rad/s], for torques with these signs."""
        return _torque_at(self.torque, speed)


class DCMotor(Model):
    """A motor with feedback and back-EMF: torque k i, |i| <= current, |R i + k w| <= voltage."""

    type: Literal["dc"]
    """Kind of motor."""
    constant: Size
    """k: torque per current, voltage per speed [N m/A = V s]."""
    current: Size
    """Largest current [A]."""
    resistance: Size
    """R of the winding [ohm]."""
    voltage: Size
    """Supply voltage [V]."""
    counts: Annotated[int, Field(ge=1, le=100_000_000)] = 4096
    """Resolution of its encoder [positions per turn]."""
    inertia: Size
    """Moment of inertia of the rotor [kg m^2]."""

    def max_torque(self, speed: Array, torque: Array) -> Array:
        """(...) largest torques [N m] at speeds [rad/s], for torques with these signs."""
        signed_speed = np.where(torque * speed >= 0.0, np.abs(speed), -np.abs(speed))
        current = (self.voltage - self.constant * signed_speed) / self.resistance
        return self.constant * np.clip(current, 0.0, self.current)


Motor = Annotated[Stepper | ServoMotor | DCMotor, Field(discriminator="type")]


class Drum(Model):
    """A drum that winds a string in one layer."""

    type: Literal["drum"]
    """Kind of transmission."""
    radius: Size | None = None
    """Radius to the middle of the string [m]."""
    diameter: Size | None = None
    """Twice the radius, given instead of it [m]."""
    inertia: NotNegative = 0.0
    """Moment of inertia of the drum [kg m^2]."""

    def model_post_init(self, context: Any, /) -> None:
        """Raises unless exactly one of radius and diameter is given."""
        if (self.radius is None) == (self.diameter is None):
            raise validation_error("needed: either radius or diameter")

    @property
    def travel_per_turn(self) -> float:
        """Travel per turn [m]."""
        return (
            RAD_PER_TURN * self.radius
            if self.radius is not None
            else math.pi * (self.diameter or 0.0)
        )


class Belt(Model):
    """A toothed belt over a pulley."""

    type: Literal["belt"]
    """Kind of transmission."""
    pitch: Size
    """Distance between teeth [m]."""
    teeth: Annotated[int, Field(ge=4, le=10_000)]
    """Teeth of the pulley."""
    inertia: NotNegative = 0.0
    """Moment of inertia of all pulleys, at the driven one [kg m^2]."""

    @property
    def travel_per_turn(self) -> float:
        """Travel per turn [m]."""
        return self.pitch * self.teeth


class Screw(Model):
    """A lead screw or ball screw."""

    type: Literal["screw"]
    """Kind of transmission."""
    lead: Size
    """Travel per turn [m]."""
    inertia: NotNegative = 0.0
    """Moment of inertia of the screw [kg m^2]."""

    @property
    def travel_per_turn(self) -> float:
        """Travel per turn [m]."""
        return self.lead


class Shaft(Model):
    """The motor, or the gear behind it, turns the joint itself: the axis is an angle."""

    type: Literal["shaft"]
    """Kind of transmission."""
    inertia: NotNegative = 0.0
    """Moment of inertia that turns with the joint and is not in the puppet's file [kg m^2]."""

    @property
    def travel_per_turn(self) -> float:
        """Travel per turn [rad]."""
        return RAD_PER_TURN


Transmission = Annotated[Drum | Belt | Screw | Shaft, Field(discriminator="type")]


def _efficiency(value: float) -> float:
    if not 0.0 < value <= 1.0:
        raise validation_error(f"found {value:g}; needed: a number above 0, up to 1")
    return value


Efficiency = Annotated[
    float,
    BeforeValidator(read_real),
    AfterValidator(_efficiency),
    WithJsonSchema({"type": "number", "exclusiveMinimum": 0, "maximum": 1}),
]


class AxisFriction(Model):
    """Friction torque at the motor: viscous w + coulomb w / sqrt(w^2 + speed^2)."""

    viscous: NotNegative = 0.0
    """Viscous coefficient [N m s]."""
    coulomb: NotNegative = 0.0
    """Coulomb friction [N m]."""
    speed: Size = 0.05
    """Speed at which Coulomb friction is 0.7 of its full value [rad/s]."""
