"""Parts of a puppet: bodies, strings, springs, its mirror and its start values.

A driven coordinate is given as a function of time: an end or length of a string, or a driven joint.
A winch changes the length of a string, and a twin is the mirror image of a part.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, model_validator

from fantoccini.base.documents import (
    Axes,
    Model,
    Number,
    Parameter,
    PartName,
    Share,
    entries,
    number_kind,
    rotation_vector_quaternion,
    shown,
    sized,
    unit,
    validation_error,
    value_of,
)
from fantoccini.model.puppet.chain import Chain, check_chain
from fantoccini.model.puppet.joint import Joint
from fantoccini.model.puppet.quantities import (
    AngleOrPlace,
    Bounded,
    Damping,
    Inertia,
    Mass,
    Point,
    PositiveForce,
    RestLength,
    RotationPart,
    Size,
    Speed,
    Stiffness,
)
from fantoccini.model.puppet.shapes import AnyShape, Colour


class Drag(Model):
    """Air drag: -(linear + quadratic |v|) v on the centre of mass, torque -angular w."""

    linear: Damping = 0.0
    """Coefficient of v [N s/m]."""
    quadratic: Damping = 0.0
    """Coefficient of |v| v [N s^2/m^2]."""
    angular: Damping = 0.0
    """Coefficient of the angular velocity w [N m s]."""


def _check_inertia(inertia: tuple[Number, ...]) -> tuple[Number, ...]:
    """Returns the inertia; raises if no solid can have it."""
    ixx, iyy, izz, ixy, ixz, iyz = (*(value_of(n) for n in inertia), 0.0, 0.0, 0.0)[:6]
    a, b, c = np.linalg.eigvalsh([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    tolerance = 1e-9 * abs(c)  # far above rounding
    if a < -tolerance:
        raise validation_error(f"found a principal moment of {a:g} kg m^2; none may be negative")
    if a + b < c - tolerance:
        raise validation_error(
            f"found principal moments {a:g}, {b:g} and {c:g} kg m^2; no solid has one that is "
            "larger than the sum of the other two"
        )
    return inertia


SolidInertia = Annotated[tuple[Inertia, ...], sized(3, 6), AfterValidator(_check_inertia)]
"""ixx, iyy, izz and optionally ixy, ixz, iyz of a solid [kg m^2]."""


class Body(Model):
    """A rigid body and the joint that carries it. A body without mass is a frame."""

    name: PartName
    """The body's name."""
    parent: str = "world"
    """Name of the parent body."""
    joint: Joint = Joint(type="fixed")
    """Joint between the body and its parent."""
    shapes: tuple[AnyShape, ...] = ()
    """Solids fixed on the body; those with mass or density give its inertia."""
    mass: Mass | None = None
    """Mass [kg], instead of the sum of the shapes."""
    com: Point | None = None
    """Centre of mass in the body frame [m], instead of that of the shapes."""
    inertia: SolidInertia | None = None
    """ixx, iyy, izz and optionally ixy, ixz, iyz about the centre of mass [kg m^2]."""
    drag: Drag | None = None
    """Air drag."""


class Attachment(Model):
    """A point of a string or spring, fixed on a body or in the world, or a string's driven end."""

    body: str | None = None
    """Name of the body on which the point is fixed."""
    at: Point = (0.0, 0.0, 0.0)
    """Position in the body frame; for a driven end the start position in its parent's frame [m]."""
    world: Point | None = None
    """Position in the world [m]."""
    driven: Axes | None = None
    """Axes along which a hand or a motor moves the string's end."""
    parent: str = "world"
    """Name of the body in whose frame a driven end moves."""

    @model_validator(mode="after")
    def _exactly_one_carrier(self) -> Attachment:
        keys = [k for k in ("body", "world", "driven") if getattr(self, k) is not None]
        if len(keys) != 1:
            text = " and ".join(keys) or "neither"
            raise validation_error(f"found {text}; needed: exactly one of body, world, driven")
        if self.parent != "world" and self.driven is None:
            raise validation_error(
                "found parent for a point that is not driven; needed: body instead"
            )
        if self.world is not None and "at" in self.model_fields_set:
            raise validation_error("found world and at; needed: only world, which is the position")
        return self


