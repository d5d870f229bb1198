"""The schema of a puppet: bodies on joints, hung on strings."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    PrivateAttr,
    Tag,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from fantoccini.base import PuppetError
from fantoccini.base.documents import (
    Axes,
    Document,
    Kind,
    Located,
    Model,
    Name,
    Number,
    Origin,
    Parameter,
    PartName,
    Share,
    data_path,
    entries,
    findings,
    mended,
    mistake,
    number_kind,
    owner_of,
    rotation_vector_quaternion,
    shown,
    sized,
    unit,
    valid_parts,
    value_of,
)
from fantoccini.model.puppet import check, dump, mirror, written
from fantoccini.model.puppet.chain import (
    CORD_DAMPING,
    CORD_MASS,
    CORD_STIFFNESS,
    DEFAULT_PIECES,
    Chain,
    chained,
    check_chain,
)
from fantoccini.model.puppet.contact import Contact, ContactRule
from fantoccini.model.puppet.drive import Drive
from fantoccini.model.puppet.joint import Joint
from fantoccini.model.puppet.parts import named
from fantoccini.model.puppet.quantities import (
    AngleOrPlace,
    Bounded,
    Damping,
    Gravity,
    Inertia,
    Mass,
    Place,
    Point,
    PositiveForce,
    RestLength,
    RotationPart,
    Size,
    Speed,
    Stiffness,
)
from fantoccini.model.puppet.shapes import AnyObstacle, AnyShape, Colour, Mesh
from fantoccini.model.puppet.words import WORDS


class Drag(Model):
    """Air drag: -(linear + quadratic |v|) v on the centre of mass, torque -angular w."""

    linear: Damping = 0.0
    """Linear coefficient [N s/m]."""
    quadratic: Damping = 0.0
    """Quadratic coefficient [N s^2/m^2]."""
    angular: Damping = 0.0
    """Angular coefficient [N m s]."""


def _possible(inertia: tuple[Number, ...]) -> tuple[Number, ...]:
    ixx, iyy, izz, ixy, ixz, iyz = (*(value_of(n) for n in inertia), 0.0, 0.0, 0.0)[:6]
    a, b, c = np.linalg.eigvalsh([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    slack = 1e-9 * abs(c)  # far above rounding
    if a < -slack:
        raise mistake(
            f"found a principal moment of {a:g} kg m^2; needed: zero or a positive number"
        )
    if a + b < c - slack:
        raise mistake(
            f"found principal moments {a:g}, {b:g} and {c:g} kg m^2; in a solid, none is larger "
            "than the sum of the other two"
        )
    return inertia


SolidInertia = Annotated[tuple[Inertia, ...], sized(3, 6), AfterValidator(_possible)]
"""ixx, iyy, izz and optionally ixy, ixz, iyz of a solid [kg m^2]."""


class Body(Model):
    """A rigid body and the joint that carries it. A body without mass is a frame."""

    name: PartName
    """The body's name."""
    parent: str = "world"
    """Name of the parent body."""
    joint: Joint = Joint(type="fixed")
    """Joint that carries it on its parent."""
    shapes: tuple[AnyShape, ...] = ()
    """Solids fixed on the body; those with mass or density give its inertia."""
    mass: Mass | None = None
    """Mass [kg], instead of the shapes' sum."""
    com: Point | None = None
    """Centre of mass in the body frame [m], instead of the shapes'."""
    inertia: SolidInertia | None = None
    """ixx, iyy, izz and optionally ixy, ixz, iyz about the centre of mass [kg m^2]."""
    drag: Drag | None = None
    """Air drag."""


