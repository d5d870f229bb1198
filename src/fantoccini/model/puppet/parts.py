"""The names of a puppet's parts and of their twins, and the list of mistakes.

A twin is the mirror image of a body, joint or string, and a mistake an error with its place in the
file.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

from fantoccini.base import did_you_mean
from fantoccini.base.documents import LIMITS, Finding, Path, owner_of
from fantoccini.model.puppet.contact import ContactRule
from fantoccini.model.puppet.drive import Drive
from fantoccini.model.puppet.elements import Body, Mirror, Spring, String
from fantoccini.model.puppet.mirror import twin_name
from fantoccini.model.puppet.rig import Rig
from fantoccini.model.puppet.shapes import AnyObstacle

_SECTIONS = ("bodies", "strings", "springs", "obstacles")


class AnyPuppet(Protocol):
    """A :class:`Puppet` that may have invalid parts: any value may be ``UNCLEAR``."""

    @property
    def bodies(self) -> tuple[Body, ...]:
        """Bodies, in any order."""

    @property
    def strings(self) -> tuple[String, ...]:
        """Strings."""

    @property
    def springs(self) -> tuple[Spring, ...]:
        """Springs."""

    @property
    def drives(self) -> tuple[Drive, ...]:
        """Drives of driven coordinates."""

    @property
    def obstacles(self) -> tuple[AnyObstacle, ...]:
        """Shapes fixed in the world."""

    @property
    def mirror(self) -> Mirror | None:
        """Reflection of one half into the other."""

    @property
    def contact(self) -> ContactRule | None:
        """Rules of contact."""

    @property
    def rig(self) -> Rig | None:
        """Its body map, as far as the file gives it."""

    @property
    def members(self) -> tuple[str, ...]:
        """Puppets of an assembled scene."""

    @property
    def props(self) -> tuple[str, ...]:
        """Props of an assembled scene."""


def named_parts(puppet: AnyPuppet) -> Iterator[tuple[str, Path]]:
    """Names and paths of bodies, strings, springs, obstacles and joints not called like a body.

    Args:
        puppet: puppet that may have invalid parts.
    """
    for key in _SECTIONS:
        for i, item in enumerate(getattr(puppet, key)):
            if isinstance(item.name, str):
                yield item.name, (key, i, "name")
            joint = item.joint.name if key == "bodies" else None
            if isinstance(joint, str) and joint != item.name:
                yield joint, (key, i, "joint", "name")


class Parts:
    """A :class:`Puppet` whose invalid parts are ``UNCLEAR``, its names and twins, and mistakes.

    Attributes:
        puppet: puppet to check.
        pose: start values of its file.
        mistakes: paths and messages of mistakes.
        path_of: name -> path of its key; filled by the check of names.
        mirror_words: the two words of the mirror, or None.
        bodies: name of a body -> its index.
        body_names: names of all bodies, twins included.
        joint_of: body -> name of its joint.
    """

    def __init__(self, puppet: AnyPuppet, data: dict[str, Any]):
        self.puppet, self._hints = puppet, 0
        pose = data.get("pose")
        self.pose: dict[str, Any] = pose if isinstance(pose, dict) else {}
        self.mistakes: list[Finding] = []
        self.path_of: dict[str, Path] = {}
        mirror = puppet.mirror
        self.mirror_words = (
            (mirror.from_, mirror.to) if mirror and mirror.from_ and mirror.to else None
        )
        self.bodies = {b.name: i for i, b in enumerate(puppet.bodies) if isinstance(b.name, str)}
        self.body_names = set(self.bodies) | {self.twin(name) for name in self.bodies}
        self.joint_of: dict[str, str] = {}
        for name, i in self.bodies.items():
            joint = puppet.bodies[i].joint.name
            if isinstance(joint, str):
                self.joint_of |= {self.twin(name): self.twin(joint), name: joint}

    def add_mistake(self, path: Path, message: str) -> None:
        """Adds a mistake."""
        self.mistakes.append((path, message))

    def twin(self, name: str) -> str:
        """The name of the twin, or the name itself if it is not mirrored."""
        return twin_name(name, *self.mirror_words) if self.mirror_words else name

    def split_coordinate(self, coordinate: str) -> tuple[str, str]:
        """The owner of a coordinate, and the rest of the name after the dot."""
        owner = owner_of(coordinate, tuple(self.puppet.members))
        return owner, coordinate[len(owner) + 1 :]

    def hint(self, name: str, allowed: set[str]) -> str:
        """The end of a message, with the most similar name; empty if the search would be slow."""
        self._hints += 1
        is_quick = self._hints <= LIMITS.max_hints and len(allowed) <= LIMITS.max_hint_names
        return did_you_mean(name[:64], allowed) if is_quick else ""
