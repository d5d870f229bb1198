"""Draft of the puppet that a model is converted to: parts, names and report.

A note tells a difference between the model and its puppet.
"""

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
from fantoccini.output.exchange.imported import (
    MAX_NAME_LENGTH,
    ImportedPuppet,
    ImportNote,
    valid_name,
)
from fantoccini.output.exchange.model_file import ModelFile

RESERVED = ("world", "floor")
"""Names that parts of a puppet cannot have."""

_MAX_INTEGER = 1e15  # Larger whole numbers are written with a decimal point
_MAX_LISTED_NAMES = 8  # Largest number of elements of one kind that a comment names
_SHAPES: TypeAdapter[Any] = TypeAdapter(AnyShape)

_NAME_PATTERNS = (
    re.compile(r'^  - \{?name: "?([\w-]+)'),
    re.compile(r'joint: \{(?:type: \w+, )?name: "?([\w-]+)'),
    re.compile(r'^ {6}name: "?([\w-]+)'),
)
"""Patterns of names: of parts, of joints on one line, and of joints on several lines."""


class Draft:
    """Parts of a puppet, and notes about differences from the model.

    Attributes:
        file: file of the model.
        name: name of the puppet.
        bodies, strings, springs, obstacles: data of the puppet file.
        pose: start values.
        other_keys: other keys of the puppet file.
        notes: notes of the report.
        meshes: path relative to the puppet file -> content.
        mesh_paths: key that identifies a mesh of the model -> path.
        mesh_files: path of a mesh of the model -> its content, or the reason to leave it out.
        sources: files that were read besides the model's.
        joints: names of joints, in the model's order.

    Args:
        file: file of the model.
        name: name of the model; if it is empty, the file's name is used.
    """

    def __init__(self, file: ModelFile, name: str):
        self.file = file
        self.name = valid_name(name) or valid_name(file.path.stem) or "puppet"
        self.bodies: list[dict[str, Any]] = []
        self.strings: list[dict[str, Any]] = []
        self.springs: list[dict[str, Any]] = []
        self.obstacles: list[dict[str, Any]] = []
        self.pose: dict[str, Any] = {}
        self.other_keys: dict[str, Any] = {}
        self.notes: list[ImportNote] = []
        self.meshes: dict[str, bytes] = {}
        self.mesh_paths: dict[Hashable, str] = {}
        self.mesh_files: dict[Path, MeshFile | str] = {}
        self.sources: list[Path] = []
        self.joints: list[str] = []
        self._used_names = set(RESERVED)
        self._next_suffix: dict[str, int] = {}
        self._elements: dict[str, tuple[str, str, int | None]] = {}

    def note(
        self, kind: str, name: str, message: str, line: int | None = None, part: str = ""
    ) -> None:
        """Adds a note to the report."""
        file_and_line = self.file.file_and_line(line)
        self.notes.append(
            ImportNote(*file_and_line, kind, short_name(name), replace_unprintable(message), part)
        )

    def unique_name(
        self, kind: str, name: str, fallback: str = "", line: int | None = None, suffix: str = ""
    ) -> str:
        """Unique name for a part; if it differs from the model's, the report notes it.

        Args:
            kind, name: kind and name of the element in the model.
            fallback: replacement for an empty name.
            line: line of the element.
            suffix: suffix of the part's name, if an element becomes several parts.
        """
        base = (valid_name(name) or valid_name(fallback) or kind)[
            : MAX_NAME_LENGTH - len(suffix)
        ] + suffix
        unique, k = base, self._next_suffix.get(base, 2)
        while unique in self._used_names:
            tail = f"_{k}"
            unique, k = base[: MAX_NAME_LENGTH - len(tail)] + tail, k + 1
        self._next_suffix[base] = k
        self._used_names.add(unique)
        self._elements[unique] = kind, short_name(name or unique), line
        if name and unique != name + suffix:
            self.note(kind, name, f"is called {unique} here", line, unique)
        return unique

    def joint_name(self, body: str, name: str, line: int | None = None) -> dict[str, str]:
        """Key ``name`` of a joint; none if the joint has the name of its body."""
        if not name or name == body:
            self.joints.append(body)
            return {}
        unique = self.unique_name("joint", name, line=line)
        self.joints.append(unique)
        return {"name": unique}

    def mesh(self, name: str, content: bytes, ending: str = "stl") -> str:
        """Adds a mesh file; returns its path."""
        stem = valid_name(name) or "mesh"
        folder, k = f"{self.name}_meshes", 1
        path, paths = f"{folder}/{stem}.{ending}", {used.lower() for used in self.meshes}
        while path.lower() in paths:
            k += 1
            path = f"{folder}/{stem}_{k}.{ending}"
        self.meshes[path] = content
        return path

    def finish(self, header: Sequence[str]) -> ImportedPuppet:
        """The complete puppet file.

        Args:
            header: lines of the comment at the top.

        Raises:
            ExchangeError: the model has something that no puppet can have.
        """
        self._leave_out_shapes()
        data: dict[str, Any] = {"puppet": self.name, **self.other_keys, "bodies": self.bodies}
        for key in ("strings", "springs", "pose", "obstacles"):
            if parts := getattr(self, key):
                data[key] = parts
        self._check(data)
        files = list(dict.fromkeys((self.file.name, *(name for name, _ in self.file.origins))))
        self.notes.sort(key=lambda n: (n.line is None, files.index(n.file), n.line or 0))
        text, notes_without_part = _with_comments(dump.to_yaml(data), self.notes)
        lines = (*header, *_comment_lines(notes_without_part))
        comment = "".join(f"# {replace_unprintable(line)}".rstrip() + "\n" for line in lines)
        sources = self.file.path, *self.file.included_files, *self.sources
        return ImportedPuppet(
            comment + text, tuple(self.notes), self.meshes, tuple(self.joints), sources
        )

    @contextmanager
    def shape_reader(self) -> Iterator[Callable[[dict[str, Any]], Shape | None]]:
        """Function from data to shapes; it returns None for shapes that no puppet file can have."""
        with self._located_meshes() as located:

            def read_shape(shape: dict[str, Any]) -> Shape | None:
                try:
                    return _validate_shape(shape, located)
                except ValidationError:
                    return None

            yield read_shape

    @contextmanager
    def _located_meshes(self) -> Iterator[Located]:
        """Temporary folder with the meshes, from which shapes are read."""
        with TemporaryDirectory() as folder:
            for path, content in self.meshes.items():
                mesh_path = Path(folder) / path
                mesh_path.parent.mkdir(exist_ok=True)
                mesh_path.write_bytes(content)
            yield Located(None, self.file.name, Path(folder))

    def _leave_out_shapes(self) -> None:
        """Removes shapes that a puppet file cannot have, with a note each, and unused meshes."""
        with self._located_meshes() as located:

            def is_valid(shape: dict[str, Any], part: str, body: str) -> bool:
                try:
                    _validate_shape(shape, located)
                except ValidationError as error:
                    kind, name, line = self._elements[part]
                    text = f"has a {shape['type']}, left out: {error.errors()[0]['msg']}"
                    text = text.replace(str(located.folder), "the model")
                    self.note(kind, name, text, line, body)
                    return False
                return True

            for body in self.bodies:
                name = body["name"]
                shapes = [s for s in body.pop("shapes", ()) if is_valid(s, name, name)]
                body |= {"shapes": shapes} if shapes else {}
            self.obstacles = [o for o in self.obstacles if is_valid(o, o["name"], "")]
        used = {s.get("file") for b in self.bodies for s in b.get("shapes", ())}
        used |= {obstacle.get("file") for obstacle in self.obstacles}
        self.meshes = {path: content for path, content in self.meshes.items() if path in used}

    def _check(self, data: dict[str, Any]) -> None:
        """Raises errors, at the model's lines, for everything that a puppet file cannot have."""
        if not self.bodies:
            raise self.file.error_at("found no bodies; a puppet has at least one")
        checked_data, lines = dict(data), dict[tuple[str | int, ...], int]()
        for key in ("bodies", "strings", "springs"):
            for i, part in enumerate(data.get(key, ())):
                if line := self._elements[part["name"]][2]:
                    lines[key, i] = line
        checked_data["bodies"] = [
            {k: v for k, v in b.items() if k != "shapes"} for b in self.bodies
        ]
        checked_data.pop("obstacles", None)  # checked already, like shapes
        located = Located(None, self.file.name, self.file.path.resolve().parent, lines)
        try:
            Puppet.model_validate(checked_data, context=located)
        except FileError as error:
            raise ExchangeError([self._with_model_name(m, data) for m in error.mistakes]) from None

    def _with_model_name(self, mistake: Mistake, data: dict[str, Any]) -> Mistake:
        """The mistake, with the model's kind and name in place of the puppet file's key."""
        match = re.match(r"(bodies|strings|springs)\[(\d+)\]\.?(.*)", mistake.key)
        file_and_line = self.file.file_and_line(mistake.line)
        if not match:
            return Mistake(*file_and_line, mistake.key, mistake.message)
        kind, name, _ = self._elements[data[match[1]][int(match[2])]["name"]]
        key = f"{kind} {name}" + (f": {match[3]}" if match[3] else "")
        return Mistake(*file_and_line, key, mistake.message)