def _length_kind(value: Any) -> str:
    return "<driven>" if isinstance(value, str) else number_kind(value)


def _driven(word: Any) -> Any:
    if word != "driven":
        raise validation_error(f"found {shown(word)}; needed: a positive number [m], or driven")
    return word


Length = Annotated[
    Annotated[Literal["driven"], BeforeValidator(_driven), Tag("<driven>")]
    | Annotated[Size, Tag("<number>")]
    | Annotated[Parameter, Tag("<parameter>")],
    Discriminator(_length_kind),
    Bounded("length", "positive"),
]


class String(Model):
    """A massless string: path length - L <= 0, and it can only pull."""

    name: PartName
    """The string's name."""
    path: Annotated[tuple[Attachment, ...], entries(2)]
    """Points through which it runs, from end to end."""
    length: Length
    """Length L [m], or `driven` if it is wound in and out."""
    wire: bool = Field(default=False, strict=True)
    """True for a rod that also pushes (a two-sided constraint)."""
    restitution: Share = 0.0
    """Coefficient of restitution when the string comes taut: 0 (none) to 1."""
    max_tension: PositiveForce | None = None
    """Tension at which its winch slips and lets string out [N]."""
    rewind_speed: Speed | None = None
    """Speed at which the winch rewinds the slipped length [m/s]."""
    chain: Chain | None = None
    """Models the string as springs and point masses, instead of a constraint."""
    colour: Colour | None = None
    """Colour as `"#rrggbb"`."""

    @model_validator(mode="after")
    def _check_options(self) -> String:
        has_restitution = value_of(self.restitution) > 0
        if self.wire and (has_restitution or self.max_tension is not None):
            key = "restitution" if has_restitution else "max_tension"
            raise validation_error(f"found wire: true and {key}; a wire neither bounces nor slips")
        if self.rewind_speed is not None and self.max_tension is None:
            raise validation_error(
                "found rewind_speed without max_tension; only a winch that slips rewinds"
            )
        if has_restitution and self.max_tension is not None:
            raise validation_error(
                "found restitution and max_tension; a string on a slipping winch does not bounce"
            )
        if self.chain is not None:
            check_chain(self.wire, has_restitution, self.max_tension is not None, len(self.path))
        return self


class Spring(Model):
    """A spring between two points: V = k/2 (d - rest)^2."""

    name: PartName
    """The spring's name."""
    between: Annotated[tuple[Attachment, ...], entries(2, 2)]
    """Its two ends."""
    stiffness: Stiffness
    """Stiffness k [N/m]."""
    rest: RestLength
    """Distance d at which it is relaxed [m]."""
    damping: Damping = 0.0
    """Damping of the rate of d [N s/m]."""


class Mirror(Model):
    """Reflects all parts whose names contain one word into twins whose names contain another."""

    plane: Literal["xy", "yz", "xz"]
    """Plane of the reflection, through the origin."""
    from_: str = Field(alias="from", min_length=1, max_length=64)
    """Word in the names of originals, for example `left`."""
    to: str = Field(min_length=1, max_length=64)
    """Word in the names of their twins, for example `right`."""


def _pose_kind(value: Any) -> str:
    return "<rotation>" if isinstance(value, (list, tuple, np.ndarray)) else "<number>"


def _rotation(value: tuple[float, ...]) -> tuple[float, ...]:
    """Unit quaternion of a rotation vector (3 numbers) or a quaternion (4)."""
    return rotation_vector_quaternion(value) if len(value) == 3 else unit(value)


Rotation = Annotated[tuple[RotationPart, ...], sized(3, 4), AfterValidator(_rotation)]
PoseValue = Annotated[
    Annotated[AngleOrPlace, Tag("<number>")] | Annotated[Rotation, Tag("<rotation>")],
    Discriminator(_pose_kind),
]
