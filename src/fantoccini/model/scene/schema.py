"""Schema of scene files: puppets with names, positions and poses; props, obstacles, a floor.

A member is a puppet of the scene.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from pydantic import Discriminator, Field, InstanceOf, Tag, model_validator

from fantoccini.base import Mistake, PuppetError
from fantoccini.base.documents import (
    Document,
    Kind,
    Model,
    Name,
    Orientation,
    Path,
    Real,
    entries,
    raise_if_any,
    validation_error,
    value_of,
)
from fantoccini.model.puppet import (
    WORDS,
    AnyObstacle,
    AnyShape,
    ContactRule,
    Drag,
    Gravity,
    Mass,
    Place,
    Point,
    PoseValue,
    Puppet,
    SolidInertia,
    String,
    Vector,
    has_mass,
)


def _puppet_kind(value: Any) -> str:
    return "<puppet>" if isinstance(value, Puppet) else "<file>"


class Member(Model):
    """A puppet of a scene, with its position."""

    name: Name
    """Name in the scene, such as `hans`; its parts are then `hans.arm` and so on."""
    puppet: Annotated[
        Annotated[str, Tag("<file>")] | Annotated[InstanceOf[Puppet], Tag("<puppet>")],
        Discriminator(_puppet_kind),
    ]
    """Path of the puppet file beside the scene's, or the name of a bundled puppet; in Python also a
    Puppet."""
    at: Vector = (0.0, 0.0, 0.0)
    """Position in the scene of the world origin of the puppet file [m]."""
    orientation: Orientation | None = None
    """Orientation in the scene of the world axes of the puppet file."""
    pose: dict[str, PoseValue] = Field(default_factory=dict)
    """Start values that replace those of the puppet file; names are those of the file."""
    parameters: dict[str, Real] = Field(default_factory=dict)
    """Parameter -> value that replaces the one in the puppet file."""


class Prop(Model):
    """A rigid body that is not attached to anything: a ball, a chair, a hat."""

    name: Name
    """Name; the coordinates of `ball` are `ball.x`, `ball.y`, `ball.z` and `ball.rotation`."""
    shapes: Annotated[tuple[AnyShape, ...], entries(1)]
    """Solids of the prop; those with mass or density give its inertia."""
    mass: Mass | None = None
    """Mass [kg], instead of the sum of the shapes."""
    com: Point | None = None
    """Centre of mass in the prop's frame [m], instead of that of the shapes."""
    inertia: SolidInertia | None = None
    """ixx, iyy, izz and optionally ixy, ixz, iyz about the centre of mass [kg m^2]."""
    drag: Drag | None = None
    """Air drag."""
    at: Vector = (0.0, 0.0, 0.0)
    """Start position of the prop's frame [m]."""
    orientation: Orientation | None = None
    """Start orientation of the prop's frame."""

    @model_validator(mode="after")
    def _has_mass(self) -> Prop:
        shapes_have_mass = any(map(has_mass, self.shapes))
        if not (shapes_have_mass if self.mass is None else value_of(self.mass) > 0):
            raise validation_error(
                "this prop has no mass; give it a mass, or give one of its shapes a mass"
            )
        return self


class Scene(Document):
    """Puppets, props, obstacles and a floor that share gravity."""

    kind: ClassVar = Kind(
        "scene", "a scene has the keys `scene` and `puppets`", error=PuppetError, words=WORDS
    )

    scene: Name
    """The scene's name."""
    gravity: Gravity | None = None
    """Acceleration of gravity [m/s^2]; by default that of the puppets' files."""
    floor: Place | None = None
    """Height of the floor [m]; by default that of the puppets' files."""
    contact: ContactRule | None = None
    """Contact of everything in the scene; by default that of the puppets' files."""
    puppets: Annotated[tuple[Member, ...], entries(1)]
    """The puppets, in the order of their coordinates."""
    props: tuple[Prop, ...] = ()
    """Rigid bodies that are not attached to anything."""
    strings: tuple[String, ...] = ()
    """Strings between puppets and props, with the names of bodies in the scene."""
    obstacles: tuple[AnyObstacle, ...] = ()
    """Fixed shapes."""

    @model_validator(mode="after")
    def _names_differ(self) -> Scene:
        uses = Counter(name for _, name in self.names())
        world = {"world": "found 'world', which is the name of the world itself"}
        raise_if_any(
            (
                path,
                world.get(
                    name, f"the name {name!r} is used {uses[name]} times; needed: different names"
                ),
            )
            for path, name in self.names()
            if name in world or uses[name] > 1
        )
        return self

    @classmethod
    def of(cls, *puppets: Puppet, name: str | None = None) -> Scene:
        """The scene of several puppets, at the positions in their files.

        Args:
            puppets: one or more puppets, with different names.
            name: name of the scene; by default the puppets' names, joined by _.

        Raises:
            PuppetError: two puppets have the same name.
        """
        if not puppets:
            raise PuppetError([Mistake("<python>", None, "puppets", "a scene needs a puppet")])
        members = tuple(Member(name=puppet.name, puppet=puppet) for puppet in puppets)
        return cls(scene=name or "_".join(p.name for p in puppets), puppets=members)

    @property
    def name(self) -> str:
        """The scene's name."""
        return self.scene

    def names(self) -> Iterator[tuple[Path, str]]:
        """Key paths and names of the puppets, props, strings and obstacles."""
        for i, member in enumerate(self.puppets):
            yield ("puppets", i, "name"), member.name
        for i, prop in enumerate(self.props):
            yield ("props", i, "name"), prop.name
        for i, string in enumerate(self.strings):
            yield ("strings", i, "name"), string.name
        for i, obstacle in enumerate(self.obstacles):
            yield ("obstacles", i, "name"), obstacle.name


PUPPET_OR_SCENE: tuple[type[Puppet | Scene], ...] = (Puppet, Scene)
"""Kinds of files that describe a puppet."""