def _validate_shape(shape: dict[str, Any], located: Located) -> Shape:
    """Shape from its data, or from an obstacle's."""
    keys = {key: value for key, value in shape.items() if key != "name"}
    validated: Shape = _SHAPES.validate_python(keys, context=located)
    return validated


def written_number(x: float) -> float:
    """A number as it is written: with all digits; whole numbers without a decimal point."""
    value = float(x)
    return int(value) if value.is_integer() and abs(value) < _MAX_INTEGER else value


def number_or_zero(x: float, kind: str) -> float:
    """A number as it is written; 0 if it is too small for its kind of quantity."""
    return 0 if abs(x) < QUANTITIES[kind].min_size else written_number(x)


def written_numbers(values: Iterable[float], min_size: float = 1e-16) -> list[float]:
    """Numbers as they are written; those below ``min_size`` are rounding errors and become 0."""
    return [0 if abs(x) < min_size else written_number(float(x)) for x in values]


def orientation_keys(quaternion: Quaternion) -> dict[str, Any]:
    """Keys of an orientation; none for the identity."""
    w, *xyz = written_numbers(quaternion)
    return {} if abs(w) == 1.0 and not any(xyz) else {"quaternion": [w, *xyz]}


def pose_keys(position: Array, quaternion: Quaternion | None = None) -> dict[str, Any]:
    """Keys ``position`` and ``orientation`` of a pose; none for the origin and the identity."""
    keys: dict[str, Any] = (
        {"at": coordinates} if any(coordinates := written_numbers(position)) else {}
    )
    if quaternion is not None and (orientation := orientation_keys(quaternion)):
        keys["orientation"] = orientation
    return keys


