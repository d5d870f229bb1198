"""Refusal of models with so many copied parts that MuJoCo would need too long to load them.

The time to load each copy, and each element that makes copies, grows with the size of the model.

An element may copy its content (`replicate`), or create bodies (`composite`, `flexcomp`).
"""

from __future__ import annotations

import math
import os
from typing import NamedTuple

from fantoccini.base import ExchangeError
from fantoccini.output.exchange.mjcf_includes import asset_folders, find_file, with_includes
from fantoccini.output.exchange.mjcf_memory import check_memory
from fantoccini.output.exchange.model_file import Element, ModelFile, read_model

_MAX_COPIES = 10_000
"""Largest number of copies of one element, including nested copying."""
_MAX_WORK = 200_000_000
"""Largest estimate of the work of copying: copies times elements, about ten seconds in MuJoCo."""
_COPIES_PER_COPYING_ELEMENT = 20
"""Number of copies that take as long as one element that makes copies."""
_MAX_MODEL_DEPTH = 20
"""Largest number of levels of models within models."""
_MAX_DIGITS = 9
"""Largest number of digits of a count; longer ones are clamped."""
_ELEMENTS_PER_POINT = 4
"""Elements per point of a flexcomp: a body and three slides."""
_POINT_BYTES = 40
"""Approximate size of a flexcomp's file per point, including triangles [bytes]."""

_COPYING_TAGS = ("replicate", "composite", "flexcomp")
_TYPES_WITH_LISTED_POINTS = ("direct", "mesh", "gmsh")
"""Types of flexcomps that list their points, without a count."""


class _Size(NamedTuple):
    """Size of the model that MuJoCo builds from a file.

    Attributes:
        copies: number of copies that its elements make.
        n_copying: number of elements that make copies.
        elements: number of elements, including copies.
    """

    copies: int = 0
    n_copying: int = 0
    elements: int = 0

    @property
    def work(self) -> int:
        return (self.copies + _COPIES_PER_COPYING_ELEMENT * self.n_copying) * self.elements

    def plus(self, times: int, copies: int, n_copying: int, elements: int) -> _Size:
        """The size with `times` copies of another size added."""
        return _Size(
            self.copies + times * copies,
            self.n_copying + times * n_copying,
            self.elements + times * elements,
        )


def attached_models(file: ModelFile) -> tuple[ModelFile, ...]:
    """Checks the copies in a file; returns all models that it attaches, nested ones first.

    Raises:
        ExchangeError: elements are copied too often, a model contains itself, or MuJoCo would need
            too much memory.
    """
    sizes = _SizeCounter()
    sizes.size_of(file)
    counts = (sizes.by_path[os.path.realpath(model.name)].elements for model in sizes.files)
    check_memory(zip(sizes.files, counts, strict=True))
    return tuple(sizes.files[:-1])


