"""The names of a puppet's parts and of their twins, and the list of mistakes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fantoccini.base import nearest
from fantoccini.base.documents import LIMITS, Finding, Path, owner_of
from fantoccini.model.puppet.mirror import twin_name

_SECTIONS = ("bodies", "strings", "springs", "obstacles")


def named(puppet: Any) -> Iterator[tuple[str, Path]]:
    """Names and key paths of bodies, named joints, strings, springs and obstacles.

    Args:
        puppet: a :class:`Puppet`, possibly with ``UNCLEAR`` parts.
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
        found: paths and messages of mistakes.
        owner: name -> its path; filled by the check of names.
        rule: the two words of the mirror, or None.
        bodies: name of a body -> its index.
        known: names of all bodies, twins included.
        joint_of: body -> name of its joint.
    """

    def __init__(self, puppet: Any, data: dict[str, Any]):
        self.puppet, self._hints = puppet, 0
        pose = data.get("pose")
        self.pose: dict[str, Any] = pose if isinstance(pose, dict) else {}
        self.found: list[Finding] = []
        self.owner: dict[str, Path] = {}
        rule = puppet.mirror
        self.rule = (rule.from_, rule.to) if rule and rule.from_ and rule.to else None
        self.bodies = {b.name: i for i, b in enumerate(puppet.bodies) if isinstance(b.name, str)}
        self.known = set(self.bodies) | {self.twin(name) for name in self.bodies}
        self.joint_of: dict[str, str] = {}
        for name, i in self.bodies.items():
            joint = puppet.bodies[i].joint.name
            if isinstance(joint, str):
                self.joint_of |= {self.twin(name): self.twin(joint), name: joint}

    def say(self, path: Path, message: str) -> None:
        """Adds a mistake."""
        self.found.append((path, message))

    def twin(self, name: str) -> str:
        """The name of the twin, or the name itself if it is not mirrored."""
        return twin_name(name, *self.rule) if self.rule else name

    def split(self, coordinate: str) -> tuple[str, str]:
        """The owner of a coordinate, and the rest of the name after the dot."""
        owner = owner_of(coordinate, tuple(self.puppet.members))
        return owner, coordinate[len(owner) + 1 :]

    def near(self, name: str, allowed: set[str]) -> str:
        """The end of a message with the most similar name; empty above the limits (slow search)."""
        self._hints += 1
        within = self._hints <= LIMITS.max_hints and len(allowed) <= LIMITS.max_hint_names
        return nearest(name[:64], allowed) if within else ""
