"""Files of control: task files and planning problems.

A mistake is an error of the file with its line.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from pydantic import Field

from fantoccini.base import OnProgress, StateError
from fantoccini.base.documents import (
    Document,
    Mistakes,
    Model,
    Value,
    read_document,
    validation_error,
)
from fantoccini.dynamics.marionette import Marionette, load
from fantoccini.model.puppet import named_file
from fantoccini.motion import State


class ControlFile(Document):
    """A file that defines a motion of a puppet from a start at rest."""

    puppet: str
    """A bundled puppet or scene, or a puppet or scene file in this file's folder."""
    start: dict[str, Value] = Field(default_factory=dict)
    """Coordinate -> value: the puppet hangs at rest with the driven coordinates there."""


FileT = TypeVar("FileT", bound=ControlFile)


@dataclass(frozen=True)
class Reading(Generic[FileT]):
    """A file and its puppet, while it is checked.

    Attributes:
        file: validated content of the file.
        marionette: its puppet.
        check: collects mistakes.
    """

    file: FileT
    marionette: Marionette
    check: Mistakes

    def check_values(self, key: str, values: dict[str, Any]) -> None:
        """Reports coordinates and values under a key that the puppet cannot have."""
        for name, value in values.items():
            state = {name: value}
            self.check((key, name), lambda state=state: self.marionette.state(state))

    def add_mistake(self, place: tuple[str | int, ...], text: str) -> None:
        """Adds a mistake."""

        def refuse() -> None:
            raise StateError(text)

        self.check(place, refuse)

    @property
    def start(self) -> State:
        """The start, at rest.

        Raises:
            FileError: no such state, or earlier mistakes.
        """
        return self.check.need(("start",), lambda: self.marionette.rest(self.file.start))


def read_control_file(path: str | os.PathLike[str], *schemas: type[ControlFile]) -> ControlFile:
    """The content of a file.

    Args:
        path: path of the file, or the name of a bundled one.
        schemas: possible schemas of the file.

    Raises:
        FileError: all mistakes with their locations.
    """
    return read_document(path, *schemas)


def begin_reading(file: FileT, progress: OnProgress | None) -> Reading[FileT]:
    """Loads the puppet of a file; reports start values that the puppet cannot have.

    Args:
        file: the file.
        progress: called as each slow step begins; ``what`` describes it.

    Raises:
        FileError: mistakes in the puppet's file.
    """
    marionette = load(named_file(file.puppet, file.located), progress)
    reading = Reading(file, marionette, Mistakes(file.located))
    reading.check_values("start", file.start)
    return reading


def check_one_of(part: Model, first: str, second: str) -> None:
    """Raises a mistake unless a part of a file has exactly one of two keys."""
    are_set = [getattr(part, key) is not None for key in (first, second)]
    if sum(are_set) != 1:
        text = f"both `{first}` and" if all(are_set) else f"neither `{first}` nor"
        raise validation_error(f"found {text} `{second}`; needed: one of them")
