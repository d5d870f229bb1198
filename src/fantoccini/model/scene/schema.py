"""The schema of a scene file: puppets with names, places and poses; props, obstacles, a floor."""

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
    mistake,
    refuse,
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
    """A puppet of a scene, and its place."""

    name: Name
    """Its name in the scene; names of its parts and coordinates begin with this and a dot."""
    puppet: Annotated[
        Annotated[str, Tag("<file>")] | Annotated[InstanceOf[Puppet], Tag("<puppet>")],
        Discriminator(_puppet_kind),
    ]
    """Its file, relative to the scene's, or the name of a bundled one; in Python also a Puppet."""
    at: Vector = (0.0, 0.0, 0.0)
    """Place of the origin of its world in the scene [m]."""
    orientation: Orientation | None = None
    """Orientation of the axes of its world in the scene."""
    pose: dict[str, PoseValue] = Field(default_factory=dict)
    """Start values that replace those of its file, by the names in its file."""
    parameters: dict[str, Real] = Field(default_factory=dict)
    """Values of its parameters that replace those of its file."""


class Prop(Model):
    """A rigid body that is not attached to anything: a ball, a chair, a hat."""

    name: Name
    """Its name; its coordinates are `ball.x`, `ball.y`, `ball.z` and `ball.rotation`."""
    shapes: Annotated[tuple[AnyShape, ...], entries(1)]
    """Its solids; those with mass or density give its inertia."""
    mass: Mass | None = None
    """Mass [kg], instead of the shapes' sum."""
    com: Point | None = None
    """Centre of mass in its frame [m], instead of the shapes'."""
    inertia: SolidInertia | None = None
    """ixx, iyy, izz and optionally ixy, ixz, iyz about the centre of mass [kg m^2]."""
    drag: Drag | None = None
    """Air drag."""
    at: Vector = (0.0, 0.0, 0.0)
    """Place of its frame at the start [m]."""
    orientation: Orientation | None = None
    """Orientation of its frame at the start."""

    @model_validator(mode="after")
    def _has_mass(self) -> Prop:
        own = any(map(has_mass, self.shapes)) if self.mass is None else value_of(self.mass) > 0
        if not own:
            raise mistake("this prop has no mass; give it a mass, or one of its shapes")
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
        refuse(
            (path, world.get(name, f"the name {name!r} is used {uses[name]} times; names differ"))
            for path, name in self.names()
            if name in world or uses[name] > 1
        )
        return self

    @classmethod
    def of(cls, *puppets: Puppet, name: str | None = None) -> Scene:
        """The scene of several puppets, at the places given in their files.

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
