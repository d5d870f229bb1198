"""Finds numbers in a puppet file by their paths, turns them into parameters, replaces them.

A path begins with the name of a body, joint, string, spring or a drive's coordinate; keys follow:
``forearm.mass``, ``elbow.damping``, ``torso.drag.linear``, ``hand.length``, ``hand.path.0.at.z``,
``rubber.stiffness``, ``hand.length.control.stiffness``.

A parameter is a number with a name, which can change without compiling the puppet again. A drive
moves a coordinate by a motor.
"""

from __future__ import annotations

import copy
import os
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Any

from fantoccini.base import StateError, did_you_mean, replacing
from fantoccini.base.documents import Located, Path, with_numbers
from fantoccini.model.puppet import Puppet, is_number, items, parameters, twin_name, word

AXIS_INDEX = {"x": 0, "y": 1, "z": 2}
SIGNED_KEYS = {"at", "com", "world", "gravity", "rest"}
"""Keys of numbers that may be negative."""
OPTIONAL_KEYS = {"mass", "damping", "linear", "quadratic", "angular", "stiffness"}
"""Optional keys whose numbers can be estimated even if a file omits them."""


@dataclass(frozen=True)
class FileNumber:
    """A number of a puppet file that is unknown.

    Attributes:
        label: the name of a parameter or the path by which it was requested.
        parameter: the name of its parameter, existing or new.
        paths: its paths in the file.
        value: its value; None if the file omits it.
        positive: whether it cannot be negative.
    """

    label: str
    parameter: str
    paths: tuple[Path, ...]
    value: float | None
    positive: bool


def find_number(data: Any, label: str, used_names: Collection[str] = ()) -> FileNumber:
    """The number of a puppet file with a label.

    Args:
        data: plain data of a puppet file.
        label: the name of a parameter, or a path.
        used_names: names of parameters that other numbers already have.

    Raises:
        StateError: there is no such number.
    """
    entries = [(path, value) for path, value in parameters(data) if value["parameter"] == label]
    if entries:
        paths = tuple(path for path, _ in entries)
        return FileNumber(label, label, paths, float(entries[0][1]["value"]), _is_positive(paths))
    prefixes = list(_named_prefixes(data, label))
    if not prefixes:
        names = [name for name, _ in _named_items(data)]
        if (original := _mirrored_original(data, label, names)) is not None:
            raise StateError(
                f"{label.split('.', 1)[0]} is the mirror image of {original}, whose "
                f"numbers it shares; name those of {original}"
            )
        hint = did_you_mean(label.split(".", 1)[0], names)
        raise StateError(
            f"found {label}: no parameter has this name, and no part of the puppet has the name "
            f"before the first dot{hint}"
        )
    first_error = ""
    for path, keys in prefixes:
        try:
            full_path, value = _follow_keys(data, path, keys)
        except StateError as error:
            first_error = first_error or str(error)
            continue
        if isinstance(value, dict):
            name = value.get("parameter")
            if isinstance(name, str):
                return replace(find_number(data, name), label=label)
            raise StateError(f"{label} is not a number; it has {', '.join(map(str, value))}")
        if value is not None and not is_number(value):
            raise StateError(f"{label} is {value!r:.40}; only a number can be unknown")
        number = None if value is None else float(value)
        name = re.sub(r"[^A-Za-z0-9_]", "_", label)[:50]
        parameter, paths = _unused_name(name, data, used_names), (full_path,)
        return FileNumber(label, parameter, paths, number, _is_positive(paths))
    raise StateError(first_error)


def _unused_name(name: str, data: Any, used_names: Collection[str]) -> str:
    """A name that no parameter of the file has."""
    used = {*used_names, *(value["parameter"] for _, value in parameters(data))}
    while name in used:
        name += "_"
    return name


