"""A puppet that is being made of a model: its parts, names and report."""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from fantoccini.base import Array, ExchangeError, FileError, Mistake, Quaternion
from fantoccini.base.documents import Located
from fantoccini.model.meshes import MeshFile
from fantoccini.model.puppet import QUANTITIES, AnyShape, Puppet, Shape, dump
from fantoccini.output.exchange.imported import MAX_NAME, Imported, ImportNote, plain_name
from fantoccini.output.exchange.model_file import ModelFile

RESERVED = ("world", "floor")
"""Names that a puppet's parts cannot have."""

_WHOLE = 1e15  # Size from which whole numbers keep their point
_NAMED = 8  # Elements of the same kind that a comment names
_SHAPES: TypeAdapter[Any] = TypeAdapter(AnyShape)

_NAMES = (
    re.compile(r'^  - \{?name: "?([\w-]+)'),
    re.compile(r'joint: \{(?:type: \w+, )?name: "?([\w-]+)'),
    re.compile(r'^ {6}name: "?([\w-]+)'),
)
"""Names of parts, and of joints on one line and on several."""


class Draft:
    """The parts of a puppet, and notes about what it does not have.

    Attributes:
        file: the model's.
        name: the puppet's.
        bodies, strings, springs, obstacles: plain data of a puppet file.
        pose: start values.
        top: other keys of the puppet file.
        notes: report.
        meshes: path beside the puppet file -> content.
        mesh_paths: what tells a mesh of the model from others -> path.
        mesh_files: path of a mesh of the model -> what was read, or why it is left out.
        sources: files that were read besides the model's.
        joints: names of joints, in the model's order.

    Args:
        file: the model's.
        name: the model's own; the file's name where it has none.
    """

    def __init__(self, file: ModelFile, name: str):
        self.file = file
        self.name = plain_name(name) or plain_name(file.path.stem) or "puppet"
        self.bodies: list[dict[str, Any]] = []
        self.strings: list[dict[str, Any]] = []
        self.springs: list[dict[str, Any]] = []
        self.obstacles: list[dict[str, Any]] = []
        self.pose: dict[str, Any] = {}
        self.top: dict[str, Any] = {}
        self.notes: list[ImportNote] = []
        self.meshes: dict[str, bytes] = {}
        self.mesh_paths: dict[Hashable, str] = {}
        self.mesh_files: dict[Path, MeshFile | str] = {}
        self.sources: list[Path] = []
        self.joints: list[str] = []
        self._taken = set(RESERVED)
        self._next: dict[str, int] = {}
        self._given: dict[str, tuple[str, str, int | None]] = {}

    def note(
        self, kind: str, name: str, message: str, line: int | None = None, part: str = ""
    ) -> None:
        """Adds a line to the report."""
        place = self.file.place(line)
        self.notes.append(ImportNote(*place, kind, shown(name), printable(message), part))

    def take(
        self, kind: str, name: str, instead: str = "", line: int | None = None, end: str = ""
    ) -> str:
        """A name for a part, which no other part has; the report says if it is a new one.

        Args:
            kind, name: of the element in the model.
            instead: for elements without a name.
            line: of the element.
            end: of the part's name, where an element is several parts.
        """
        base = (plain_name(name) or plain_name(instead) or kind)[: MAX_NAME - len(end)] + end
        found, k = base, self._next.get(base, 2)
        while found in self._taken:
            tail = f"_{k}"
            found, k = base[: MAX_NAME - len(tail)] + tail, k + 1
        self._next[base] = k
        self._taken.add(found)
        self._given[found] = kind, shown(name or found), line
        if name and found != name + end:
            self.note(kind, name, f"is called {found} here", line, found)
        return found

    def joint_name(self, body: str, name: str, line: int | None = None) -> dict[str, str]:
        """The key ``name`` of a joint, which may have the name of its body."""
        if not name or name == body:
            self.joints.append(body)
            return {}
        own = self.take("joint", name, line=line)
        self.joints.append(own)
        return {"name": own}

    def mesh(self, name: str, content: bytes, ending: str = "stl") -> str:
        """Adds a mesh file; its path."""
        stem = plain_name(name) or "mesh"
        folder, k = f"{self.name}_meshes", 1
        path, there = f"{folder}/{stem}.{ending}", {known.lower() for known in self.meshes}
        while path.lower() in there:
            k += 1
            path = f"{folder}/{stem}_{k}.{ending}"
        self.meshes[path] = content
        return path

    def finish(self, head: Sequence[str]) -> Imported:
        """The puppet file.

        Args:
            head: lines of the comment at its beginning.

        Raises:
            ExchangeError: the model has what no puppet can have.
        """
        self._leave_out_shapes()
        data: dict[str, Any] = {"puppet": self.name, **self.top, "bodies": self.bodies}
        for key in ("strings", "springs", "pose", "obstacles"):
            if found := getattr(self, key):
                data[key] = found
        self._check(data)
        files = list(dict.fromkeys((self.file.name, *(name for name, _ in self.file.origins))))
        self.notes.sort(key=lambda n: (n.line is None, files.index(n.file), n.line or 0))
        text, rest = _with_comments(dump.to_yaml(data), self.notes)
        lines = (*head, *_summary(rest))
        comment = "".join(f"# {printable(line)}".rstrip() + "\n" for line in lines)
        sources = self.file.path, *self.file.others, *self.sources
        return Imported(comment + text, tuple(self.notes), self.meshes, tuple(self.joints), sources)

    @contextmanager
    def shapes(self) -> Iterator[Callable[[dict[str, Any]], Shape | None]]:
        """A function from plain data to shapes; None for shapes that no puppet file can have."""
        with self._located() as located:

            def read(shape: dict[str, Any]) -> Shape | None:
                try:
                    return _validated(shape, located)
                except ValidationError:
                    return None

            yield read

    @contextmanager
    def _located(self) -> Iterator[Located]:
        """A temporary folder with the meshes, from which shapes are read."""
        with TemporaryDirectory() as folder:
            for path, content in self.meshes.items():
                place = Path(folder) / path
                place.parent.mkdir(exist_ok=True)
                place.write_bytes(content)
            yield Located(None, self.file.name, Path(folder))

    def _leave_out_shapes(self) -> None:
        """Takes out, with a note, the shapes that a puppet file cannot have, and unused meshes."""
        with self._located() as located:

            def fits(shape: dict[str, Any], part: str, body: str) -> bool:
                try:
                    _validated(shape, located)
                except ValidationError as error:
                    kind, name, line = self._given[part]
                    text = f"has a {shape['type']}, left out: {error.errors()[0]['msg']}"
                    text = text.replace(str(located.folder), "the model")
                    self.note(kind, name, text, line, body)
                    return False
                return True

            for body in self.bodies:
                name = body["name"]
                shapes = [s for s in body.pop("shapes", ()) if fits(s, name, name)]
                body |= {"shapes": shapes} if shapes else {}
            self.obstacles = [o for o in self.obstacles if fits(o, o["name"], "")]
        used = {s.get("file") for b in self.bodies for s in b.get("shapes", ())}
        used |= {obstacle.get("file") for obstacle in self.obstacles}
        self.meshes = {path: content for path, content in self.meshes.items() if path in used}

    def _check(self, data: dict[str, Any]) -> None:
        """Raises what a puppet file could not have, at the model's lines."""
        if not self.bodies:
            raise self.file.mistake("found no bodies; a puppet has at least one")
        plain, lines = dict(data), dict[tuple[str | int, ...], int]()
        for key in ("bodies", "strings", "springs"):
            for i, part in enumerate(data.get(key, ())):
                if line := self._given[part["name"]][2]:
                    lines[key, i] = line
        plain["bodies"] = [{k: v for k, v in b.items() if k != "shapes"} for b in self.bodies]
        plain.pop("obstacles", None)  # checked, as shapes are
        located = Located(None, self.file.name, self.file.path.resolve().parent, lines)
        try:
            Puppet.model_validate(plain, context=located)
        except FileError as error:
            raise ExchangeError([self._named(m, data) for m in error.mistakes]) from None

    def _named(self, mistake: Mistake, data: dict[str, Any]) -> Mistake:
        """A mistake with the model's kind and name in place of the puppet file's key."""
        found = re.match(r"(bodies|strings|springs)\[(\d+)\]\.?(.*)", mistake.key)
        place = self.file.place(mistake.line)
        if not found:
            return Mistake(*place, mistake.key, mistake.message)
        kind, name, _ = self._given[data[found[1]][int(found[2])]["name"]]
        key = f"{kind} {name}" + (f": {found[3]}" if found[3] else "")
        return Mistake(*place, key, mistake.message)