def body_data(name: str, parent: str, joint: dict[str, Any]) -> dict[str, Any]:
    """Data of a body on a joint."""
    parent_key = {} if parent == "world" else {"parent": parent}
    return {"name": name, **parent_key, **({} if joint == {"type": "fixed"} else {"joint": joint})}


def inertia_data(inertia: Array) -> list[float]:
    """Inertia (3, 3) as in a puppet file: moments, then products unless they are zero."""
    min_size = 1e-16 * float(np.trace(inertia))
    xx, yy, zz, xy, xz, yz = written_numbers(
        inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]], min_size
    )
    return [xx, yy, zz, xy, xz, yz] if any((xy, xz, yz)) else [xx, yy, zz]


def short_name(name: str) -> str:
    """A name of a model, on one line and shortened."""
    return replace_unprintable(name)[:MAX_NAME_LENGTH]


def replace_unprintable(text: str) -> str:
    """The text with ``?`` for unprintable characters, so that it cannot end a comment."""
    return "".join(c if c.isprintable() else "?" for c in text)


def _comment_lines(notes: Sequence[ImportNote]) -> list[str]:
    """Lines of the comment with notes that belong to no part of the puppet."""
    names_by_message: dict[tuple[str, str], list[str]] = {}
    for note in notes:
        names_by_message.setdefault((note.kind, note.message), []).append(note.name)
    lines = ["", "Not as in the model:"] if names_by_message else []
    for (kind, message), names in names_by_message.items():
        names_text = ", ".join(name for name in names[:_MAX_LISTED_NAMES] if name)
        n_more = len(names) - (_MAX_LISTED_NAMES if names_text else 0)
        names_text += f" and {n_more} more" if n_more > 0 and names_text else ""
        count = f"{len(names)} x " if not names_text and len(names) > 1 else ""
        lines.append(f"  {count}{kind} {names_text}".rstrip() + f": {message}")
    return lines


def _with_comments(text: str, notes: Sequence[ImportNote]) -> tuple[str, list[ImportNote]]:
    """The text with each note above the part that it concerns; and the notes without a part."""
    notes_by_part: dict[str, list[ImportNote]] = {}
    for note in notes:
        notes_by_part.setdefault(note.part, []).append(note)
    lines = []
    for line in text.splitlines():
        for pattern in _NAME_PATTERNS:
            if match := pattern.search(line):
                indent = " " * (len(line) - len(line.lstrip()))
                part_notes = notes_by_part.pop(match[1], ())
                lines += [f"{indent}# {note.what}: {note.message}" for note in part_notes]
        lines.append(line)
    return "\n".join(lines) + "\n", [
        note for remaining in notes_by_part.values() for note in remaining
    ]
