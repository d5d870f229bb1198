"""MJCF files merged with the files that they include; every element keeps its file and line.

MuJoCo does not report the lines of included elements, nor which lines belong to attached models. So
it reads a second text: all elements, one per line, below a million empty lines. A line that it then
reports belongs to an element of the file if it is below the empty lines, else to an attached model.
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
"""Lists of MuJoCo's elements that have lines."""

_EMPTY_LINES = 1_000_000
"""Number of empty lines above the text: lines up to here belong to attached models."""

_MAX_FILES = 200
"""Largest number of files of a model, including included ones."""

_LINE = re.compile(r"\b([Ll]ine(?: number=| ))(\d+)")


def with_includes(file: ModelFile) -> ModelFile:
    """The file merged with the files that it includes; unchanged if it names no others.

    Raises:
        ExchangeError: an included file is missing, broken or included twice; the files together are
            too large; or a file is not UTF-8.
    """
    _check_encoding(file, file.text)
    if not any(element.tag in ("include", "model") for element in file.elements):
        return file
    reader = _Reader(file)
    reader.add(file.elements, file.name, 0)
    merged = replace(
        file,
        elements=tuple(reader.elements),
        origins=tuple(reader.origins),
        others=tuple(reader.others),
    )
    return replace(merged, text="".join(_lines(merged)).encode())


def asset_folders(file: ModelFile) -> list[str]:
    """Folders in which MuJoCo may search for meshes; those that a compiler element names first."""
    first, *other_folders = (os.path.dirname(os.fspath(path)) for path in (file.path, *file.others))
    below = ["", *(os.path.relpath(folder or ".", first or ".") for folder in other_folders)]
    named = [
        element.attributes[key]
        for element in file.elements
        if element.tag == "compiler"
        for key in ("meshdir", "assetdir")
        if key in element.attributes
    ]
    places = (os.path.join(name, folder) for name in (*named, "") for folder in below)
    return list(dict.fromkeys(os.path.join(first, place) for place in places))


def find_file(name: str, *folders: str) -> str | None:
    """Path of a file in the first of the folders that contains it, as MuJoCo searches; or None."""
    places = (os.path.join(folder, name) for folder in folders)
    try:
        return next((place for place in places if os.path.isfile(place)), None)
    except ValueError:  # an invalid file name
        return None


def locate(mujoco: Any, file: ModelFile, spec: Any) -> None:
    """Writes the lines in the file's text into the elements of MuJoCo's specification."""
    try:
        shifted_spec = mujoco.MjSpec.from_string(_EMPTY_LINES * "\n" + file.text.decode())
    except (ValueError, RuntimeError, mujoco.FatalError):
        shifted_spec = None
    for kind in _LISTS:
        elements = list(getattr(spec, kind, ()))
        located = [] if shifted_spec is None else list(getattr(shifted_spec, kind, ()))
        same_length = len(located) == len(elements)
        for k, element in enumerate(elements):
            match = _LINE.search(located[k].info) if same_length else None
            line = int(match[2]) - _EMPTY_LINES if match else 0
            element.info = f"line {line}" if line > 0 else ""


def line_of_mistake(mujoco: Any, file: ModelFile, message: str) -> int | None:
    """Line, in the file's text, of an error message that MuJoCo gives for the file."""
    try:
        mujoco.MjSpec.from_string(_EMPTY_LINES * "\n" + file.text.decode())
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        match = _LINE.search(str(error))
        if match and _LINE.sub("", str(error)) == _LINE.sub("", message):
            return max(int(match[2]) - _EMPTY_LINES, 0) or None
    return None


def with_line(message: str, line: int | None) -> str:
    """The message with its line number replaced by `line`, or removed if that is None."""
    if line is None:
        return re.sub(r",? *\b[Ll]ine(?: number=| )\d+", "", message)
    return _LINE.sub(lambda match: f"{match[1]}{line}", message)


