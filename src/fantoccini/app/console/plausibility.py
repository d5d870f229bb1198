"""Warnings about files that are valid but implausible."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from fantoccini.app.console.terminal import say
from fantoccini.base import Mistake
from fantoccini.base.documents import Finding, Located, key_path, read_file
from fantoccini.dynamics.equilibrium import input_warnings, warnings
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import Puppet
from fantoccini.motion import Input


def puppet_warnings(made: Marionette, file: str) -> list[Mistake]:
    """Warnings about a puppet, in file order.

    Args:
        made: the marionette of the file.
        file: FILE argument.
    """
    located = made.puppet.located
    if located.data is None:  # assembled from the files of a scene
        return _of_members(made.puppet, warnings(made))
    return _in_order([located.problem(*found) for found in warnings(made, located.data)], file)


def _of_members(puppet: Puppet, found: Iterable[Finding]) -> list[Mistake]:
    """Warnings about parts of a scene, each in the file that describes the part."""
    marked = []
    for path, text in found:
        if len(path) < 2 or not isinstance(path[1], int):
            continue  # about the size of a puppet, which a scene is not
        name = getattr(puppet, str(path[0]))[path[1]].name
        file, line = puppet.locate(name)
        marked.append(Mistake(file, line, key_path((name, *path[2:])), f"warning: {text}"))
    return marked


def inputs_warnings(made: Marionette, inputs: Input, path: Path) -> list[Mistake]:
    """Warnings about inputs of a puppet, in file order.

    Args:
        made: the marionette.
        inputs: of the file.
        path: of the inputs file.
    """
    written = path.suffix.lower() in (".yaml", ".yml")
    located = read_file(path) if written else Located(file=str(path), folder=path.parent)
    found = []
    for warning in input_warnings(made, inputs):
        place = _waypoint(made, located.data, warning.name, warning.t)
        found.append(located.problem(place, f"at t = {warning.t:g} s it {warning.message}"))
    return _in_order(found, str(path))


def warn(
    made: Marionette, file: str, inputs: Input | None = None, path: Path | None = None
) -> None:
    """Prints the number of warnings and the command that lists them; arguments as above."""
    found, command = len(warnings(made)), f"fantoccini check {file}"
    if inputs is not None:
        found += len(input_warnings(made, inputs))
        command += f" --inputs {path}"
    if found:
        say(f"{found} warning{'s' * (found > 1)}: {command}")


def _waypoint(made: Marionette, data: Any, name: str, t: float) -> tuple[str | int, ...]:
    """Path of the keys of a coordinate's first waypoint at or after a time."""
    given = data.get("coordinates", {}) if isinstance(data, dict) else {}
    names = [name, *(n for n, command in made.coordinates.commands.items() if command == name)]
    for own in names:
        if own in given:
            later = [k for k, (at, _) in enumerate(given[own]) if at >= t - 1e-9]
            return "coordinates", own, *later[:1]
    return (name,)


def _in_order(found: list[Mistake], file: str) -> list[Mistake]:
    marked = [Mistake(file, p.line, p.key, f"warning: {p.message}") for p in found]
    return sorted(marked, key=lambda p: p.line or 0)
