"""Checks of the section `rig`: its names exist, and its chains are chains of the tree."""

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
    owner: dict[str, str] = {}
    for i, name in enumerate(rig.trunk or ()):
        _body(parts, ("rig", "trunk", i), name, "the trunk", owner)
    if rig.head:
        _body(parts, ("rig", "head", "body"), rig.head.body, "the head", owner)
    if rig.control is not None and isinstance(rig.control, str):
        _body(parts, ("rig", "control"), rig.control, "the control", owner)
    for key in ("carrying", "looking"):
        _strings(parts, ("rig", key), getattr(rig, key) or (), strings)
    for i, limb in enumerate(rig.limbs or ()):
        at: Path = ("rig", "limbs", i)
        _strings(parts, (*at, "strings"), limb.strings, strings)
        above = ""
        for k, name in enumerate(limb.bodies):
            spot = (*at, "bodies", k)
            if not _body(parts, spot, name, f"limb {i + 1}", owner):
                break
            if above and above not in _ancestors(parents, name):
                text = f"{shown(name)} is not carried by {shown(above)}, the body before it"
                parts.add_mistake(spot, text)
            above = name
    _check_mirror(parts, rig)


def _body(parts: Parts, path: Path, name: object, part: str, owner: dict[str, str]) -> bool:
    """Whether a body has this name and no other part; reports a mistake otherwise."""
    if not isinstance(name, str):
        return False
    if name not in parts.body_names:
        parts.add_mistake(
            path, f"no body is called {shown(name)}{parts.hint(name, parts.body_names)}"
        )
        return False
    if name in owner:
        parts.add_mistake(path, f"the body {shown(name)} belongs to {owner[name]} already")
        return False
    owner[name] = part
    return True


def _strings(parts: Parts, path: Path, names: Iterable[object], known: set[str]) -> None:
    for i, name in enumerate(names):
        if isinstance(name, str) and name not in known:
            parts.add_mistake(
                (*path, i), f"no string is called {shown(name)}{parts.hint(name, known)}"
            )


def _parents(parts: Parts) -> dict[str, str]:
    """Body -> its parent, twins included."""
    parents: dict[str, str] = {}
    for body in parts.puppet.bodies:
        if isinstance(body.name, str) and isinstance(body.parent, str):
            parents.setdefault(parts.twin(body.name), parts.twin(body.parent))
            parents[body.name] = body.parent
    return parents


def _ancestors(parents: dict[str, str], name: str) -> set[str]:
    above: set[str] = set()
    while (name := parents.get(name, "world")) != "world" and name not in above:
        above.add(name)
    return above


def _check_mirror(parts: Parts, rig: Rig) -> None:
    """Checks that a limb with a mirrored twin has a side."""
    for i, limb in enumerate(rig.limbs or ()):
        names = [name for name in limb.bodies if isinstance(name, str)]
        if any(parts.twin(name) != name for name in names) and limb.side == "middle":
            text = "found a limb in the middle whose bodies have mirrored twins"
            parts.add_mistake(("rig", "limbs", i, "side"), f"{text}; needed: left or right")