class _SizeCounter:
    """Sizes of files, each determined once.

    Attributes:
        files: files that have been read, nested ones first.
        by_path: real path -> size.
        open_files: real paths of the files that are being read, outermost first.
    """

    def __init__(self) -> None:
        self.files: list[ModelFile] = []
        self.by_path: dict[str, _Size] = {}
        self.open_files: list[str] = []

    def size_of(self, file: ModelFile) -> _Size:
        """Size of a file, including the models that it names."""
        real_path = os.path.realpath(file.name)
        if real_path in self.by_path:
            return self.by_path[real_path]
        self.open_files.append(real_path)
        models = self._models(file)
        largest_model = max(models.values(), default=_Size(), key=lambda size: size.elements)
        size, copies_of_ancestors, named_parts = _Size(), list[int](), _NamedParts()
        for element in file.elements:
            del copies_of_ancestors[element.depth :]
            tag, attributes = element.tag, element.attributes
            multiplicity = math.prod(copies_of_ancestors)  # number of copies of this element
            named_parts.add(element, multiplicity, size.elements)
            count = _copy_count(file, element) if tag in _COPYING_TAGS else 1
            copies_of_ancestors.append(count)
            size = size.plus(multiplicity, 0, 0, 1)
            if tag in _COPYING_TAGS:
                if multiplicity * count > _MAX_COPIES:
                    text = f"copies its content {multiplicity * count} times; allowed: up to"
                    raise file.error_at(f"{text} {_MAX_COPIES}", element.line, tag)
                size = size.plus(multiplicity, count, 1, 0)
                if tag != "replicate":
                    per_point = _ELEMENTS_PER_POINT if tag == "flexcomp" else 1
                    size = size.plus(multiplicity, 0, 0, per_point * count)
            elif tag == "model":
                size = size.plus(1, 0, 1, 0)
                size = size.plus(1, *models.get(attributes.get("name", ""), largest_model))
            elif tag == "attach":
                n_inside = named_parts.elements(attributes, size.elements)
                if "model" in attributes:
                    n_inside = models.get(attributes["model"], largest_model).elements
                size = size.plus(multiplicity, 1, 1, n_inside)
            if size.work > _MAX_WORK:
                text = (
                    "up to here, copying would take MuJoCo longer than about ten seconds "
                    f"({size.copies} copies, {size.elements} elements); reduce them"
                )
                raise file.error_at(text, element.line, tag)
        self.open_files.pop()
        self.by_path[real_path] = size
        self.files.append(file)
        return size

    def _models(self, file: ModelFile) -> dict[str, _Size]:
        """Sizes of the models that a file attaches, by name."""
        sizes = dict[str, _Size]()
        for element in file.elements:
            file_name = element.attributes.get("file", "") if element.tag == "model" else ""
            folders = (
                os.path.dirname(file.name),
                os.path.dirname(file.file_and_line(element.line)[0]),
            )
            name = find_file(file_name, *folders) if file_name else None
            if name is None:
                continue  # MuJoCo reports the missing file
            if os.path.realpath(name) in self.open_files or len(self.open_files) > _MAX_MODEL_DEPTH:
                text = f"{file_name[:100]!r} contains itself, or models are nested too deeply"
                raise file.error_at(text, element.line, "model")
            sizes[element.attributes.get("name", "")] = self.size_of(
                _read_attached(file, name, element.line)
            )
        return sizes


class _NamedParts:
    """Numbers of elements in each named body and frame of a file; `attach` may copy these parts."""

    def __init__(self) -> None:
        self.sizes: dict[tuple[str, str], int] = {}
        self.open_parts: list[tuple[Element, int, int]] = []

    def add(self, element: Element, times: int, n_before: int) -> None:
        """Adds an element, after closing the open parts that do not contain it.

        Args:
            element: the element.
            times: number of its copies.
            n_before: number of elements before it.
        """
        while self.open_parts and self.open_parts[-1][0].depth >= element.depth:
            part, copies, n_before_part = self.open_parts.pop()
            n_inside = (n_before - n_before_part) // copies
            self.sizes[part.tag, part.attributes["name"]] = n_inside
        if element.tag in ("body", "frame") and "name" in element.attributes:
            self.open_parts.append((element, times, n_before))

    def elements(self, attributes: dict[str, str], n_before: int) -> int:
        """Number of elements of the part that an `attach` copies; ``n_before`` if unknown."""
        for kind in ("body", "frame"):
            if kind in attributes:
                return self.sizes.get((kind, attributes[kind]), n_before)
        return 0  # no part is named


def _read_attached(file: ModelFile, name: str, line: int) -> ModelFile:
    try:
        return with_includes(read_model(name))
    except ExchangeError as error:
        raise file.error_at(f"names a model that cannot be read: {error}", line, "model") from None


def _copy_count(file: ModelFile, element: Element) -> int:
    """Number of copies that an element makes of its content, or of points."""
    attributes, tag = element.attributes, element.tag
    n_listed = max(len(attributes.get(key, "").split()) // 3 for key in ("point", "vertex"))
    if tag == "flexcomp" and attributes.get("type") in _TYPES_WITH_LISTED_POINTS:
        return max(n_listed, _file_points(file, element), 1)
    default = "10 10 10" if tag == "flexcomp" else ""
    return max(_product(attributes.get("count", default)), n_listed)


def _file_points(file: ModelFile, element: Element) -> int:
    """Approximate number of points in the file of a flexcomp."""
    file_name = element.attributes.get("file", "")
    path = find_file(file_name, *asset_folders(file)) if file_name else None
    return os.path.getsize(path) // _POINT_BYTES if path else 0


def _product(text: str) -> int:
    """Product of a count's numbers, which may have a plus sign."""
    counts = [word.removeprefix("+") for word in text.split()]
    counts = ["9" * _MAX_DIGITS if len(word) > _MAX_DIGITS else word for word in counts]
    return math.prod(max(int(word), 1) for word in counts if word.isdecimal())
