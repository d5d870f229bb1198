"""Joints: their place on the parent body, coordinates, springs and limits.

A driven joint is moved by the inputs. Swing-twist divides a rotation into one about the axis
(twist) and one that tilts it (swing).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from fantoccini.base.documents import (
    Axes,
    Direction,
    Model,
    Orientation,
    PartName,
    validation_error,
)
from fantoccini.model.puppet.quantities import (
    Angle,
    AngleOrPlace,
    Armature,
    Damping,
    NumberAngleOrPlace,
    Point,
    Stiffness,
)

_JOINT_TYPES_OF_KEY = {
    "axis": ("revolute", "prismatic"),
    "axes": ("translation",),
    "driven": ("revolute", "prismatic", "translation", "ball", "free"),
    "damping": ("revolute", "prismatic", "translation", "ball", "free"),
    "armature": ("revolute", "prismatic", "translation", "ball", "free"),
    "spring": ("revolute", "prismatic", "ball"),
    "limits": ("revolute", "prismatic"),
    "cone": ("ball",),
    "twist": ("ball",),
}


class JointSpring(Model):
    """Spring on a joint: V = k/2 (q - rest)^2; on a ball joint V = 2 k (1 - q_w^2)."""

    stiffness: Stiffness
    """Stiffness k [N m/rad or N/m]."""
    rest: NumberAngleOrPlace = 0.0
    """Coordinate at which the spring is relaxed [rad or m]; not for ball joints."""


class Limits(Model):
    """Lower or upper limit of a joint's coordinate, or both."""

    lower: AngleOrPlace | None = None
    """Lower limit [rad or m]."""
    upper: AngleOrPlace | None = None
    """Upper limit [rad or m]."""

    @model_validator(mode="after")
    def _check_limits(self) -> Limits:
        _check_range(self.lower, self.upper)
        return self


class Cone(Model):
    """Swing limit of a ball joint: cos(max) - a . R b <= 0."""

    max: Angle
    """Largest angle between the two axes, between 0 and 180 deg."""
    axis: Direction
    """Axis a of the cone, in the joint frame."""
    of: Direction | None = None
    """Limited axis b, in the body frame; by default the same numbers as `axis`."""

    @field_validator("max")
    @classmethod
    def _check_cone_angle(cls, angle: float) -> float:
        if not 0 < angle < np.pi:
            raise validation_error(
                f"found {angle:g} rad; needed: more than 0 and less than 180 deg"
            )
        return angle

    @property
    def body_axis(self) -> tuple[float, float, float]:
        """Limited axis b, in the body frame."""
        return self.axis if self.of is None else self.of


class Twist(Model):
    """Limits of a ball joint's rotation about an axis of the body (swing-twist)."""

    lower: Angle | None = None
    """Lower limit [rad]."""
    upper: Angle | None = None
    """Upper limit [rad]."""
    axis: Direction | None = None
    """Axis b, in the body frame; by default the axis that the cone limits."""

    @model_validator(mode="after")
    def _check_limits(self) -> Twist:
        _check_range(self.lower, self.upper)
        if any(x is not None and abs(x) > np.pi for x in (self.lower, self.upper)):
            raise validation_error("a twist lies between -180 deg and 180 deg")
        return self


def _check_range(lower: float | None, upper: float | None) -> None:
    if lower is None and upper is None:
        raise validation_error("needed: lower, upper or both")
    if lower is not None and upper is not None and lower >= upper:
        raise validation_error(
            f"found lower {lower:g} and upper {upper:g}; lower must be below upper"
        )


class Joint(Model):
    """The joint that carries a body. At coordinates 0 the body frame is the joint frame."""

    type: Literal["fixed", "revolute", "prismatic", "translation", "ball", "free"]
    """Kind of motion."""
    name: PartName | None = None
    """Name of its coordinates; by default the body's name."""
    driven: bool = Field(default=False, strict=True)
    """True if a person or a motor moves it: its coordinates are inputs."""
    axis: Annotated[Direction | None, Field(validate_default=True)] = None
    """Axis of a revolute or prismatic joint, in the joint frame."""
    axes: Annotated[Axes | None, Field(validate_default=True)] = None
    """Axes along which a translation moves, in the joint frame."""
    at: Point = (0.0, 0.0, 0.0)
    """Origin of the joint frame in the parent's body frame [m]."""
    orientation: Orientation | None = None
    """Orientation of the joint frame in the parent's body frame."""
    damping: Damping = 0.0
    """Damping of every velocity of the joint [N m s/rad or N s/m]."""
    armature: Armature = 0.0
    """Inertia of a rotor geared to every velocity of the joint [kg m^2 or kg]."""
    spring: JointSpring | None = None
    """Spring that pulls the joint to a rest position."""
    limits: Limits | None = None
    """Limits of a revolute or prismatic joint."""
    cone: Cone | None = None
    """Swing limit of a ball joint."""
    twist: Twist | None = None
    """Twist limit of a ball joint."""

    @field_validator("axis", "axes")
    @classmethod
    def _check_required(cls, value: Any, info: ValidationInfo) -> Any:
        kind = info.data.get("type")
        if kind in _JOINT_TYPES_OF_KEY[str(info.field_name)] and value is None:
            raise validation_error(f"a {kind} joint needs this key")
        return value

    @field_validator(*_JOINT_TYPES_OF_KEY)
    @classmethod
    def _check_joint_type(cls, value: Any, info: ValidationInfo) -> Any:
        name = str(info.field_name)
        if value is None or value is False or (name in ("damping", "armature") and not value):
            return value
        kind, allowed = info.data.get("type"), _JOINT_TYPES_OF_KEY[name]
        if kind is not None and kind not in allowed:
            raise validation_error(
                f"found in a {kind} joint; allowed in {', '.join(allowed)} joints"
            )
        if name not in ("driven", "axis", "axes") and info.data.get("driven"):
            text = "a driven joint follows its input; it has no damping, spring or limits"
            if name == "armature":
                text = "a driven joint follows its input; a drive gives it a rotor"
            raise validation_error(text)
        return value

    @field_validator("spring", "limits", mode="before")
    @classmethod
    def _check_mapping(cls, value: Any, info: ValidationInfo) -> Any:
        if info.field_name == "limits" and isinstance(value, (list, tuple)):
            raise validation_error("found a list; needed: {lower: ..., upper: ...}")
        if info.data.get("type") == "prismatic" and isinstance(value, dict):
            words = [v for v in value.values() if isinstance(v, str)]
            if words:
                raise validation_error(
                    f"found {words[0]!r}; needed: a length in metres, without a unit"
                )
        return value

    @field_validator("spring")
    @classmethod
    def _check_ball_rest(cls, spring: Any, info: ValidationInfo) -> Any:
        if spring is not None and info.data.get("type") == "ball" and spring.rest != 0:
            raise validation_error(
                "a ball joint's spring has no rest; turn the joint frame instead"
            )
        return spring

    @field_validator("twist")
    @classmethod
    def _check_twist_axis(cls, twist: Any, info: ValidationInfo) -> Any:
        if twist is not None and twist.axis is None and info.data.get("cone", ...) is None:
            raise validation_error("needed: axis, or a cone, which gives the axis")
        return twist
