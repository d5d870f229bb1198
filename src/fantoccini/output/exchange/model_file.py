"""Model files of other programs: what they are, and where their elements stand."""

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
"""Size of a model file [bytes]: far beyond those of robots."""

MAX_DEPTH = 200
"""Levels of nesting: programs read them by recursion."""

ROOTS = {"mujoco": "MJCF", "robot": "URDF"}
"""First element of a file -> its format."""

XACRO = "xacro:"
"""Begins the tags of xacro."""
_DECLARED = (f"{XACRO}arg", f"{XACRO}macro", f"{XACRO}property")
_LOOKS = ("visual", "collision", "material")

_MODEL = ("link", "joint", "material")
"""Elements directly inside a robot that are part of it."""


@dataclass(frozen=True)
class Element:
    """An element of a file.

    Attributes:
        tag, attributes: its own.
        line: 1-based.
        depth: 0 for the first element.
        inside: tags of the elements directly inside.
        known: whether it is part of the model, not of another program's extension.
        characters: of its CDATA sections.
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
    """A model file that is well-formed XML, without entities of its own.

    Attributes:
        name: as the user gave it.
        path: of the file.
        root: tag of its first element, one of :data:`ROOTS`.
        text: content; with the files that it includes, if it does, one element a line.
        elements: all elements, in order; their lines are those of ``text``.
        origins: of each line of ``text`` the file, as a user would name it, and its line there;
            empty where it is the file's own.
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
        found: dict[tuple[str, str], int] = {}
        for element in self.elements:
            key = element.tag, element.attributes.get("name", "")
            if element.known:
                found.setdefault(key, element.line)
        return found

    def line_of(self, tag: str, name: str) -> int | None:
        """Line of an element with a name; of several the first."""
        return self._lines.get((tag, name))

    def place(self, line: int | None) -> tuple[str, int | None]:
        """The file in which a line of ``text`` stands, and its line there."""
        if line and line <= len(self.origins):
            return self.origins[line - 1]
        return self.name, None if self.origins else line or None

    def mistake(self, message: str, line: int | None = None, key: str = "") -> ExchangeError:
        """An error at a line of ``text``."""
        return ExchangeError([Mistake(*self.place(line), key, message)])


def read_model(path: str | os.PathLike[str]) -> ModelFile:
    """Reads a model file.

    Raises:
        ExchangeError: it cannot be read, is not XML, or neither MJCF nor URDF.
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
    """Left-over xacro elements that may stand for a part of a robot, or of another model.

    Declarations, and elements inside a solid or an extension, stand for no part.
    """
    above: list[Element] = []
    for element in elements:
        del above[element.depth :]
        inside = ROOTS.get(above[0].tag) == "URDF" if above else False
        harmless = inside and (
            element.tag in _DECLARED
            or any(a.tag in _LOOKS or a.tag.startswith(XACRO) or not a.known for a in above)
        )
        if element.tag.startswith(XACRO) and not harmless:
            yield element
        above.append(element)


def read_elements(name: str) -> tuple[bytes, list[Element]]:
    """Content and elements of a file.

    Raises:
        ExchangeError: it cannot be read, or is not XML.
    """

    def fail(message: str, line: int | None = None) -> ExchangeError:
        return ExchangeError([Mistake(name, line, "", message)])

    try:
        place = Path(name)
        if not place.is_file():
            found = "a folder" if place.is_dir() else "nothing" if not place.exists() else "no file"
            raise fail(f"found {found} here; a file in MJCF or URDF is needed")
        with place.open("rb") as stream:
            text = stream.read(MAX_BYTES + 1)
    except (OSError, ValueError) as reason:
        raise fail(f"cannot be read: {getattr(reason, 'strerror', None) or reason}") from None
    if len(text) > MAX_BYTES:
        raise fail(f"larger than {MAX_BYTES / 1e6:g} MB, which is the limit")
    elements: list[Element] = []
    open_now: list[Element] = []
    parser = expat.ParserCreate()

    def begin(tag: str, attributes: dict[str, str]) -> None:
        if len(open_now) > MAX_DEPTH:
            what = f"nested deeper than {MAX_DEPTH} levels"
            raise fail(what, parser.CurrentLineNumber)
        above = open_now[-1] if open_now else None
        known = above is None or (above.known and (above.tag != "robot" or tag in _MODEL))
        if above is not None:
            above.inside.add(tag)
        line, depth = parser.CurrentLineNumber, len(open_now)
        element = Element(tag, attributes, line, depth, set(), known, [])
        elements.append(element)
        open_now.append(element)

    def begin_data() -> None:
        parser.CharacterDataHandler = open_now[-1].characters.append

    def end_data() -> None:
        parser.CharacterDataHandler = None

    def refuse(*_: object) -> None:
        what = "found a document type declaration; take it out: entities are not read"
        raise fail(what, parser.CurrentLineNumber)

    parser.StartElementHandler, parser.StartDoctypeDeclHandler = begin, refuse
    parser.EndElementHandler = lambda _: open_now.pop()
    parser.StartCdataSectionHandler, parser.EndCdataSectionHandler = begin_data, end_data
    try:
        parser.Parse(text, True)
    except expat.ExpatError as reason:
        what = expat.errors.messages[reason.code]
        raise fail(f"is not XML: {what}", reason.lineno) from None
    except ValueError as reason:  # an encoding that is not known
        raise fail(f"is not XML: {reason}") from None
    return text, elements


def line_in(message: str) -> int | None:
    """The line that a message of MuJoCo names; None where it names none."""
    found = re.search(r"\b[Ll]ine(?: number=| )(\d+)", message)
    return int(found[1]) or None if found else None
