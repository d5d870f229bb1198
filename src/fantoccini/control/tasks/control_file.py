"""Reading of the files of control: task files and planning problems."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from pydantic import Field

from fantoccini.base import FileError, Mistake, OnProgress, StateError, nearest
from fantoccini.base.documents import Located, Model, Refusals, Value, mistake, read_file, validate
from fantoccini.dynamics.marionette import Marionette, load
from fantoccini.model.puppet import WORDS, named_file
from fantoccini.motion import State

KINDS = {"bodies": "puppet", "puppets": "scene", "problem": "problem", "task": "task"}
"""Key at the top of a file that tells its kind -> the kind."""


class ControlFile(Model):
    """A file that asks for a motion of a puppet from a start at rest."""

    puppet: str
    """A bundled puppet or scene, or a puppet or scene file in this file's folder."""
    start: dict[str, Value] = Field(default_factory=dict)
    """Coordinate -> value: the puppet hangs at rest with the driven ones there."""


FileT = TypeVar("FileT", bound=ControlFile)


@dataclass(frozen=True)
class Reading(Generic[FileT]):
    """A file and its puppet, while it is checked.

    Attributes:
        file: its validated content.
        located: the same with the lines of its keys.
        marionette: its puppet.
        check: notes mistakes.
    """

    file: FileT
    located: Located
    marionette: Marionette
    check: Refusals

    def states(self, key: str, values: dict[str, Any]) -> None:
        """Notes coordinates and values at a key that no state of the puppet has."""
        for name, value in values.items():
            state = {name: value}
            self.check((key, name), lambda state=state: self.marionette.state(state))

    def note(self, place: tuple[str | int, ...], text: str) -> None:
        """Notes a mistake."""

        def refuse() -> None:
            raise StateError(text)

        self.check(place, refuse)

    @property
    def start(self) -> State:
        """The start, at rest.

        Raises:
            FileError: there is none, or there were mistakes before.
        """
        return self.check.need(("start",), lambda: self.marionette.rest(self.file.start))


@dataclass(frozen=True)
class Kind(Generic[FileT]):
    """A kind of file.

    Attributes:
        name: ``"task"`` or ``"problem"``, which is also the key of its name.
        schema: its keys.
        folder: of the bundled ones.
    """

    name: str
    schema: type[FileT]
    folder: Path

    @property
    def bundled(self) -> tuple[str, ...]:
        """Names of the bundled files."""
        return tuple(sorted(p.stem for p in self.folder.glob("*.yaml")))

    @property
    def json_schema(self) -> dict[str, Any]:
        """JSON Schema, for editors."""
        schema = self.schema.model_json_schema()
        return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}

    def read(self, path: str | os.PathLike[str], progress: OnProgress | None) -> Reading[FileT]:
        """A file with its puppet; whether its start is of the puppet is noted.

        Args:
            path: of the file, or the name of a bundled one.
            progress: called with a description of each slow step.

        Raises:
            FileError: with every mistake found and its location.
        """
        name = os.fspath(path)
        if not os.path.exists(name):
            if name not in self.bundled:
                text = f"found nothing here; a {self.name} file is needed, or the name of a bundled"
                hint = nearest(name, self.bundled)
                raise FileError([Mistake(name, None, "", f"{text} {self.name}{hint}")])
            path = self.folder / f"{name}.yaml"
        located = read_file(path)
        keys = located.data if isinstance(located.data, dict) else {}
        other = next((kind for key, kind in KINDS.items() if key in keys), self.name)
        if self.name not in keys and other != self.name:
            fields = self.schema.model_fields.items()
            needed = " and ".join(f"`{key}`" for key, field in fields if field.is_required())
            text = f"this is a {other} file; a {self.name} file has the keys {needed}"
            raise located.error([((), text)], FileError)
        file = validate(self.schema, located, words=WORDS)
        marionette = load(named_file(file.puppet, located), progress)
        reading = Reading(file, located, marionette, Refusals(located))
        reading.states("start", file.start)
        return reading


def check_one_of(part: Model, first: str, second: str) -> None:
    """Raises a mistake unless a part of a file has exactly one of two keys."""
    given = [getattr(part, key) is not None for key in (first, second)]
    if sum(given) != 1:
        found = f"both `{first}` and" if all(given) else f"neither `{first}` nor"
        raise mistake(f"found {found} `{second}`; needed: one of them")