def _mirrored_original(data: Any, label: str, names: list[str]) -> str | None:
    """Name of the part whose mirror image a label names; None if it names none."""
    rule = data.get("mirror")
    from_word, to_word = word(rule, "from"), word(rule, "to")
    if not from_word or not to_word:
        return None
    return next(
        (
            name
            for name in names
            if from_word in name and label.startswith(f"{twin_name(name, from_word, to_word)}.")
        ),
        None,
    )


def _is_positive(paths: tuple[Path, ...]) -> bool:
    return not any(set(path) & SIGNED_KEYS for path in paths)


def _named_items(data: Any) -> Iterator[tuple[str, Path]]:
    """Names with which a label may begin, and the paths of their items."""
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
        targets = drive.get("on")
        for name in targets if isinstance(targets, list) else [targets]:
            if isinstance(name, str):
                yield name, ("drives", i)


def _named_prefixes(data: Any, label: str) -> Iterator[tuple[Path, list[str]]]:
    """Paths of parts whose name begins a label, with the keys that follow; longest name first."""
    matches = [(name, path) for name, path in _named_items(data) if label.startswith(f"{name}.")]
    for name, path in sorted(matches, key=lambda match: -len(match[0])):
        yield path, label[len(name) + 1 :].split(".")


def _follow_keys(data: Any, path: Path, keys: list[str]) -> tuple[Path, Any]:
    """A path extended by keys, and the value there; None if the file omits it."""
    node = data
    for key in path:
        node = node[key]
    for i, key in enumerate(keys):
        if isinstance(node, dict) and key in node:
            index: str | int = key
        elif isinstance(node, list) and (key in AXIS_INDEX or key.isdecimal()):
            index = AXIS_INDEX.get(key, -1) if key in AXIS_INDEX else int(key)
            if index >= len(node):
                raise StateError(f"{'.'.join(keys)}: {key} is beyond the {len(node)} entries there")
        elif isinstance(node, dict) and key in OPTIONAL_KEYS and i == len(keys) - 1:
            return (*path, key), None
        elif isinstance(node, dict) and key == "drag" and i == len(keys) - 2:
            return (*path, key, keys[-1]), None
        else:
            allowed = list(node) if isinstance(node, dict) else ["x", "y", "z", "0", "1", "2"]
            raise StateError(
                f"{'.'.join(keys)}: found no {key}{did_you_mean(key, map(str, allowed))}"
            )
        path, node = (*path, index), node[index]
    return path, node


def puppet_with_parameters(located: Located, numbers: Mapping[FileNumber, float]) -> Puppet:
    """The puppet of a file in which numbers are parameters with given values."""
    data = copy.deepcopy(located.data)
    for number, value in numbers.items():
        for path in number.paths:
            _set_value(data, path, {"parameter": number.parameter, "value": value})
    return Puppet.model_validate(data, context=replace(located, data=data))


def _set_value(data: Any, path: Path, value: Any) -> None:
    """Sets the value at a path of plain data."""
    node = data
    for key in path[:-1]:
        node = node.setdefault(key, {}) if isinstance(node, dict) else node[key]
    node[path[-1]] = value


def write_numbers(text: str, numbers: Mapping[FileNumber, float], path: str | FilePath) -> None:
    """Writes a puppet file with other numbers; the rest of its text stays unchanged.

    Args:
        text: text of the original file.
        numbers: number -> new value.
        path: path of the file to write.

    Raises:
        StateError: a number is written as an alias or with an anchor.
        FileNotFoundError: the folder does not exist.
    """
    new_text = with_numbers(text, {p: x for number, x in numbers.items() for p in number.paths})
    with replacing(path) as temporary:
        temporary.write_bytes(new_text.encode("utf-8"))


def missing_files(data: Any, folder: FilePath) -> tuple[str, ...]:
    """Names of the files to which a puppet refers and that are not in a folder."""
    missing, stack = [], [data]
    while stack:
        node = stack.pop()
        if isinstance(node, dict):
            if (name := word(node, "file")) is not None and not os.path.isfile(folder / name):
                missing.append(name)
            stack += node.values()
        elif isinstance(node, list):
            stack += node
    return tuple(sorted(set(missing)))