def _validated(shape: dict[str, Any], located: Located) -> Shape:
    """A shape from its plain data, or from an obstacle's."""
    given = {key: value for key, value in shape.items() if key != "name"}
    found: Shape = _SHAPES.validate_python(given, context=located)
    return found


def number(x: float) -> float:
    """A number as it is written: all its digits, whole ones without a point."""
    found = float(x)
    return int(found) if found.is_integer() and abs(found) < _WHOLE else found


def sized(x: float, kind: str) -> float:
    """A number as it is written; 0 where it is too small for its kind of quantity."""
    return 0 if abs(x) < QUANTITIES[kind].min_size else number(x)


def numbers(values: Iterable[float], least: float = 1e-16) -> list[float]:
    """Numbers as they are written; those below ``least`` are rounding, and 0."""
    return [0 if abs(x) < least else number(float(x)) for x in values]


def turned(turn: Quaternion) -> dict[str, Any]:
    """An orientation; none for the identity."""
    w, *xyz = numbers(turn)
    return {} if abs(w) == 1.0 and not any(xyz) else {"quaternion": [w, *xyz]}


def placed(at: Array, turn: Quaternion | None = None) -> dict[str, Any]:
    """The keys ``at`` and ``orientation`` of a pose; none for the origin and the identity."""
    found: dict[str, Any] = {"at": place} if any(place := numbers(at)) else {}
    if turn is not None and (orientation := turned(turn)):
        found["orientation"] = orientation
    return found


