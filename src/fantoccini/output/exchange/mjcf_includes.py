"""MJCF files with the files that they include, where every element keeps its file and line.

MuJoCo does not tell the lines of included elements, nor which lines are of attached models. So it
reads a second text: all elements, one a line, below a million empty lines. A line that it then
tells stands for an element if it is below those, and is of an attached model if it is not.
"""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

from fantoccini.output.exchange.model_file import (
    MAX_BYTES,
    MAX_DEPTH,
    Element,
    ModelFile,
    read_elements,
)

_LISTS = (
    "bodies",
    "joints",
    "geoms",
    "sites",
    "cameras",
    "lights",
    "frames",
    "flexes",
    "meshes",
    "hfields",
    "textures",
    "materials",
    "skins",
    "pairs",
    "excludes",
    "equalities",
    "tendons",
    "actuators",
    "sensors",
    "numerics",
    "texts",
    "tuples",
    "keys",
    "plugins",
)
"""Elements of MuJoCo's that know their lines."""

_ABOVE = 1_000_000
"""Empty lines above the text: lines up to here are of attached models."""

_MOST_FILES = 200
"""Of a model, with the included ones."""

_LINE = re.compile(r"\b([Ll]ine(?: number=| ))(\d+)")


def with_includes(file: ModelFile) -> ModelFile:
    """The file with the content of those that it includes; itself where it names no others.

    Raises:
        ExchangeError: such a file is missing, broken, or included twice; all are too large; one is
            not UTF-8.
    """
    _check_encoding(file, file.text)
    if not any(element.tag in ("include", "model") for element in file.elements):
        return file
    reader = _Reader(file)
    reader.add(file.elements, file.name, 0)
    whole = replace(
        file,
        elements=tuple(reader.elements),
        origins=tuple(reader.origins),
        others=tuple(reader.others),
    )
    return replace(whole, text="".join(_lines(whole)).encode())


def asset_folders(file: ModelFile) -> list[str]:
    """Folders in which MuJoCo may look for meshes: those that a compiler names first."""
    first, *others = (os.path.dirname(os.fspath(path)) for path in (file.path, *file.others))
    below = ["", *(os.path.relpath(folder or ".", first or ".") for folder in others)]
    named = [
        element.attributes[key]
        for element in file.elements
        if element.tag == "compiler"
        for key in ("meshdir", "assetdir")
        if key in element.attributes
    ]
    places = (os.path.join(name, folder) for name in (*named, "") for folder in below)
    return list(dict.fromkeys(os.path.join(first, place) for place in places))


def found_beside(given: str, *folders: str) -> str | None:
    """The name of a file in the first of some folders that has it, as MuJoCo looks for it."""
    places = (os.path.join(folder, given) for folder in folders)
    try:
        return next((place for place in places if os.path.isfile(place)), None)
    except ValueError:  # a name that no file can have
        return None


def locate(mujoco: Any, file: ModelFile, spec: Any) -> None:
    """Gives the elements of MuJoCo's specification their lines in the file's text."""
    try:
        twin = mujoco.MjSpec.from_string(_ABOVE * "\n" + file.text.decode())
    except (ValueError, RuntimeError, mujoco.FatalError):
        twin = None
    for kind in _LISTS:
        own = list(getattr(spec, kind, ()))
        others = [] if twin is None else list(getattr(twin, kind, ()))
        alike = len(others) == len(own)
        for k, element in enumerate(own):
            found = _LINE.search(others[k].info) if alike else None
            line = int(found[2]) - _ABOVE if found else 0
            element.info = f"line {line}" if line > 0 else ""


def line_of_mistake(mujoco: Any, file: ModelFile, message: str) -> int | None:
    """The line in the file's text of what MuJoCo says when it reads the file itself."""
    try:
        mujoco.MjSpec.from_string(_ABOVE * "\n" + file.text.decode())
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        found = _LINE.search(str(error))
        if found and _LINE.sub("", str(error)) == _LINE.sub("", message):
            return max(int(found[2]) - _ABOVE, 0) or None
    return None


