"""Collects the mistakes of several checks of a file, each with its key path."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from fantoccini.base import FantocciniError, FileError
from fantoccini.base.documents.located import Located

Checked = TypeVar("Checked")


class Refusals:
    """Runs checks on parts of a file and collects their mistakes into one error.

    Args:
        located: the file.
    """

    def __init__(self, located: Located):
        self._located = located
        self._found: list[tuple[tuple[str | int, ...], str]] = []

    def __call__(
        self, place: tuple[str | int, ...], make: Callable[..., Checked]
    ) -> Checked | None:
        """Result of ``make``; None if it raised, and the mistake is recorded at ``place``."""
        try:
            return make()
        except FileError as error:
            self._found += [(place, str(mistake)) for mistake in error.mistakes]
        except (FantocciniError, ValueError) as error:
            self._found.append((place, str(error)))
        return None

    def need(self, place: tuple[str | int, ...], make: Callable[[], Checked]) -> Checked:
        """Result of ``make``.

        Raises:
            FileError: ``make`` raised, or an earlier check did; lists every mistake.
        """
        made = self(place, make)
        self.refuse()
        assert made is not None
        return made

    def refuse(self) -> None:
        """Raises FileError if any mistake was recorded."""
        if self._found:
            raise self._located.error(self._found, FileError)
