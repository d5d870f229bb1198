"""Model files of other programs: format, elements and their lines.

Xacro is a macro language for URDF, the format of robots in ROS.
"""

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
_DECLARATION_TAGS = (f"{XACRO}arg", f"{XACRO}macro", f"{XACRO}property")
_LINK_CONTENT_TAGS = ("visual", "collision", "material")

_MODEL_TAGS = ("link", "joint", "material")
"""Elements directly inside a robot that are part of it."""


@dataclass(frozen=True)
class Element:
    """Element of a file.

    Attributes:
        tag, attributes: tag and attributes.
        line: 1-based line.
        depth: level of nesting; 0 for the first element.
        child_tags: tags of the elements directly inside.
        in_model: whether it is part of the model, not of another program's extension.
        characters: texts of its CDATA sections.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    depth: int
    child_tags: set[str]
    in_model: bool
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
        included_files: files that it includes.
    """

    name: str
    path: Path
    root: str
    text: bytes
    elements: tuple[Element, ...]
    origins: tuple[tuple[str, int], ...] = ()
    included_files: tuple[Path, ...] = ()

    @cached_property
    def _lines(self) -> dict[tuple[str, str], int]:
        lines: dict[tuple[str, str], int] = {}
        for element in self.elements:
            key = element.tag, element.attributes.get("name", "")
            if element.in_model:
                lines.setdefault(key, element.line)
        return lines

    def line_of(self, tag: str, name: str) -> int | None:
        """Line of the first element with this tag and name."""
        return self._lines.get((tag, name))

    def file_and_line(self, line: int | None) -> tuple[str, int | None]:
        """Original file and line of a line of ``text``."""
        if line and line <= len(self.origins):
            return self.origins[line - 1]
        return self.name, None if self.origins else line or None

    def error_at(self, message: str, line: int | None = None, key: str = "") -> ExchangeError:
        """Error at a line of ``text``."""
        return ExchangeError([Mistake(*self.file_and_line(line), key, message)])


def read_model(path: str | os.PathLike[str]) -> ModelFile:
    """Reads a model file.

    Raises:
        ExchangeError: the file cannot be read, is not XML, or is neither MJCF nor URDF.
    """
    name = os.fspath(path)
    text, elements = read_elements(name)
    root = elements[0]

    def make_error(message: str, line: int) -> ExchangeError:
        return ExchangeError([Mistake(name, line, "", message)])

    if root.tag not in ROOTS:
        needed = "needed: <mujoco> (MJCF) or <robot> (URDF)"
        raise make_error(f"begins with <{root.tag[:60]}>; {needed}", root.line)
    for element in _unexpanded_macros(elements):
        raise make_error("found a macro of xacro; run xacro on the file first", element.line)
    return ModelFile(name, Path(name), root.tag, text, tuple(elements))


def _unexpanded_macros(elements: list[Element]) -> Iterator[Element]:
    """Unexpanded xacro elements that may stand for a part of a robot, or of another model.

    Declarations and elements inside a solid or an extension do not.
    """
    ancestors: list[Element] = []
    for element in elements:
        del ancestors[element.depth :]
        in_robot = ROOTS.get(ancestors[0].tag) == "URDF" if ancestors else False
        harmless = in_robot and (
            element.tag in _DECLARATION_TAGS
            or any(
                a.tag in _LINK_CONTENT_TAGS or a.tag.startswith(XACRO) or not a.in_model
                for a in ancestors
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

    def make_error(message: str, line: int | None = None) -> ExchangeError:
        return ExchangeError([Mistake(name, line, "", message)])

    try:
        file_path = Path(name)
        if not file_path.is_file():
            found_kind = (
                "a folder"
                if file_path.is_dir()
                else "nothing"
                if not file_path.exists()
                else "no file"
            )
            raise make_error(f"found {found_kind} here; a file in MJCF or URDF is needed")
        with file_path.open("rb") as stream:
            text = stream.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        raise make_error(f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(text) > MAX_BYTES:
        raise make_error(f"larger than {MAX_BYTES / 1e6:g} MB, which is the limit")
    elements: list[Element] = []
    open_elements: list[Element] = []
    parser = expat.ParserCreate()

    def handle_start(tag: str, attributes: dict[str, str]) -> None:
        if len(open_elements) > MAX_DEPTH:
            message = f"nested deeper than {MAX_DEPTH} levels"
            raise make_error(message, parser.CurrentLineNumber)
        parent = open_elements[-1] if open_elements else None
        in_model = parent is None or (
            parent.in_model and (parent.tag != "robot" or tag in _MODEL_TAGS)
        )
        if parent is not None:
            parent.child_tags.add(tag)
        line, depth = parser.CurrentLineNumber, len(open_elements)
        element = Element(tag, attributes, line, depth, set(), in_model, [])
        elements.append(element)
        open_elements.append(element)

    def handle_data_start() -> None:
        parser.CharacterDataHandler = open_elements[-1].characters.append

    def handle_data_end() -> None:
        parser.CharacterDataHandler = None

    def refuse_doctype(*_: object) -> None:
        message = "found a document type declaration; take it out: entities are not read"
        raise make_error(message, parser.CurrentLineNumber)

    parser.StartElementHandler, parser.StartDoctypeDeclHandler = handle_start, refuse_doctype
    parser.EndElementHandler = lambda _: open_elements.pop()
    parser.StartCdataSectionHandler, parser.EndCdataSectionHandler = (
        handle_data_start,
        handle_data_end,
    )
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        message = expat.errors.messages[error.code]
        raise make_error(f"is not XML: {message}", error.lineno) from None
    except ValueError as error:  # an unknown encoding
        raise make_error(f"is not XML: {error}") from None
    return text, elements


def line_in_message(message: str) -> int | None:
    """Line that a message of MuJoCo names; None without one."""
    match = re.search(r"\b[Ll]ine(?: number=| )(\d+)", message)
    return int(match[1]) or None if match else None
