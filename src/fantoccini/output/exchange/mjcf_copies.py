"""Models that MuJoCo would copy parts of for minutes, or for ever, are refused.

Each copy takes MuJoCo a time that grows with the model, and so does each element that copies.
"""

from __future__ import annotations

import math
import os
from typing import NamedTuple

from fantoccini.base import ExchangeError
from fantoccini.output.exchange.mjcf_includes import asset_folders, found_beside, with_includes
from fantoccini.output.exchange.mjcf_memory import refuse_large
from fantoccini.output.exchange.model_file import Element, ModelFile, read_model

_MOST_COPIES = 10_000
"""Largest number of copies of one element, nested copying included."""
_MOST_WORK = 200_000_000
"""Work of copying: about ten seconds of MuJoCo."""
_EACH = 20
"""Work of an element that copies, in copies."""
_MOST_MODELS = 20
"""Levels of models within models."""
_DIGITS = 9
"""Longest count read, in digits; longer ones are clamped."""
_OF_POINT = 4
"""Elements of a flexcomp's point: a body and three slides."""
_POINT_BYTES = 40
"""About what a point takes in a file of a flexcomp, with its share of the triangles."""

_COPYING = ("replicate", "composite", "flexcomp")
_LISTED = ("direct", "mesh", "gmsh")
"""Types of flexcomps whose points are listed, not counted."""


class _Size(NamedTuple):
    """What MuJoCo makes of a file.

    Attributes:
        copies: that it makes.
        copying: elements that copy.
        elements: with the copied ones.
    """

    copies: int = 0
    copying: int = 0
    elements: int = 0

    @property
    def work(self) -> int:
        return (self.copies + _EACH * self.copying) * self.elements

    def plus(self, times: int, copies: int, copying: int, elements: int) -> _Size:
        """With something else so many times."""
        return _Size(
            self.copies + times * copies,
            self.copying + times * copying,
            self.elements + times * elements,
        )


def attached_models(file: ModelFile) -> tuple[ModelFile, ...]:
    """The models that a file attaches, and those that they attach, which come first.

    Raises:
        ExchangeError: elements are copied too often, a model holds itself, or MuJoCo would take
            too much memory for them.
    """
    sizes = _Sizes()
    sizes.of(file)
    counts = (sizes.known[os.path.realpath(one.name)].elements for one in sizes.files)
    refuse_large(zip(sizes.files, counts, strict=True))
    return tuple(sizes.files[:-1])


class _Sizes:
    """Sizes of files, each found once.

    Attributes:
        files: those that have been read.
    """

    def __init__(self) -> None:
        self.files: list[ModelFile] = []
        self.known: dict[str, _Size] = {}
        self.open: list[str] = []

    def of(self, file: ModelFile) -> _Size:
        """The size of a file with all that it names."""
        here = os.path.realpath(file.name)
        if here in self.known:
            return self.known[here]
        self.open.append(here)
        models = self._models(file)
        largest = max(models.values(), default=_Size(), key=lambda size: size.elements)
        size, above, parts = _Size(), list[int](), _Parts()
        for element in file.elements:
            del above[element.depth :]
            times, tag, given = math.prod(above), element.tag, element.attributes
            parts.add(element, times, size.elements)
            count = _copies(file, element) if tag in _COPYING else 1
            above.append(count)
            size = size.plus(times, 0, 0, 1)
            if tag in _COPYING:
                if times * count > _MOST_COPIES:
                    text = f"copies its content {times * count} times; allowed: up to"
                    raise file.mistake(f"{text} {_MOST_COPIES}", element.line, tag)
                size = size.plus(times, count, 1, 0)
                if tag != "replicate":
                    each = _OF_POINT if tag == "flexcomp" else 1
                    size = size.plus(times, 0, 0, each * count)
            elif tag == "model":
                size = size.plus(1, 0, 1, 0)
                size = size.plus(1, *models.get(given.get("name", ""), largest))
            elif tag == "attach":
                inside = parts.elements(given, size.elements)
                if "model" in given:
                    inside = models.get(given["model"], largest).elements
                size = size.plus(times, 1, 1, inside)
            if size.work > _MOST_WORK:
                text = (
                    "up to here, copying would take MuJoCo longer than about ten seconds "
                    f"({size.copies} copies, {size.elements} elements); make fewer"
                )
                raise file.mistake(text, element.line, tag)
        self.open.pop()
        self.known[here] = size
        self.files.append(file)
        return size

    def _models(self, file: ModelFile) -> dict[str, _Size]:
        """Sizes of the models that a file attaches, by name."""
        found = dict[str, _Size]()
        for element in file.elements:
            given = element.attributes.get("file", "") if element.tag == "model" else ""
            folders = (os.path.dirname(file.name), os.path.dirname(file.place(element.line)[0]))
            name = found_beside(given, *folders) if given else None
            if name is None:
                continue  # MuJoCo tells
            if os.path.realpath(name) in self.open or len(self.open) > _MOST_MODELS:
                text = f"{given[:100]!r} holds itself, or models within models without end"
                raise file.mistake(text, element.line, "model")
            found[element.attributes.get("name", "")] = self.of(_read(file, name, element.line))
        return found


class _Parts:
    """Elements in the named bodies and frames of a file, which may be copied within it."""

    def __init__(self) -> None:
        self.known: dict[tuple[str, str], int] = {}
        self.open: list[tuple[Element, int, int]] = []

    def add(self, element: Element, times: int, before: int) -> None:
        """Ends the elements that the next one is not inside of, and begins that.

        Args:
            element: the next one.
            times: it is there.
            before: elements before it.
        """
        while self.open and self.open[-1][0].depth >= element.depth:
            part, there, first = self.open.pop()
            self.known[part.tag, part.attributes["name"]] = (before - first) // there
        if element.tag in ("body", "frame") and "name" in element.attributes:
            self.open.append((element, times, before))

    def elements(self, given: dict[str, str], before: int) -> int:
        """Of the part that an element copies; all before it where its own are not known."""
        for kind in ("body", "frame"):
            if kind in given:
                return self.known.get((kind, given[kind]), before)
        return 0  # MuJoCo tells


def _read(file: ModelFile, name: str, line: int) -> ModelFile:
    try:
        return with_includes(read_model(name))
    except ExchangeError as error:
        raise file.mistake(f"names a model that cannot be read: {error}", line, "model") from None


def _copies(file: ModelFile, element: Element) -> int:
    """Copies that an element makes of its content, or points of a grid or cable."""
    given, tag = element.attributes, element.tag
    listed = max(len(given.get(key, "").split()) // 3 for key in ("point", "vertex"))
    if tag == "flexcomp" and given.get("type") in _LISTED:
        return max(listed, _file_points(file, element), 1)
    least = "10 10 10" if tag == "flexcomp" else ""
    return max(_count(given.get("count", least)), listed)


def _file_points(file: ModelFile, element: Element) -> int:
    """About the points in the file of a flexcomp."""
    given = element.attributes.get("file", "")
    found = found_beside(given, *asset_folders(file)) if given else None
    return os.path.getsize(found) // _POINT_BYTES if found else 0


def _count(text: str) -> int:
    """The product of a count's numbers, which MuJoCo reads with a sign, too."""
    counts = [word.removeprefix("+") for word in text.split()]
    counts = ["9" * _DIGITS if len(word) > _DIGITS else word for word in counts]
    return math.prod(max(int(word), 1) for word in counts if word.isdecimal())