def _check_encoding(file: ModelFile, text: bytes) -> None:
    try:
        text.decode()
    except UnicodeDecodeError as error:
        line = text.count(b"\n", 0, error.start) + 1
        raise file.mistake("is not UTF-8, which MuJoCo needs", line) from None


class _Reader:
    """Merger of the elements of included files at the places of their inclusion.

    Attributes:
        elements: elements of all files.
        origins: file and line of each element.
        others: included files.
    """

    def __init__(self, file: ModelFile):
        self.file, self.folder = file, os.path.dirname(file.name)
        self.elements: list[Element] = []
        self.origins: list[tuple[str, int]] = []
        self.others: list[Path] = []
        self.size = len(file.text)
        self.real_paths = {os.path.realpath(file.name)}

    def add(self, elements: tuple[Element, ...], name: str, depth_offset: int) -> None:
        """Adds elements of a file, with their depth increased by `depth_offset`."""
        for element in elements:
            line, depth = len(self.elements) + 1, element.depth + depth_offset
            if element.tag != "include":
                self.elements.append(replace(element, line=line, depth=depth))
                self.origins.append((name, element.line))
                continue
            inner, path = self._included(element, name, depth)
            self.add(tuple(inner[1:]), path, depth - 1)

    def _included(self, include: Element, name: str, depth: int) -> tuple[list[Element], str]:
        def fail(message: str) -> Exception:
            located = replace(self.file, name=name, origins=())
            return located.mistake(message, include.line, "include")

        file_name = include.attributes.get("file", "")
        path = find_file(file_name, self.folder, os.path.dirname(name)) if file_name else None
        if path is None:
            raise fail(
                f"found no file {file_name[:100]!r} beside the model's first file or this file"
            )
        real_path = os.path.realpath(path)
        if real_path in self.real_paths:
            raise fail(f"{file_name[:100]!r} is included already; a file is included once")
        self.real_paths.add(real_path)
        if depth > MAX_DEPTH:
            raise fail(f"nested deeper than {MAX_DEPTH} levels")
        if len(self.real_paths) > _MAX_FILES:
            raise fail(f"includes too many files; allowed: {_MAX_FILES} files in all")
        if include.inside:
            raise fail("has elements inside, which MuJoCo refuses; put them before or after it")
        text, inner = read_elements(path)
        _check_encoding(replace(self.file, name=path, origins=()), text)
        self.size += len(text)
        if self.size > MAX_BYTES:
            raise fail(f"all files together are larger than {MAX_BYTES / 1e6:g} MB")
        if len(inner) == 1:
            raise fail(f"{file_name[:100]!r} has no elements, which MuJoCo refuses")
        self.others.append(Path(path))
        return inner, path


def _lines(file: ModelFile) -> list[str]:
    """Lines of XML, one per element; paths of attached models and flexcomps become absolute.

    MuJoCo reads these files immediately; those of meshes are not needed for the lines.
    """
    lines, open_tags = list[str](), list[str]()
    assets = asset_folders(file)
    for element, (origin, _) in zip(file.elements, file.origins, strict=True):
        end = "".join(f"</{tag}>" for tag in reversed(open_tags[element.depth :]))
        del open_tags[element.depth :]
        attributes = dict(element.attributes)
        if element.tag in ("model", "flexcomp") and "file" in attributes:
            beside = os.path.dirname(file.name), os.path.dirname(origin)
            folders = beside if element.tag == "model" else assets
            attributes["file"] = os.path.abspath(
                find_file(attributes["file"], *folders) or attributes["file"]
            )
        if element.tag == "text" and element.characters:
            attributes.setdefault("data", "".join(element.characters))
        pairs = "".join(f" {key}={quoteattr(value)}" for key, value in attributes.items())
        if lines:
            lines[-1] += end + "\n"
        lines.append(f"<{element.tag}{pairs}>")
        open_tags.append(element.tag)
    return [*lines, "".join(f"</{tag}>" for tag in reversed(open_tags))]
