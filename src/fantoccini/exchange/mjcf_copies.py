"""Models that MuJoCo would copy parts of for minutes, or for ever, are refused.

Each copy takes MuJoCo a time that grows with the model, and so does each element that copies.
"""

from __future__ import annotations

import math
import os
from typing import NamedTuple

from fantoccini.errors import ExchangeError
from fantoccini.exchange.mjcf_includes import found_beside, with_includes
from fantoccini.exchange.model_file import ModelFile, read_model

_MOST_COPIES = 10_000
"""Of what an element copies, with those around it."""
_MOST_WORK = 200_000_000
"""Work of copying: about ten seconds of MuJoCo."""
_EACH = 20
"""Work of an element that copies, in copies."""
_MOST_MODELS = 20
"""Levels of models within models."""
_DIGITS = 9
"""Of a count; more are taken for the largest of so many."""

_COPYING = ("replicate", "composite", "flexcomp")


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
        """With something so many times."""
        return _Size(
            self.copies + times * copies, self.copying + times * copying,
            self.elements + times * elements,
        )  # fmt: skip


def refuse_copies(file: ModelFile) -> None:
    """Raises an ExchangeError where elements are copied too often, or models hold themselves."""
    _Sizes().of(file)


class _Sizes:
    """Sizes of files, each found once."""

    def __init__(self) -> None:
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
        size, above = _Size(), list[int]()
        for element in file.elements:
            del above[element.depth :]
            times, tag, given = math.prod(above), element.tag, element.attributes
            count = _count(given.get("count", "")) if tag in _COPYING else 1
            above.append(count)
            size = size.plus(times, 0, 0, 1)
            if tag in _COPYING:
                if times * count > _MOST_COPIES:
                    text = f"copies its content {times * count} times; allowed: up to"
                    raise file.mistake(f"{text} {_MOST_COPIES}", element.line, tag)
                size = size.plus(times, count, 1, 0)
                if tag != "replicate":
                    size = size.plus(times, 0, 0, count)
            elif tag == "model":
                size = size.plus(1, 0, 1, 0)
                size = size.plus(1, *models.get(given.get("name", ""), largest))
            elif tag == "attach":
                size = size.plus(times, 1, 1, models.get(given.get("model", ""), largest).elements)
            if size.work > _MOST_WORK:
                text = (
                    f"{size.copies} copies in {size.elements} elements, by {size.copying} that "
                    f"copy; allowed: (copies + {_EACH} copying) x elements up to {_MOST_WORK:g}"
                )
                raise file.mistake(f"up to here the model has {text}", element.line, tag)
        self.open.pop()
        self.known[here] = size
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


def _read(file: ModelFile, name: str, line: int) -> ModelFile:
    try:
        return with_includes(read_model(name))
    except ExchangeError as error:
        raise file.mistake(f"names a model that cannot be read: {error}", line, "model") from None


def _count(text: str) -> int:
    """The product of a count's numbers, which MuJoCo reads with a sign, too."""
    counts = [word.removeprefix("+") for word in text.split()]
    counts = ["9" * _DIGITS if len(word) > _DIGITS else word for word in counts]
    return math.prod(max(int(word), 1) for word in counts if word.isdecimal())
