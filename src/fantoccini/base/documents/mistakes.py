"""Collects the mistakes of a document or of arguments, each with its key path."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path as FilePath
from typing import TypeVar

from fantoccini.base import FantocciniError, FileError, InputError
from fantoccini.base.documents.located import Finding, Located

Checked = TypeVar("Checked")


class Mistakes:
    """Mistakes of a document, collected and reported together.

    Attributes:
        located: the document, with the line of every path.
        findings: key path and message of each mistake.

    Args:
        located: the document.
        error: class of the error.
    """

    def __init__(self, located: Located, error: type[FileError] = FileError):
        self.located, self._error = located, error
        self.findings: list[Finding] = []

    @classmethod
    def of_inputs(cls) -> Mistakes:
        """Mistakes in inputs without a file: arguments of a function."""
        return cls(Located(file="inputs", folder=FilePath()), InputError)

    def __len__(self) -> int:
        return len(self.findings)

    def add(self, path: Iterable[str | int], message: str) -> None:
        """Records a mistake."""
        self.findings.append((tuple(path), message))

    def __call__(self, path: tuple[str | int, ...], make: Callable[..., Checked]) -> Checked | None:
        """Result of ``make``; None if it raised, and the mistake is recorded at ``path``."""
        try:
            return make()
        except FileError as error:
            self.findings += [(path, str(mistake)) for mistake in error.mistakes]
        except (FantocciniError, ValueError) as error:
            self.add(path, str(error))
        return None

    def need(self, path: tuple[str | int, ...], make: Callable[[], Checked]) -> Checked:
        """Result of ``make``.

        Raises:
            FileError: ``make`` raised, or an earlier check did; lists every mistake.
        """
        result = self(path, make)
        self.raise_if_any()
        assert result is not None
        return result

    def raise_if_any(self) -> None:
        """Raises the error if there are mistakes."""
        if self.findings:
            raise self.located.error(self.findings, self._error)