def carried(name: str, parent: str, joint: dict[str, Any]) -> dict[str, Any]:
    """A body on a joint."""
    above = {} if parent == "world" else {"parent": parent}
    return {"name": name, **above, **({} if joint == {"type": "fixed"} else {"joint": joint})}


def six(inertia: Array) -> list[float]:
    """Moments of inertia (3, 3) as a puppet file has them."""
    least = 1e-16 * float(np.trace(inertia))
    xx, yy, zz, xy, xz, yz = numbers(inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]], least)
    return [xx, yy, zz, xy, xz, yz] if any((xy, xz, yz)) else [xx, yy, zz]


def shown(name: str) -> str:
    """A name of a model on one line, and short."""
    return printable(name)[:MAX_NAME]


def printable(text: str) -> str:
    """The text on one line, with ``?`` for what is not printed: a comment ends where it ends."""
    return "".join(c if c.isprintable() else "?" for c in text)


def _summary(notes: Sequence[ImportNote]) -> list[str]:
    """Lines of a comment about elements that stand above no part of the puppet."""
    alike: dict[tuple[str, str], list[str]] = {}
    for note in notes:
        alike.setdefault((note.kind, note.message), []).append(note.name)
    lines = ["", "Not as in the model:"] if alike else []
    for (kind, message), names in alike.items():
        told = ", ".join(name for name in names[:_NAMED] if name)
        more = len(names) - (_NAMED if told else 0)
        told += f" and {more} more" if more > 0 and told else ""
        count = f"{len(names)} x " if not told and len(names) > 1 else ""
        lines.append(f"  {count}{kind} {told}".rstrip() + f": {message}")
    return lines


def _with_comments(text: str, notes: Sequence[ImportNote]) -> tuple[str, list[ImportNote]]:
    """Writes each note above the part that it concerns; those of no part are left."""
    about: dict[str, list[ImportNote]] = {}
    for note in notes:
        about.setdefault(note.part, []).append(note)
    lines = []
    for line in text.splitlines():
        for where in _NAMES:
            if found := where.search(line):
                indent = " " * (len(line) - len(line.lstrip()))
                above = about.pop(found[1], ())
                lines += [f"{indent}# {note.what}: {note.message}" for note in above]
        lines.append(line)
    return "\n".join(lines) + "\n", [note for left in about.values() for note in left]
