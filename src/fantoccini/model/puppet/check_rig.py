"""Checks of the section `rig` of a puppet file: its names exist, and limbs are chains of bodies.

A rig is the body map of the file: which bodies are trunk, head and limbs. A twin is the mirror
image of a body or string.
"""

from __future__ import annotations

from collections.abc import Iterable

from fantoccini.base.documents import Path, shown
from fantoccini.model.puppet.parts import Parts
from fantoccini.model.puppet.rig import Rig


def check_rig(parts: Parts) -> None:
    """Checks the names in a rig, and that every limb is a chain of bodies."""
    rig = parts.puppet.rig
    if not rig:
        return
    strings = {s.name for s in parts.puppet.strings if isinstance(s.name, str)}
    strings |= {parts.twin(name) for name in strings}
    parents = _parents(parts)
    owner_of_body: dict[str, str] = {}
    for i, name in enumerate(rig.trunk or ()):
        _assign_body(parts, ("rig", "trunk", i), name, "the trunk", owner_of_body)
    if rig.head:
        _assign_body(parts, ("rig", "head", "body"), rig.head.body, "the head", owner_of_body)
    if rig.control is not None and isinstance(rig.control, str):
        _assign_body(parts, ("rig", "control"), rig.control, "the control", owner_of_body)
    for key in ("carrying", "looking"):
        _check_strings(parts, ("rig", key), getattr(rig, key) or (), strings)
    for i, limb in enumerate(rig.limbs or ()):
        path: Path = ("rig", "limbs", i)
        _check_strings(parts, (*path, "strings"), limb.strings, strings)
        previous_body = ""
        for k, name in enumerate(limb.bodies):
            body_path = (*path, "bodies", k)
            if not _assign_body(parts, body_path, name, f"limb {i + 1}", owner_of_body):
                break
            if previous_body and previous_body not in _ancestors(parents, name):
                text = f"{shown(name)} does not hang on {shown(previous_body)}, the body before it"
                parts.add_mistake(body_path, text)
            previous_body = name
    _check_mirror(parts, rig)


def _assign_body(
    parts: Parts, path: Path, name: object, part: str, owner_of_body: dict[str, str]
) -> bool:
    """Assigns a body to a part of the rig, or adds a mistake.

    Args:
        parts: parts of the puppet.
        path: path of the name in the file.
        name: name of the body.
        part: part of the rig, such as "the trunk".
        owner_of_body: body -> part of the rig; changed in place.

    Returns:
        Whether the body exists and had no part yet.
    """
    if not isinstance(name, str):
        return False
    if name not in parts.body_names:
        parts.add_mistake(
            path, f"no body is called {shown(name)}{parts.hint(name, parts.body_names)}"
        )
        return False
    if name in owner_of_body:
        parts.add_mistake(path, f"the body {shown(name)} belongs to {owner_of_body[name]} already")
        return False
    owner_of_body[name] = part
    return True


def _check_strings(
    parts: Parts, path: Path, names: Iterable[object], string_names: set[str]
) -> None:
    """Adds a mistake for every name that is not a string of the puppet."""
    for i, name in enumerate(names):
        if isinstance(name, str) and name not in string_names:
            parts.add_mistake(
                (*path, i), f"no string is called {shown(name)}{parts.hint(name, string_names)}"
            )


def _parents(parts: Parts) -> dict[str, str]:
    """Body -> its parent, including mirrored twins."""
    parents: dict[str, str] = {}
    for body in parts.puppet.bodies:
        if isinstance(body.name, str) and isinstance(body.parent, str):
            parents.setdefault(parts.twin(body.name), parts.twin(body.parent))
            parents[body.name] = body.parent
    return parents


def _ancestors(parents: dict[str, str], name: str) -> set[str]:
    """Names of the bodies between a body and the world."""
    ancestors: set[str] = set()
    while (name := parents.get(name, "world")) != "world" and name not in ancestors:
        ancestors.add(name)
    return ancestors


def _check_mirror(parts: Parts, rig: Rig) -> None:
    """Adds a mistake for a limb that has a mirrored twin and is in the middle."""
    for i, limb in enumerate(rig.limbs or ()):
        names = [name for name in limb.bodies if isinstance(name, str)]
        if any(parts.twin(name) != name for name in names) and limb.side == "middle":
            text = "found a limb in the middle whose bodies have mirrored twins"
            parts.add_mistake(("rig", "limbs", i, "side"), f"{text}; needed: left or right")