class Attachment(Model):
    """A point of a string or spring: on a body, in the world, or a driven end of a string."""

    body: str | None = None
    """Name of the body on which the point is fixed."""
    at: Point = (0.0, 0.0, 0.0)
    """Place in the body frame [m]; for a driven end, its start place in the parent's frame."""
    world: Point | None = None
    """Place in the world [m]."""
    driven: Axes | None = None
    """Axes along which a hand or motor moves the string's end."""
    parent: str = "world"
    """Name of the body in whose frame a driven end moves; by default the world."""

    @model_validator(mode="after")
    def _one_place(self) -> Attachment:
        keys = [k for k in ("body", "world", "driven") if getattr(self, k) is not None]
        if len(keys) != 1:
            listed = " and ".join(keys) or "neither"
            raise mistake(f"found {listed}; needed: exactly one of body, world, driven")
        if self.parent != "world" and self.driven is None:
            raise mistake("found a parent of a point that is not driven; write body instead")
        if self.world is not None and "at" in self.model_fields_set:
            raise mistake("found world and at; world gives the place")
        return self


def _length_kind(value: Any) -> str:
    return "<driven>" if isinstance(value, str) else number_kind(value)


def _driven(word: Any) -> Any:
    if word != "driven":
        raise mistake(f"found {shown(word)}; needed: a positive number [m], or driven")
    return word


Length = Annotated[
    Annotated[Literal["driven"], BeforeValidator(_driven), Tag("<driven>")]
    | Annotated[Size, Tag("<number>")]
    | Annotated[Parameter, Tag("<parameter>")],
    Discriminator(_length_kind),
    Bounded("length", "positive"),
]


class String(Model):
    """A massless string, which only pulls: path length - L <= 0."""

    name: PartName
    """The string's name."""
    path: Annotated[tuple[Attachment, ...], entries(2)]
    """Points through which it runs, from end to end."""
    length: Length
    """Length L [m], or `driven` if it is wound in and out."""
    wire: bool = Field(default=False, strict=True)
    """True for a rod that also pushes (a two-sided constraint)."""
    restitution: Share = 0.0
    """Ratio of the speeds after and before a catch: 0 to 1."""
    max_tension: PositiveForce | None = None
    """Tension at which its winch slips and lets string out [N]."""
    rewind_speed: Speed | None = None
    """Speed at which the winch rewinds the slipped length [m/s]."""
    chain: Chain | None = None
    """Springs and point masses that model the string, instead of a constraint."""
    colour: Colour | None = None
    """Colour as `"#rrggbb"`."""

    @model_validator(mode="after")
    def _winch(self) -> String:
        bounces = value_of(self.restitution) > 0
        if self.wire and (bounces or self.max_tension is not None):
            key = "restitution" if bounces else "max_tension"
            raise mistake(f"found wire: true and {key}; a wire neither bounces nor slips")
        if self.rewind_speed is not None and self.max_tension is None:
            raise mistake("found rewind_speed without max_tension; only a winch that slips rewinds")
        if bounces and self.max_tension is not None:
            raise mistake(
                "found restitution and max_tension; a string on a slipping winch does not bounce"
            )
        if self.chain is not None:
            check_chain(self)
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
    """Distance at which it is relaxed [m]."""
    damping: Damping = 0.0
    """Damping along the line between its ends [N s/m]."""


class Mirror(Model):
    """Reflection of all parts with a given word in their names; twins have another word."""

    plane: Literal["xy", "yz", "xz"]
    """Plane of the reflection, through the origin."""
    from_: str = Field(alias="from", min_length=1, max_length=64)
    """Word in the names of originals, for example `left`."""
    to: str = Field(min_length=1, max_length=64)
    """Word in the names of their twins, for example `right`."""


def _pose_kind(value: Any) -> str:
    return "<rotation>" if isinstance(value, (list, tuple, np.ndarray)) else "<number>"


def _rotation(value: tuple[float, ...]) -> tuple[float, ...]:
    """Unit quaternion from a rotation vector (3 numbers) or a quaternion (4 numbers)."""
    return rotation_vector_quaternion(value) if len(value) == 3 else unit(value)


