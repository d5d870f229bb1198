"""Mistakes in inputs, collected so that the user hears of all of them at once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path as FilePath

from fantoccini.base import InputError
from fantoccini.base.documents import Located

Path = tuple[str | int, ...]
"""Where a mistake is: keys and 0-based places, for example ("hand.length", 2)."""

PYTHON = Located(file="inputs", folder=FilePath())
"""Where inputs come from that were not written in a file."""


@dataclass
class Findings:
    """Collects mistakes and raises them together.

    Attributes:
        found: path and sentence of each mistake.
    """

    found: list[tuple[Path, str]] = field(default_factory=list)

    def add(self, path: Iterable[str | int], message: str) -> None:
        """Notes a mistake."""
        self.found.append((tuple(path), message))

    def raise_any(self, located: Located = PYTHON) -> None:
        """Raises an InputError that lists what was found, if anything was.

        Args:
            located: what was read; it knows the line of every path.
        """
        if self.found:
            raise located.error(self.found, InputError)
