"""Model files of other programs: format, elements and their lines."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from xml.parsers import expat

from fantoccini.base import ExchangeError, Mistake

MAX_BYTES = 20_000_000
"""Largest size of a model file [bytes]: far larger than files of robots."""

MAX_DEPTH = 200
"""Largest number of nested levels: programs read them by recursion."""

ROOTS = {"mujoco": "MJCF", "robot": "URDF"}
"""First element of a file -> its format."""

XACRO = "xacro:"
"""Prefix of xacro tags."""
_DECLARED = (f"{XACRO}arg", f"{XACRO}macro", f"{XACRO}property")
_SOLID_TAGS = ("visual", "collision", "material")

_MODEL_TAGS = ("link", "joint", "material")
"""Elements directly inside a robot that are part of it."""


@dataclass(frozen=True)
class Element:
    """Element of a file.

    Attributes:
        tag, attributes: tag and attributes.
        line: 1-based line.
        depth: level of nesting; 0 for the first element.
        inside: tags of the elements directly inside.
        known: whether it is part of the model, not of another program's extension.
        characters: texts of its CDATA sections.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    depth: int
    inside: set[str]
    known: bool
    characters: list[str]


@dataclass(frozen=True)
class ModelFile:
    """Model file: well-formed XML without custom entities.

    Attributes:
        name: path as the user gave it.
        path: path of the file.
        root: tag of the first element, one of :data:`ROOTS`.
        text: content; if it includes files, the merged content with one element per line.
        elements: all elements, in order; their lines refer to ``text``.
        origins: original file, as a user would name it, and line of each line of ``text``; empty
            without included files.
        others: files that it includes.
    """

    name: str
    path: Path
    root: str
    text: bytes
    elements: tuple[Element, ...]
    origins: tuple[tuple[str, int], ...] = ()
    others: tuple[Path, ...] = ()

    @cached_property
    def _lines(self) -> dict[tuple[str, str], int]:
        lines: dict[tuple[str, str], int] = {}
        for element in self.elements:
            key = element.tag, element.attributes.get("name", "")
            if element.known:
                lines.setdefault(key, element.line)
        return lines

    def line_of(self, tag: str, name: str) -> int | None:
        """Line of the first element with this tag and name."""
        return self._lines.get((tag, name))

    def place(self, line: int | None) -> tuple[str, int | None]:
        """Original file and line of a line of ``text``."""
        if line and line <= len(self.origins):
            return self.origins[line - 1]
        return self.name, None if self.origins else line or None

    def mistake(self, message: str, line: int | None = None, key: str = "") -> ExchangeError:
        """Error at a line of ``text``."""
        return ExchangeError([Mistake(*self.place(line), key, message)])


def read_model(path: str | os.PathLike[str]) -> ModelFile:
    """Reads a model file.

    Raises:
        ExchangeError: the file cannot be read, is not XML, or is neither MJCF nor URDF.
    """
    name = os.fspath(path)
    text, elements = read_elements(name)
    first = elements[0]

    def fail(message: str, line: int) -> ExchangeError:
        return ExchangeError([Mistake(name, line, "", message)])

    if first.tag not in ROOTS:
        needed = "needed: <mujoco> (MJCF) or <robot> (URDF)"
        raise fail(f"begins with <{first.tag[:60]}>; {needed}", first.line)
    for element in _macros(elements):
        raise fail("found a macro of xacro; run xacro on the file first", element.line)
    return ModelFile(name, Path(name), first.tag, text, tuple(elements))


def _macros(elements: list[Element]) -> Iterator[Element]:
    """Unexpanded xacro elements that may stand for a part of a robot, or of another model.

    Declarations and elements inside a solid or an extension do not.
    """
    ancestors: list[Element] = []
    for element in elements:
        del ancestors[element.depth :]
        inside = ROOTS.get(ancestors[0].tag) == "URDF" if ancestors else False
        harmless = inside and (
            element.tag in _DECLARED
            or any(
                a.tag in _SOLID_TAGS or a.tag.startswith(XACRO) or not a.known for a in ancestors
            )
        )
        if element.tag.startswith(XACRO) and not harmless:
            yield element
        ancestors.append(element)


def read_elements(name: str) -> tuple[bytes, list[Element]]:
    """Reads content and elements of a file.

    Raises:
        ExchangeError: the file cannot be read, or is not XML.
    """

    def fail(message: str, line: int | None = None) -> ExchangeError:
        return ExchangeError([Mistake(name, line, "", message)])

    try:
        place = Path(name)
        if not place.is_file():
            kind = "a folder" if place.is_dir() else "nothing" if not place.exists() else "no file"
            raise fail(f"found {kind} here; a file in MJCF or URDF is needed")
        with place.open("rb") as stream:
            text = stream.read(MAX_BYTES + 1)
    except (OSError, ValueError) as reason:
        raise fail(f"cannot be read: {getattr(reason, 'strerror', None) or reason}") from None
    if len(text) > MAX_BYTES:
        raise fail(f"larger than {MAX_BYTES / 1e6:g} MB, which is the limit")
    elements: list[Element] = []
    open_elements: list[Element] = []
    parser = expat.ParserCreate()

    def begin(tag: str, attributes: dict[str, str]) -> None:
        if len(open_elements) > MAX_DEPTH:
            message = f"nested deeper than {MAX_DEPTH} levels"
            raise fail(message, parser.CurrentLineNumber)
        parent = open_elements[-1] if open_elements else None
        known = parent is None or (parent.known and (parent.tag != "robot" or tag in _MODEL_TAGS))
        if parent is not None:
            parent.inside.add(tag)
        line, depth = parser.CurrentLineNumber, len(open_elements)
        element = Element(tag, attributes, line, depth, set(), known, [])
        elements.append(element)
        open_elements.append(element)

    def begin_data() -> None:
        parser.CharacterDataHandler = open_elements[-1].characters.append

    def end_data() -> None:
        parser.CharacterDataHandler = None

    def refuse(*_: object) -> None:
        message = "found a document type declaration; take it out: entities are not read"
        raise fail(message, parser.CurrentLineNumber)

    parser.StartElementHandler, parser.StartDoctypeDeclHandler = begin, refuse
    parser.EndElementHandler = lambda _: open_elements.pop()
    parser.StartCdataSectionHandler, parser.EndCdataSectionHandler = begin_data, end_data
    try:
        parser.Parse(text, True)
    except expat.ExpatError as reason:
        message = expat.errors.messages[reason.code]
        raise fail(f"is not XML: {message}", reason.lineno) from None
    except ValueError as reason:  # an unknown encoding
        raise fail(f"is not XML: {reason}") from None
    return text, elements


def line_in(message: str) -> int | None:
    """Line that a message of MuJoCo names; None without one."""
    match = re.search(r"\b[Ll]ine(?: number=| )(\d+)", message)
    return int(match[1]) or None if match else None
