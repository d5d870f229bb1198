"""Mistakes in inputs, collected so that one error reports all of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path as FilePath

from fantoccini.base import InputError
from fantoccini.base.documents import Located

Path = tuple[str | int, ...]
"""Place of a mistake: keys and 0-based indices, for example ("hand.length", 2)."""

PYTHON = Located(file="inputs", folder=FilePath())
"""Location of inputs that are not from a file."""


@dataclass
class Findings:
    """Collects mistakes and raises them together.

    Attributes:
        found: path and message of each mistake.
    """

    found: list[tuple[Path, str]] = field(default_factory=list)

    def add(self, path: Iterable[str | int], message: str) -> None:
        """Adds a mistake."""
        self.found.append((tuple(path), message))

    def raise_any(self, located: Located = PYTHON) -> None:
        """Raises an InputError that lists all mistakes, if there are any.

        Args:
            located: file with the lines of all paths.
        """
        if self.found:
            raise located.error(self.found, InputError)