def told(message: str, line: int | None) -> str:
    """The message with a line in place of the one that it names; without it where it is None."""
    if line is None:
        return re.sub(r",? *\b[Ll]ine(?: number=| )\d+", "", message)
    return _LINE.sub(lambda found: f"{found[1]}{line}", message)


def _check_encoding(file: ModelFile, text: bytes) -> None:
    try:
        text.decode()
    except UnicodeDecodeError as error:
        line = text.count(b"\n", 0, error.start) + 1
        raise file.mistake("is not UTF-8, in which MuJoCo reads", line) from None


class _Reader:
    """Puts the elements of included files where they are included.

    Attributes:
        elements: of all files.
        origins: the file and line of each.
        others: included files.
    """

    def __init__(self, file: ModelFile):
        self.file, self.folder = file, os.path.dirname(file.name)
        self.elements: list[Element] = []
        self.origins: list[tuple[str, int]] = []
        self.others: list[Path] = []
        self.size = len(file.text)
        self.known = {os.path.realpath(file.name)}

    def add(self, elements: tuple[Element, ...], name: str, deeper: int) -> None:
        """Adds elements of a file, as much deeper as its root's are."""
        for element in elements:
            line, depth = len(self.elements) + 1, element.depth + deeper
            if element.tag != "include":
                self.elements.append(replace(element, line=line, depth=depth))
                self.origins.append((name, element.line))
                continue
            inner, found = self._included(element, name, depth)
            self.add(tuple(inner[1:]), found, depth - 1)

    def _included(self, include: Element, name: str, depth: int) -> tuple[list[Element], str]:
        def fail(message: str) -> Exception:
            located = replace(self.file, name=name, origins=())
            return located.mistake(message, include.line, "include")

        given = include.attributes.get("file", "")
        found = found_beside(given, self.folder, os.path.dirname(name)) if given else None
        if found is None:
            raise fail(f"found no file {given[:100]!r} beside the model's first file or this one")
        place = os.path.realpath(found)
        if place in self.known:
            raise fail(f"{given[:100]!r} is included already; a file is included once")
        self.known.add(place)
        if depth > MAX_DEPTH:
            raise fail(f"nested deeper than {MAX_DEPTH} levels")
        if len(self.known) > _MOST_FILES:
            raise fail(f"includes a file too many; allowed: {_MOST_FILES} files together")
        if include.inside:
            raise fail("has elements inside, which MuJoCo refuses; put them before or behind it")
        text, inner = read_elements(found)
        _check_encoding(replace(self.file, name=found, origins=()), text)
        self.size += len(text)
        if self.size > MAX_BYTES:
            raise fail(f"all files together are larger than {MAX_BYTES / 1e6:g} MB")
        if len(inner) == 1:
            raise fail(f"{given[:100]!r} has no elements, which MuJoCo refuses")
        self.others.append(Path(found))
        return inner, found


def _lines(file: ModelFile) -> list[str]:
    """Lines of XML, one for each element; paths of attached models and flexcomps become absolute.

    MuJoCo reads both at once, while those of meshes are not needed for lines.
    """
    lines, open_now = list[str](), list[str]()
    assets = asset_folders(file)
    for element, (origin, _) in zip(file.elements, file.origins, strict=True):
        end = "".join(f"</{tag}>" for tag in reversed(open_now[element.depth :]))
        del open_now[element.depth :]
        given = dict(element.attributes)
        if element.tag in ("model", "flexcomp") and "file" in given:
            beside = os.path.dirname(file.name), os.path.dirname(origin)
            folders = beside if element.tag == "model" else assets
            given["file"] = os.path.abspath(found_beside(given["file"], *folders) or given["file"])
        if element.tag == "text" and element.characters:
            given.setdefault("data", "".join(element.characters))
        pairs = "".join(f" {key}={quoteattr(value)}" for key, value in given.items())
        if lines:
            lines[-1] += end + "\n"
        lines.append(f"<{element.tag}{pairs}>")
        open_now.append(element.tag)
    return [*lines, "".join(f"</{tag}>" for tag in reversed(open_now))]
