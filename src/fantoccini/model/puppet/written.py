"""A puppet's plain data as written, of any form, with its names and mistakes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fantoccini.base import nearest
from fantoccini.base.documents import LIMITS, Located, Path, owner_of
from fantoccini.model.puppet.mirror import twin_name

_SECTIONS = ("bodies", "strings", "springs", "obstacles")


def parameters(data: Any) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Every ``{parameter: ..., value: ...}`` with its place, in file order."""
    stack: list[tuple[Path, Any]] = [((), data)]
    while stack:
        path, value = stack.pop()
        if isinstance(value, dict):
            if isinstance(value.get("parameter"), str) and is_number(value.get("value")):
                yield path, value
            stack.extend(((*path, k), v) for k, v in reversed(value.items()))
        elif isinstance(value, list):
            stack.extend(((*path, k), v) for k, v in reversed(list(enumerate(value))))


def name_lines(data: dict[str, Any], located: Located) -> dict[str, int]:
    """Line of every name, for later messages."""
    places = [(name, located.line(path)) for name, path in named(data)]
    return {name: line for name, line in places if line is not None}


def is_number(value: Any) -> bool:
    """Whether a value is a number; true and false are not."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def items(data: Any, key: str) -> list[tuple[int, dict[str, Any]]]:
    """The mappings in a list under a key, with their places."""
    section = data.get(key) if isinstance(data, dict) else None
    if not isinstance(section, list):
        return []
    return [(i, item) for i, item in enumerate(section) if isinstance(item, dict)]


def word(item: Any, key: str) -> str | None:
    """The text under a key, or None."""
    value = item.get(key) if isinstance(item, dict) else None
    return value if isinstance(value, str) else None


def named(data: dict[str, Any]) -> Iterator[tuple[str, Path]]:
    """Names of bodies, joints that have their own, strings, springs, obstacles; and where."""
    for key in _SECTIONS:
        for i, item in items(data, key):
            name = word(item, "name")
            if name is not None:
                yield name, (key, i, "name")
            joint = word(item.get("joint"), "name")
            if key == "bodies" and joint is not None and joint != name:
                yield joint, (key, i, "joint", "name")


class Written:
    """A puppet's plain data, its names and those of twins, and the mistakes found.

    Attributes:
        data: the plain data.
        found: paths and messages.
        owner: name -> its path; filled by the check of names.
        rule: the mirror's two words, or None.
        bodies: name of a body in the file -> its index.
        known: names of all bodies, twins included.
        joint_of: body -> the name of its joint.
        members: names that may precede others, with a dot.
    """

    def __init__(self, data: dict[str, Any]):
        self.data, self._hints = data, 0
        self.found: list[tuple[Path, str]] = []
        self.owner: dict[str, Path] = {}
        members = data.get("members")
        listed = members if isinstance(members, list) else []
        self.members = tuple(m for m in listed if isinstance(m, str))
        rule = data.get("mirror")
        token, twin = word(rule, "from") or word(rule, "from_"), word(rule, "to")
        self.rule = (token, twin) if token and twin else None
        self.bodies = {n: i for i, b in items(data, "bodies") if (n := word(b, "name"))}
        self.known = set(self.bodies) | {self.twin(n) for n in self.bodies}
        self.joint_of: dict[str, str] = {}
        for _, body in items(data, "bodies"):
            name, joint = word(body, "name"), word(body.get("joint"), "name")
            if name is not None and joint is not None:
                self.joint_of |= {self.twin(name): self.twin(joint), name: joint}

    def say(self, path: Path, message: str) -> None:
        """Notes a mistake."""
        self.found.append((path, message))

    def twin(self, name: str) -> str:
        """The name of the twin, or the name itself if nothing mirrors it."""
        return twin_name(name, *self.rule) if self.rule else name

    def split(self, coordinate: str) -> tuple[str, str]:
        """The owner of a coordinate, and what follows the dot after it."""
        owner = owner_of(coordinate, self.members)
        return owner, coordinate[len(owner) + 1 :]

    def near(self, name: str, allowed: set[str]) -> str:
        """Hint of the nearest name; empty beyond the limits, since the search is slow."""
        self._hints += 1
        few = self._hints <= LIMITS.max_hints and len(allowed) <= LIMITS.max_hint_names
        return nearest(name[:64], allowed) if few else ""
