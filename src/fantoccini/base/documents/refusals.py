"""Calls that may refuse part of a file, and their mistakes with the place in the file."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from fantoccini.base import FantocciniError, FileError
from fantoccini.base.documents.located import Located

Checked = TypeVar("Checked")


class Refusals:
    """Calls that may refuse part of a file, and the mistakes found by them.

    Args:
        located: the file.
    """

    def __init__(self, located: Located):
        self._located = located
        self._found: list[tuple[tuple[str | int, ...], str]] = []

    def __call__(
        self, place: tuple[str | int, ...], make: Callable[..., Checked]
    ) -> Checked | None:
        """The result; None where it is refused, which is noted for a place in the file."""
        try:
            return make()
        except FileError as error:
            self._found += [(place, str(mistake)) for mistake in error.mistakes]
        except (FantocciniError, ValueError) as error:
            self._found.append((place, str(error)))
        return None

    def need(self, place: tuple[str | int, ...], make: Callable[[], Checked]) -> Checked:
        """The result.

        Raises:
            FileError: it is refused.
        """
        made = self(place, make)
        self.refuse()
        assert made is not None
        return made

    def refuse(self) -> None:
        """Raises FileError if there are mistakes."""
        if self._found:
            raise self._located.error(self._found, FileError)
