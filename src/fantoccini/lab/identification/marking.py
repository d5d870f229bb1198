"""Numbers of a puppet file by their places: made parameters, and replaced.

A place is the name of a body, joint, string, spring or of a drive's coordinate, and keys:
``forearm.mass``, ``elbow.damping``, ``torso.drag.linear``, ``hand.length``, ``hand.path.0.at.z``,
``rubber.stiffness``, ``hand.length.control.stiffness``.
"""

from __future__ import annotations

import copy
import os
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Any

from fantoccini.base import StateError, nearest, replacing
from fantoccini.base.documents import Located, Path, with_numbers
from fantoccini.model.puppet import Puppet, is_number, items, parameters, twin_name, word

_AXES = {"x": 0, "y": 1, "z": 2}
_SIGNED = {"at", "com", "world", "gravity", "rest"}
"""Keys of numbers that may be negative."""
_ADDED = {"mass", "damping", "linear", "quadratic", "angular", "stiffness"}
"""Keys that a file may leave out, and whose numbers can be looked for all the same."""


@dataclass(frozen=True)
class Mark:
    """A number of a puppet file that is looked for.

    Attributes:
        label: as it was asked for: the name of a parameter, or a place.
        parameter: the name of the parameter that it is.
        places: where it stands.
        value: its number; None where the file leaves it out.
        positive: whether it is never negative.
    """

    label: str
    parameter: str
    places: tuple[Path, ...]
    value: float | None
    positive: bool


def find(data: Any, label: str, taken: Collection[str] = ()) -> Mark:
    """The number that a label means.

    Args:
        data: plain data of a puppet file.
        label: the name of a parameter, or a place.
        taken: names of parameters that other places became.

    Raises:
        StateError: there is no such number.
    """
    own = [(path, value) for path, value in parameters(data) if value["parameter"] == label]
    if own:
        places = tuple(path for path, _ in own)
        return Mark(label, label, places, float(own[0][1]["value"]), _positive(places))
    starts = list(_starts(data, label))
    if not starts:
        known = [name for name, _ in _names(data)]
        if (twin := _original(data, label, known)) is not None:
            raise StateError(
                f"{label.split('.', 1)[0]} is the mirror image of {twin}, whose "
                f"numbers it shares; look for those of {twin}"
            )
        hint = nearest(label.split(".", 1)[0], known)
        raise StateError(
            f"found {label}: no parameter of this name, and nothing that is called so "
            f"before its first dot{hint}"
        )
    refused = ""
    for path, keys in starts:
        try:
            place, value = _walked(data, path, keys)
        except StateError as error:
            refused = refused or str(error)
            continue
        if isinstance(value, dict):
            name = value.get("parameter")
            if isinstance(name, str):
                mark = find(data, name)
                return replace(mark, label=label)
            raise StateError(f"{label} is no number; it has {', '.join(map(str, value))}")
        if value is not None and not is_number(value):
            raise StateError(f"{label} is {value!r:.40}; only a number can be looked for")
        number = None if value is None else float(value)
        name = re.sub(r"[^A-Za-z0-9_]", "_", label)[:50]
        return Mark(label, _free(name, data, taken), (place,), number, _positive((place,)))
    raise StateError(refused)


def _free(name: str, data: Any, taken: Collection[str]) -> str:
    """The name of a parameter that the file does not have."""
    others = {*taken, *(value["parameter"] for _, value in parameters(data))}
    while name in others:
        name += "_"
    return name


def _original(data: Any, label: str, known: list[str]) -> str | None:
    """The name whose mirror image a label begins with."""
    rule = data.get("mirror")
    token, to = word(rule, "from"), word(rule, "to")
    if not token or not to:
        return None
    return next(
        (
            one
            for one in known
            if token in one and label.startswith(f"{twin_name(one, token, to)}.")
        ),
        None,
    )


def _positive(places: tuple[Path, ...]) -> bool:
    return not any(set(path) & _SIGNED for path in places)


def _names(data: Any) -> Iterator[tuple[str, Path]]:
    """Names that a place may begin with."""
    for i, body in items(data, "bodies"):
        joint = body.get("joint")
        if (name := word(body, "name")) is not None:
            yield name, ("bodies", i)
            if isinstance(joint, dict):
                yield word(joint, "name") or name, ("bodies", i, "joint")
    for section in ("strings", "springs"):
        for i, item in items(data, section):
            if (name := word(item, "name")) is not None:
                yield name, (section, i)
    for i, drive in items(data, "drives"):
        on = drive.get("on")
        for name in on if isinstance(on, list) else [on]:
            if isinstance(name, str):
                yield name, ("drives", i)


def _starts(data: Any, label: str) -> Iterator[tuple[Path, list[str]]]:
    """Items with a name that a label begins with, longest names first, and the keys that follow."""
    found = [(name, path) for name, path in _names(data) if label.startswith(f"{name}.")]
    for name, path in sorted(found, key=lambda one: -len(one[0])):
        yield path, label[len(name) + 1 :].split(".")


def _walked(data: Any, path: Path, keys: list[str]) -> tuple[Path, Any]:
    """The place that keys lead to from a path, and the value there; None where it is left out."""
    here = data
    for key in path:
        here = here[key]
    for i, key in enumerate(keys):
        if isinstance(here, dict) and key in here:
            step: str | int = key
        elif isinstance(here, list) and (key in _AXES or key.isdecimal()):
            step = _AXES.get(key, -1) if key in _AXES else int(key)
            if step >= len(here):
                raise StateError(f"{'.'.join(keys)}: {key} is beyond the {len(here)} entries there")
        elif isinstance(here, dict) and key in _ADDED and i == len(keys) - 1:
            return (*path, key), None
        elif isinstance(here, dict) and key == "drag" and i == len(keys) - 2:
            return (*path, key, keys[-1]), None
        else:
            known = list(here) if isinstance(here, dict) else ["x", "y", "z", "0", "1", "2"]
            raise StateError(f"{'.'.join(keys)}: found no {key}{nearest(key, map(str, known))}")
        path, here = (*path, step), here[step]
    return path, here


def marked(located: Located, marks: Mapping[Mark, float]) -> Puppet:
    """The puppet of a file in which these numbers are parameters with these values."""
    data = copy.deepcopy(located.data)
    for mark, value in marks.items():
        for place in mark.places:
            _put(data, place, {"parameter": mark.parameter, "value": value})
    return Puppet.model_validate(data, context=replace(located, data=data))


def _put(data: Any, place: Path, value: Any) -> None:
    here = data
    for key in place[:-1]:
        here = here.setdefault(key, {}) if isinstance(here, dict) else here[key]
    here[place[-1]] = value


def write_numbers(text: str, numbers: Mapping[Mark, float], path: str | FilePath) -> None:
    """Writes a puppet file with other numbers; the rest of its text stays as it is.

    Args:
        text: of the file.
        numbers: their values.
        path: of the file to write.

    Raises:
        StateError: a number is written as an alias or with an anchor.
        FileNotFoundError: the folder does not exist.
    """
    new = with_numbers(text, {place: x for mark, x in numbers.items() for place in mark.places})
    with replacing(path) as temporary:
        temporary.write_bytes(new.encode("utf-8"))


def missing_files(data: Any, folder: FilePath) -> tuple[str, ...]:
    """Files that a puppet names and that a folder does not have."""
    found, stack = [], [data]
    while stack:
        here = stack.pop()
        if isinstance(here, dict):
            if (name := word(here, "file")) is not None and not os.path.isfile(folder / name):
                found.append(name)
            stack += here.values()
        elif isinstance(here, list):
            stack += here
    return tuple(sorted(set(found)))
