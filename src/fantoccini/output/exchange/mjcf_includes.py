"""MJCF files merged with the files that they include; every element keeps its file and line.

MJCF is the XML format of the simulator MuJoCo. MuJoCo does not report the lines of included
elements, nor which lines belong to attached models: other files, whose parts it copies. So MuJoCo
reads a second text: a million empty lines, then all elements, one per line. If it reports a line
after the empty ones, this line is that of an element of the file; otherwise it is in an attached
model.
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

_ELEMENT_LISTS = (
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
    merger = _IncludeMerger(file)
    merger.add(file.elements, file.name, 0)
    merged = replace(
        file,
        elements=tuple(merger.elements),
        origins=tuple(merger.origins),
        included_files=tuple(merger.included_files),
    )
    return replace(merged, text="".join(_xml_lines(merged)).encode())


def asset_folders(file: ModelFile) -> list[str]:
    """Folders in which MuJoCo may search for meshes, first those named by a compiler element."""
    first_folder, *other_folders = (
        os.path.dirname(os.fspath(path)) for path in (file.path, *file.included_files)
    )
    relative_folders = [
        "",
        *(os.path.relpath(folder or ".", first_folder or ".") for folder in other_folders),
    ]
    named_folders = [
        element.attributes[key]
        for element in file.elements
        if element.tag == "compiler"
        for key in ("meshdir", "assetdir")
        if key in element.attributes
    ]
    candidates = (
        os.path.join(name, folder) for name in (*named_folders, "") for folder in relative_folders
    )
    return list(dict.fromkeys(os.path.join(first_folder, candidate) for candidate in candidates))


def find_file(name: str, *folders: str) -> str | None:
    """Path of a file in the first folder that contains it, in MuJoCo's order; or None."""
    paths = (os.path.join(folder, name) for folder in folders)
    try:
        return next((path for path in paths if os.path.isfile(path)), None)
    except ValueError:  # an invalid file name
        return None


def write_element_lines(mujoco: Any, file: ModelFile, spec: Any) -> None:
    """Sets the line numbers of the elements in MuJoCo's specification to those of the text."""
    try:
        shifted_spec = mujoco.MjSpec.from_string(_EMPTY_LINES * "\n" + file.text.decode())
    except (ValueError, RuntimeError, mujoco.FatalError):
        shifted_spec = None
    for kind in _ELEMENT_LISTS:
        elements = list(getattr(spec, kind, ()))
        shifted_elements = [] if shifted_spec is None else list(getattr(shifted_spec, kind, ()))
        same_length = len(shifted_elements) == len(elements)
        for k, element in enumerate(elements):
            match = _LINE.search(shifted_elements[k].info) if same_length else None
            line = int(match[2]) - _EMPTY_LINES if match else 0
            element.info = f"line {line}" if line > 0 else ""


def line_of_error(mujoco: Any, file: ModelFile, message: str) -> int | None:
    """Line, in the file's text, of an error message that MuJoCo gives for the file."""
    try:
        mujoco.MjSpec.from_string(_EMPTY_LINES * "\n" + file.text.decode())
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        match = _LINE.search(str(error))
        if match and _LINE.sub("", str(error)) == _LINE.sub("", message):
            return max(int(match[2]) - _EMPTY_LINES, 0) or None
    return None


def with_line_number(message: str, line: int | None) -> str:
    """The message with its line number replaced by `line`, or removed if that is None."""
    if line is None:
        return re.sub(r",? *\b[Ll]ine(?: number=| )\d+", "", message)
    return _LINE.sub(lambda match: f"{match[1]}{line}", message)


def _check_encoding(file: ModelFile, text: bytes) -> None:
    try:
        text.decode()
    except UnicodeDecodeError as error:
        line = text.count(b"\n", 0, error.start) + 1
        raise file.error_at("is not UTF-8, which MuJoCo needs", line) from None


class _IncludeMerger:
    """Merger of the elements of included files at the places of their inclusion.

    Attributes:
        elements: elements of all files.
        origins: file and line of each element.
        included_files: included files.
    """

    def __init__(self, file: ModelFile):
        self.file, self.folder = file, os.path.dirname(file.name)
        self.elements: list[Element] = []
        self.origins: list[tuple[str, int]] = []
        self.included_files: list[Path] = []
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
            included_elements, path = self._read_included(element, name, depth)
            self.add(tuple(included_elements[1:]), path, depth - 1)

    def _read_included(self, include: Element, name: str, depth: int) -> tuple[list[Element], str]:
        def make_error(message: str) -> Exception:
            including_file = replace(self.file, name=name, origins=())
            return including_file.error_at(message, include.line, "include")

        file_name = include.attributes.get("file", "")
        path = find_file(file_name, self.folder, os.path.dirname(name)) if file_name else None
        if path is None:
            raise make_error(
                f"found no file {file_name[:100]!r} beside the model's first file or this file"
            )
        real_path = os.path.realpath(path)
        if real_path in self.real_paths:
            raise make_error(f"{file_name[:100]!r} is included already; a file is included once")
        self.real_paths.add(real_path)
        if depth > MAX_DEPTH:
            raise make_error(f"nested deeper than {MAX_DEPTH} levels")
        if len(self.real_paths) > _MAX_FILES:
            raise make_error(f"includes too many files; allowed: {_MAX_FILES} files in all")
        if include.child_tags:
            raise make_error(
                "has elements inside, which MuJoCo refuses; put them before or after it"
            )
        text, included_elements = read_elements(path)
        _check_encoding(replace(self.file, name=path, origins=()), text)
        self.size += len(text)
        if self.size > MAX_BYTES:
            raise make_error(f"all files together are larger than {MAX_BYTES / 1e6:g} MB")
        if len(included_elements) == 1:
            raise make_error(f"{file_name[:100]!r} has no elements, which MuJoCo refuses")
        self.included_files.append(Path(path))
        return included_elements, path


def _xml_lines(file: ModelFile) -> list[str]:
    """Lines of XML, one per element; paths of attached models and flexcomps become absolute.

    MuJoCo reads these files immediately; those of meshes are not needed for the lines.
    """
    lines, open_tags = list[str](), list[str]()
    assets = asset_folders(file)
    for element, (origin, _) in zip(file.elements, file.origins, strict=True):
        closing_tags = "".join(f"</{tag}>" for tag in reversed(open_tags[element.depth :]))
        del open_tags[element.depth :]
        attributes = dict(element.attributes)
        if element.tag in ("model", "flexcomp") and "file" in attributes:
            file_folders = os.path.dirname(file.name), os.path.dirname(origin)
            folders = file_folders if element.tag == "model" else assets
            attributes["file"] = os.path.abspath(
                find_file(attributes["file"], *folders) or attributes["file"]
            )
        if element.tag == "text" and element.characters:
            attributes.setdefault("data", "".join(element.characters))
        pairs = "".join(f" {key}={quoteattr(value)}" for key, value in attributes.items())
        if lines:
            lines[-1] += closing_tags + "\n"
        lines.append(f"<{element.tag}{pairs}>")
        open_tags.append(element.tag)
    return [*lines, "".join(f"</{tag}>" for tag in reversed(open_tags))]
