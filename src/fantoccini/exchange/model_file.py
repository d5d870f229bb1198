"""Model files of other programs: what they are, and where their elements stand."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from fantoccini.errors import ExchangeError, Mistake

MAX_BYTES = 20_000_000
"""Size of a model file [bytes]: far beyond those of robots."""

ROOTS = {"mujoco": "MJCF", "robot": "URDF"}
"""First element of a file -> its format."""


@dataclass(frozen=True)
class ModelFile:
    """A model file that is well-formed XML, without entities of its own.

    Attributes:
        name: as the user gave it.
        path: of the file.
        root: tag of its first element, one of :data:`ROOTS`.
        lines: (tag, name) -> line of the element.
        text: content.
    """

    name: str
    path: Path
    root: str
    text: bytes
    lines: dict[tuple[str, str], int] = field(default_factory=dict)

    def mistake(self, message: str, line: int | None = None, key: str = "") -> ExchangeError:
        """An error at a line of the file."""
        return ExchangeError([Mistake(self.name, line or None, key, message)])


def read_model(path: str | os.PathLike[str]) -> ModelFile:
    """Reads a model file.

    Raises:
        ExchangeError: it cannot be read, is not XML, or neither MJCF nor URDF.
    """
    name = os.fspath(path)

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
    elements: list[tuple[str, str, int]] = []
    parser = expat.ParserCreate()

    def begin(tag: str, attributes: dict[str, str]) -> None:
        elements.append((tag, attributes.get("name", ""), parser.CurrentLineNumber))

    def refuse(*_: object) -> None:
        text = "found a document type declaration; take it out: entities are not read"
        raise fail(text, parser.CurrentLineNumber)

    parser.StartElementHandler, parser.StartDoctypeDeclHandler = begin, refuse
    try:
        parser.Parse(text, True)
    except expat.ExpatError as reason:
        what = expat.errors.messages[reason.code]
        raise fail(f"is not XML: {what}", reason.lineno) from None
    except ValueError as reason:  # an encoding that is not known
        raise fail(f"is not XML: {reason}") from None
    tag, _, line = elements[0]
    if tag not in ROOTS:
        raise fail(f"begins with <{tag[:60]}>; needed: <mujoco> (MJCF) or <robot> (URDF)", line)
    xacro = [line for tag, _, line in elements if tag.startswith("xacro:")]
    if xacro:
        raise fail("found a macro of xacro; run xacro on the file first", xacro[0])
    lines: dict[tuple[str, str], int] = {}
    for tag, own, line in elements:
        lines.setdefault((tag, own), line)
    return ModelFile(name, place, elements[0][0], text, lines)


def line_in(message: str) -> int | None:
    """The line that a message of MuJoCo names; None where it names none."""
    found = re.search(r"\b[Ll]ine(?: number=| )(\d+)", message)
    return int(found[1]) or None if found else None
