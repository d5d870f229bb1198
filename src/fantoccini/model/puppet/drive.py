"""Drives: rotor, motor and controller of a driven coordinate.

A drive has a rotor (or a slider) with inertia, friction, a motor with bounds, and a controller that
follows a command. With gear ratio g and drum radius r the rotor turns by n = g / r per metre of the
coordinate, or by n = g per radian. Quantities of the rotor and the motor are given at the rotor;
the factor n, or n^2 for the inertia, transforms them to the coordinate.

A driven coordinate is an end or length of a string, or a driven joint; with a drive its command is
given as a function of time. w is the speed of the rotor and q the coordinate.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema, model_validator

from fantoccini.base.documents import Model, shown, validation_error
from fantoccini.model.puppet.limits import LIMITS
from fantoccini.model.puppet.quantities import (
    Damping,
    Electric,
    Force,
    LengthNumber,
    NotNegativeRatio,
    PositiveForce,
    PositiveMass,
    PositiveStiffness,
    Ratio,
    RotorInertia,
    Speed,
)


class Friction(Model):
    """Friction torque at the rotor: -viscous w - coulomb w / sqrt(w^2 + speed^2)."""

    viscous: Damping = 0.0
    """Viscous coefficient [N m s], or [N s/m] without a drum."""
    coulomb: Force = 0.0
    """Coulomb friction [N m], or [N] without a drum."""
    speed: Speed = 0.05
    """Speed at which Coulomb friction is 0.7 of its full value [rad/s], or [m/s] without a drum."""


class Servo(Model):
    """A motor that gives the torque its controller demands, within a bound."""

    type: Literal["servo"]
    """Kind of motor."""
    torque: PositiveForce
    """Largest torque [N m], or force without a drum [N]."""


class DirectCurrent(Model):
    """A motor with back-EMF: torque k i, |i| <= current, |R i + k w| <= voltage."""

    type: Literal["dc"]
    """Kind of motor."""
    constant: Electric
    """k: torque per current, voltage per speed [N m/A = V s]."""
    current: Electric
    """Largest current [A]."""
    resistance: Electric
    """R of the winding [ohm]."""
    voltage: Electric
    """Supply voltage [V]."""


def _count(value: Any) -> int:
    max_count = LIMITS.max_motor_steps
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= max_count:
        raise validation_error(
            f"found {shown(value)}; needed: a whole number from 1 to {max_count}"
        )
    return value


Count = Annotated[
    int,
    BeforeValidator(_count),
    WithJsonSchema({"type": "integer", "minimum": 1, "maximum": LIMITS.max_motor_steps}),
]


class StepperMotor(Model):
    """A stepper motor: torque T sin((steps/4) (command - angle)), the command in whole microsteps.

    T is the holding torque up to the corner speed and falls as 1 / speed above it. A larger load
    pulls the motor out of step.
    """

    type: Literal["stepper"]
    """Kind of motor."""
    torque: PositiveForce
    """Holding torque [N m], or force without a drum [N]."""
    steps: Count = 200
    """Full steps per turn, or per metre without a drum."""
    microsteps: Count = 16
    """Microsteps per full step; the command is rounded to whole ones."""
    corner_speed: Speed | None = None
    """Commanded speed above which the torque falls [rad/s], or [m/s] without a drum."""


class PD(Model):
    """Demanded force: stiffness (command - q) + damping (d command/dt - v)."""

    type: Literal["pd"]
    """Kind of controller."""
    stiffness: PositiveStiffness
    """Stiffness at the coordinate [N/m or N m/rad]."""
    damping: Damping
    """Damping at the coordinate [N s/m or N m s/rad]."""


class ComputedTorque(Model):
    """Force for which the error of q decays as e'' + 2 zeta w e' + w^2 e = 0.

    It is computed from the inverse dynamics with inertia, load, gravity and friction, without the
    tension of strings and the accelerations of joints without drives.
    """

    type: Literal["computed_torque"]
    """Kind of controller."""
    bandwidth: Ratio
    """Bandwidth w [rad/s]."""
    damping_ratio: NotNegativeRatio = 1.0
    """Damping ratio zeta."""


Motor = Annotated[Servo | DirectCurrent | StepperMotor, Field(discriminator="type")]
Control = Annotated[PD | ComputedTorque, Field(discriminator="type")]


def _as_list(value: Any) -> Any:
    if not isinstance(value, str | list | tuple):
        raise validation_error(
            f"found {shown(value)}; needed: a driven coordinate, or a list of them"
        )
    return [value] if isinstance(value, str) else value


def _not_empty(names: tuple[str, ...]) -> tuple[str, ...]:
    if not names:
        raise validation_error("found an empty list; needed: one or more driven coordinates")
    return names


_Names = Annotated[
    tuple[str, ...],
    BeforeValidator(_as_list),
    AfterValidator(_not_empty),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "string"},
                {"type": "array", "items": {"type": "string"}, "minItems": 1},
            ]
        }
    ),
]


class Drive(Model):
    """Makes driven coordinates dynamic, moved by a motor."""

    on: _Names
    """Driven coordinates, such as `hand.length`, `bar.x`, `bar.rotation`; one drive for each."""
    mass: PositiveMass | None = None
    """Mass of a carriage that moves with a coordinate in metres [kg]; it has no weight."""
    inertia: RotorInertia | None = None
    """Moment of inertia of the rotor [kg m^2]."""
    gear: Ratio = 1.0
    """Turns of the rotor per turn of the drum or joint."""
    drum: LengthNumber | None = None
    """Radius of the drum or pinion that moves a coordinate in metres [m]."""
    friction: Friction | None = None
    """Friction in the rotor's bearings and the gear."""
    motor: Motor | None = None
    """Motor, which bounds the torque; without a motor it is unbounded."""
    control: Control | None = None
    """Controller that follows the command; without one only user forces move the rotor."""

    @model_validator(mode="after")
    def _check_parts(self) -> Drive:
        if self.mass is None and self.inertia is None:
            raise validation_error("needed: mass, inertia or both; otherwise leave the drive out")
        is_stepper = isinstance(self.motor, StepperMotor)
        if is_stepper and self.control is not None:
            raise validation_error(
                "found control and a stepper; a stepper follows its command by itself"
            )
        if self.motor is not None and not is_stepper and self.control is None:
            raise validation_error(
                "found a motor without control; needed: control, to follow a command"
            )
        return self

    @property
    def follows(self) -> bool:
        """Whether the drive has a command."""
        return self.control is not None or isinstance(self.motor, StepperMotor)


def drive_misfits(drive: Drive, name: str, unit: str) -> Iterator[tuple[tuple[str, ...], str]]:
    """Mistakes of a drive that does not suit its coordinate: key in the drive, and message.

    Args:
        drive: drive to check.
        name: name of the coordinate.
        unit: unit of the coordinate: ``m``, ``rad``, or ``rotation`` for an orientation.
    """
    has_rotor, has_drum = drive.inertia is not None, drive.drum is not None
    if unit != "m":
        for key in ("mass", "drum"):
            if getattr(drive, key) is not None:
                yield (key,), f"{name} turns; allowed: inertia and gear, but not {key}"
    elif has_rotor and not has_drum:
        yield ("inertia",), f"{name} is a length; needed: the drum that the rotor turns"
    elif has_drum and not has_rotor:
        yield ("drum",), "found a drum without a rotor; needed: its inertia"
    if unit == "rotation" and drive.motor is not None and drive.motor.type in ("dc", "stepper"):
        yield ("motor", "type"), f"{name} turns about three axes; needed: a servo, or no motor"
