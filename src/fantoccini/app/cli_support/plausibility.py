"""Warnings about files that are valid but implausible.

A waypoint is a time and a value that an input passes through. A member is a puppet of a scene. A
marionette is a puppet with its compiled equations; `marionette.puppet` is the description in its
file.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from fantoccini.app.cli_support.terminal import print_message
from fantoccini.base import Mistake
from fantoccini.base.documents import Finding, Located, key_path, read_file
from fantoccini.dynamics.equilibrium import input_warnings, warnings
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import Puppet
from fantoccini.motion import Input


def puppet_warnings(marionette: Marionette, file: str) -> list[Mistake]:
    """Warnings about a puppet, in file order.

    Args:
        marionette: marionette of the file.
        file: FILE argument.
    """
    located = marionette.puppet.located
    if located.data is None:  # assembled from the files of a scene
        return _member_warnings(marionette.puppet, warnings(marionette))
    return _sorted_warnings(
        [located.problem(*warning) for warning in warnings(marionette, located.data)], file
    )


def _member_warnings(puppet: Puppet, findings: Iterable[Finding]) -> list[Mistake]:
    """Warnings about parts of a scene, each for the file that describes the part."""
    mistakes = []
    for path, text in findings:
        if len(path) < 2 or not isinstance(path[1], int):
            continue  # about the size of a puppet; a scene has none
        name = getattr(puppet, str(path[0]))[path[1]].name
        file, line = puppet.locate(name)
        mistakes.append(Mistake(file, line, key_path((name, *path[2:])), f"warning: {text}"))
    return mistakes


def inputs_warnings(
    marionette: Marionette, inputs: Input, path: Path, changes: Iterable[Mistake] = ()
) -> list[Mistake]:
    """Warnings about inputs of a puppet, in file order.

    Args:
        marionette: the marionette.
        inputs: inputs of the file.
        path: path of the inputs file.
        changes: deviations of the inputs from the text of a score.
    """
    is_yaml = path.suffix.lower() in (".yaml", ".yml")
    located = read_file(path) if is_yaml else Located(file=str(path), folder=path.parent)
    mistakes = [*changes]
    for warning in input_warnings(marionette, inputs):
        waypoint_path = _waypoint_path(marionette, located.data, warning.name, warning.t)
        mistakes.append(
            located.problem(waypoint_path, f"at t = {warning.t:g} s it {warning.message}")
        )
    return _sorted_warnings(mistakes, str(path))


def warn_implausible(
    marionette: Marionette, file: str, inputs: Input | None = None, path: Path | None = None
) -> None:
    """Prints the number of warnings and the command that lists them."""
    n_warnings, command = len(warnings(marionette)), f"fantoccini check {file}"
    if inputs is not None:
        n_warnings += len(input_warnings(marionette, inputs))
        command += f" --inputs {path}"
    if n_warnings:
        print_message(f"{n_warnings} warning{'s' * (n_warnings > 1)}: {command}")


def _waypoint_path(marionette: Marionette, data: Any, name: str, t: float) -> tuple[str | int, ...]:
    """Key path of a coordinate's first waypoint at or after a time."""
    waypoints = data.get("coordinates", {}) if isinstance(data, dict) else {}
    names = [
        name,
        *(n for n, command in marionette.coordinates.commands.items() if command == name),
    ]
    for coordinate in names:
        if coordinate in waypoints:
            later_indices = [
                k for k, (time, _) in enumerate(waypoints[coordinate]) if time >= t - 1e-9
            ]
            return "coordinates", coordinate, *later_indices[:1]
    return (name,)


def _sorted_warnings(mistakes: list[Mistake], file: str) -> list[Mistake]:
    labelled = [Mistake(file, p.line, p.key, f"warning: {p.message}") for p in mistakes]
    return sorted(labelled, key=lambda p: p.line or 0)