Rotation = Annotated[tuple[RotationPart, ...], sized(3, 4), AfterValidator(_rotation)]
PoseValue = Annotated[
    Annotated[AngleOrPlace, Tag("<number>")] | Annotated[Rotation, Tag("<rotation>")],
    Discriminator(_pose_kind),
]


class Puppet(Document):
    """A puppet, as its file describes it."""

    kind: ClassVar = Kind(
        "puppet", "a puppet has the keys `puppet` and `bodies`", error=PuppetError, words=WORDS
    )

    puppet: Name
    """The puppet's name."""
    gravity: Gravity = (0.0, 0.0, -9.81)
    """Acceleration of gravity in the world [m/s^2]."""
    bodies: Annotated[tuple[Body, ...], entries(1)]
    """Bodies, in any order; each names its parent."""
    strings: tuple[String, ...] = ()
    """Strings on which the puppet hangs."""
    springs: tuple[Spring, ...] = ()
    """Springs between points."""
    drives: tuple[Drive, ...] = ()
    """Drives of driven coordinates, which become dynamic."""
    mirror: Mirror | None = None
    """Reflection of one half of the puppet into the other."""
    pose: dict[str, PoseValue] = Field(default_factory=dict)
    """Start values: coordinate -> number; `joint.rotation` -> quaternion or rotation vector."""
    obstacles: tuple[AnyObstacle, ...] = ()
    """Shapes fixed in the world."""
    floor: Place | None = None
    """Height of the floor [m]."""
    contact: ContactRule | None = None
    """Contact of its bodies with the floor, obstacles and one another: true, false or rules."""
    members: tuple[Name, ...] = ()
    """Names of an assembled scene's puppets; names of their parts begin with these and a dot."""
    props: tuple[Name, ...] = ()
    """Names of the props of an assembled scene."""

    _origin: Origin = PrivateAttr(default_factory=Origin)

    @classmethod
    def _all_mistakes(cls, data: Any, handler: Any, info: ValidationInfo) -> Any:
        if isinstance(data, Puppet):
            return data
        located = info.context if isinstance(info.context, Located) else Located()
        plain, puppet, mistakes = dump.plain(data), None, []
        tried = plain
        while puppet is None and tried is not None:
            try:
                puppet = handler(data if tried is plain else tried)
            except ValidationError as error:
                mistakes += findings(cls, tried, error, WORDS)
                # A number out of range is replaced by one in range, so that the rest is checked.
                tried = mended(tried, error)
        if isinstance(plain, dict):
            whole = valid_parts(cls, plain, located) if puppet is None else puppet
            wide = check.findings(whole, plain)
            if puppet is not None and not wide:
                mistakes += check.massless_joints(puppet.bodies, puppet.mirror)
                mistakes += check.twins(puppet, dump.plain(puppet), located)
            mistakes += [(data_path(plain, path)[0], text) for path, text in wide]
        if puppet is None or mistakes or located.mistakes:
            raise located.error(mistakes, PuppetError)
        lines = {name: located.line(path) for name, path in named(puppet)}
        known = {name: line for name, line in lines.items() if line is not None}
        puppet._origin = Origin(located.file, located.folder, known)
        return puppet

    def __hash__(self) -> int:
        return hash((self.puppet, self.bodies, self.strings))

    @property
    def name(self) -> str:
        """The puppet's name."""
        return self.puppet

    @property
    def touching(self) -> Contact | None:
        """The contact rules; None without contact."""
        if isinstance(self.contact, Contact):
            return self.contact
        return Contact() if self.contact else None

    def expanded(self) -> Puppet:
        """The puppet with both halves and without a mirror."""
        if self.mirror is None:
            return self
        data, _ = mirror.reflected(dump.plain(self))
        origin = self._origin
        puppet = Puppet.model_validate(data, context=Located(None, origin.file, origin.folder))
        twins = {mirror.twin_name(n, self.mirror.from_, self.mirror.to): n for n in origin.lines}
        lines = {twin: origin.lines[n] for twin, n in twins.items()} | origin.lines
        puppet._origin = Origin(origin.file, origin.folder, lines)
        return puppet

    def parameters(self) -> dict[str, float]:
        """Names and values of all parameters, in order of first appearance."""
        return {p["parameter"]: p["value"] for _, p in written.parameters(dump.plain(self))}

    def with_values(self, values: dict[str, float]) -> Puppet:
        """The same puppet with other values of its parameters.

        Args:
            values: parameter name -> value; other names are ignored.

        Raises:
            PuppetError: a value is out of range.
        """
        plain = dump.plain(self)
        for _, parameter in written.parameters(plain):
            parameter["value"] = values.get(parameter["parameter"], parameter["value"])
        # The meshes stay in the same folder.
        return Puppet.model_validate(plain, context=Located(folder=self._origin.folder))

    def with_chains(
        self,
        pieces: int = DEFAULT_PIECES,
        mass: Number = CORD_MASS,
        stiffness: Number = CORD_STIFFNESS,
        damping: Number = CORD_DAMPING,
    ) -> Puppet:
        """The same puppet on chains of point masses joined by springs, instead of constraints.

        Chains and wires are not changed. By default every string has the mass and stiffness of a
        metre of polyester cord of 0.5 g/m: EA is the yarn's specific modulus, 10 N/tex, times
        500 tex.

        Args:
            pieces: number of springs of each string; there is one mass fewer.
            mass: mass of each string [kg].
            stiffness: EA of each string [N].
            damping: force per unit of strain rate [N s].

        Raises:
            PuppetError: a string cannot be a chain (it has a slipping winch, restitution or
                pulleys), or a number is not allowed.
        """
        chain = {"pieces": pieces, "mass": mass, "stiffness": stiffness, "damping": damping}
        plain = dump.plain(self)
        plain["strings"] = chained(plain.get("strings", []), chain)
        origin = self._origin
        names: dict[tuple[str | int, ...], str] = {
            ("strings", i): string.name for i, string in enumerate(self.strings)
        }
        lines = {path: origin.lines[n] for path, n in names.items() if n in origin.lines}
        context = Located(None, origin.file, origin.folder, lines)
        puppet = Puppet.model_validate(plain, context=context)
        puppet._origin = origin
        return puppet

    def locate(self, name: str) -> tuple[str, int | None]:
        """File and line of a body, joint, string, spring or obstacle.

        Args:
            name: name of the part; a twin has the line of its original.
        """
        origin = self._origin
        line = origin.lines.get(name)
        if line is None and self.mirror is not None:
            line = self.expanded()._origin.lines.get(name)
        return origin.files.get(name, origin.file), line

    def member_of(self, body: str) -> str:
        """Name of the scene's puppet or prop to which a body belongs; empty for a single puppet."""
        first = body.partition(".")[0]
        return first if first in (*self.members, *self.props) else ""

    def owner_of(self, coordinate: str) -> str:
        """Name of the joint or string that has a coordinate or limit."""
        return owner_of(coordinate, self.members)

    def to_yaml(self) -> str:
        """The text of a puppet file; reading it gives an equal puppet."""
        return dump.to_yaml(dump.plain(self))

    def canonical(self, *, values: bool = True) -> str:
        """JSON of the expanded puppet and its meshes' digests, the same for equal puppets.

        Args:
            values: whether to include values that do not change the compiled code: values of
                parameters, contact rules, obstacles and the floor.
        """
        puppet = self.expanded()
        solids = [s for body in puppet.bodies for s in body.shapes]
        solids += puppet.obstacles if values else ()
        meshes = {s.file: s.digest() for s in solids if isinstance(s, Mesh)}
        plain = dump.plain(puppet)
        if not values:
            for _, parameter in written.parameters(plain):
                parameter["value"] = 0.0
            plain["contact"] = puppet.touching is not None
            for key in ("obstacles", "floor"):
                plain.pop(key, None)
        return dump.canonical(plain, meshes)
