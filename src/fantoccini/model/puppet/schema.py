"""The schema of a puppet: bodies on joints, hung on strings.

A scene has several puppets, its members. A drive moves a coordinate by a motor, and a twin is the
mirror image of a part.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import Field, PrivateAttr, ValidationError, ValidationInfo

from fantoccini.base import PuppetError
from fantoccini.base.documents import (
    Document,
    Kind,
    Located,
    Name,
    Number,
    Origin,
    data_path,
    entries,
    findings,
    mended,
    owner_of,
    valid_parts,
)
from fantoccini.model.puppet import check, dump, mirror, written
from fantoccini.model.puppet.chain import (
    CORD_DAMPING,
    CORD_MASS,
    CORD_STIFFNESS,
    DEFAULT_PIECES,
    chained,
)
from fantoccini.model.puppet.contact import Contact, ContactRule
from fantoccini.model.puppet.drive import Drive
from fantoccini.model.puppet.elements import Body, Mirror, PoseValue, Spring, String
from fantoccini.model.puppet.parts import named_parts
from fantoccini.model.puppet.quantities import Gravity, Place
from fantoccini.model.puppet.rig import Rig
from fantoccini.model.puppet.shapes import AnyObstacle, Mesh
from fantoccini.model.puppet.words import WORDS


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
    rig: Rig | None = None
    """Body map: limbs, head, and the strings that move them; by default it is guessed."""
    contact: ContactRule | None = None
    """Contact of its bodies with the floor, obstacles and one another: true, false or rules."""
    members: tuple[Name, ...] = ()
    """Names of an assembled scene's puppets; names of their parts begin with these and a dot."""
    props: tuple[Name, ...] = ()
    """Names of the props of an assembled scene."""
    rigs: dict[Name, Rig] = Field(default_factory=dict)
    """Member of an assembled scene -> the `rig` of its file, with the names in that file."""

    _origin: Origin = PrivateAttr(default_factory=Origin)

    @classmethod
    def _all_mistakes(cls, data: Any, handler: Any, info: ValidationInfo) -> Any:
        if isinstance(data, Puppet):
            return data
        located = info.context if isinstance(info.context, Located) else Located()
        data_as_written, puppet, mistakes = dump.plain(data), None, []
        candidate = data_as_written
        while puppet is None and candidate is not None:
            try:
                puppet = handler(data if candidate is data_as_written else candidate)
            except ValidationError as error:
                mistakes += findings(cls, candidate, error, WORDS)
                # A number out of range is replaced by one in range, so that the rest is checked.
                candidate = mended(candidate, error)
        if isinstance(data_as_written, dict):
            valid_puppet = valid_parts(cls, data_as_written, located) if puppet is None else puppet
            file_mistakes = check.findings(valid_puppet, data_as_written)
            if puppet is not None and not file_mistakes:
                mistakes += check.massless_joints(puppet.bodies, puppet.mirror)
                mistakes += check.twin_findings(
                    puppet, dump.plain(puppet), lambda halves: puppet._with_halves(halves, located)
                )
            mistakes += [
                (data_path(data_as_written, path)[0], text) for path, text in file_mistakes
            ]
        if puppet is None or mistakes or located.mistakes:
            raise located.error(mistakes, PuppetError)
        lines = {name: located.line(path) for name, path in named_parts(puppet)}
        known_lines = {name: line for name, line in lines.items() if line is not None}
        puppet._origin = Origin(located.file, located.folder, known_lines)
        return puppet

    def _with_halves(self, halves: dict[str, Any], located: Located) -> Puppet:
        """The valid parts of both halves, without their shapes, and the obstacles of this one."""
        valid_puppet = valid_parts(Puppet, halves, located)
        return valid_puppet.model_copy(update={"obstacles": self.obstacles})

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
        original_of_twin = {
            mirror.twin_name(name, self.mirror.from_, self.mirror.to): name for name in origin.lines
        }
        lines = {twin: origin.lines[name] for twin, name in original_of_twin.items()} | origin.lines
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
        data = dump.plain(self)
        for _, parameter in written.parameters(data):
            parameter["value"] = values.get(parameter["parameter"], parameter["value"])
        # The meshes stay in the same folder.
        return Puppet.model_validate(data, context=Located(folder=self._origin.folder))

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
        data = dump.plain(self)
        data["strings"] = chained(data.get("strings", []), chain)
        origin = self._origin
        name_of_path: dict[tuple[str | int, ...], str] = {
            ("strings", i): string.name for i, string in enumerate(self.strings)
        }
        lines = {path: origin.lines[n] for path, n in name_of_path.items() if n in origin.lines}
        context = Located(None, origin.file, origin.folder, lines)
        puppet = Puppet.model_validate(data, context=context)
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
        prefix = body.partition(".")[0]
        return prefix if prefix in (*self.members, *self.props) else ""

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
                parameters, the pose, colours, contact rules, obstacles, the floor and the body map.
        """
        puppet = self.expanded()
        solids = [s for body in puppet.bodies for s in body.shapes]
        solids += puppet.obstacles if values else ()
        meshes = {s.file: s.digest() for s in solids if isinstance(s, Mesh)}
        data = dump.plain(puppet)
        if not values:
            for _, parameter in written.parameters(data):
                parameter["value"] = 0.0
            data["contact"] = puppet.touching is not None
            for key in ("pose", "obstacles", "floor", "rig", "rigs"):
                data.pop(key, None)
            shapes = (shape for body in data["bodies"] for shape in body.get("shapes", ()))
            for item in (*data.get("strings", ()), *shapes):
                item.pop("colour", None)
        return dump.canonical(data, meshes)
