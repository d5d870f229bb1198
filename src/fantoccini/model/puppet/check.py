"""Checks of a puppet as a whole.

A puppet with invalid parts is checked too, so that all mistakes are reported together. Those
parts have the value ``UNCLEAR``, for which these checks report nothing.

A twin is the mirror image of a body, joint or string. A member is a puppet of a scene.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from fantoccini.base.documents import NAME, Finding, Path, key_path, name_mistake, shown, value_of
from fantoccini.model.puppet.check_coordinates import check_drives, check_pose
from fantoccini.model.puppet.check_paths import check_paths
from fantoccini.model.puppet.check_rig import check_rig
from fantoccini.model.puppet.contact import FLOOR, Contact
from fantoccini.model.puppet.elements import Body, Mirror
from fantoccini.model.puppet.limits import LIMITS
from fantoccini.model.puppet.mirror import reflected, twin_name
from fantoccini.model.puppet.parts import AnyPuppet, Parts, named_parts
from fantoccini.model.puppet.shapes import has_mass
from fantoccini.model.puppet.written import parameters

_MIRRORED_SECTIONS = ("bodies", "strings", "springs")


def findings(puppet: AnyPuppet, data: dict[str, Any]) -> list[Finding]:
    """All mistakes that concern more than one part of a puppet.

    Args:
        puppet: valid puppet, or the result of :func:`valid_parts`.
        data: plain data of its file.
    """
    parts = Parts(puppet, data)
    _check_names(parts)
    _check_mirror(parts)
    _check_parents(parts)
    _check_count(parts)
    check_paths(parts)
    check_pose(parts)
    check_drives(parts)
    _check_contact(parts)
    check_rig(parts)
    _check_parameters(parts, data)
    return parts.mistakes


def twin_findings(
    puppet: AnyPuppet, data: dict[str, Any], valid_parts: Callable[[dict[str, Any]], AnyPuppet]
) -> list[Finding]:
    """Mistakes of mirror images, located at their originals in the file.

    Args:
        puppet: a puppet without other mistakes.
        data: its plain data.
        valid_parts: makes a puppet of the valid parts of plain data.
    """
    mirrored_data, mistakes = reflected(data)
    if puppet.mirror is None:
        return mistakes
    word = puppet.mirror.from_
    # Shapes are left out: those of twins are as valid, and reading meshes is slow.
    bodies = [{k: v for k, v in body.items() if k != "shapes"} for body in mirrored_data["bodies"]]
    both_halves = valid_parts(mirrored_data | {"bodies": bodies, "obstacles": []})
    for path, text in findings(both_halves, mirrored_data):
        section = data.get(str(path[0]), ())
        if path[0] in _MIRRORED_SECTIONS and isinstance(path[1], int) and path[1] >= len(section):
            originals = [i for i, item in enumerate(section) if word in item["name"]]
            twin = mirrored_data[path[0]][path[1]]["name"]
            path = (path[0], originals[path[1] - len(section)], *path[2:])
            text = f"in its mirrored twin {twin}: {text}"
        mistakes.append((path, text))
    return mistakes


def massless_joints(bodies: tuple[Body, ...], mirror: Mirror | None) -> list[Finding]:
    """Joints that make the mass matrix singular: nothing beyond them has mass.

    Args:
        bodies: bodies of a puppet without other mistakes.
        mirror: mirror of the puppet, or None. Mass carried by a twin counts for the original.
    """
    index_of = {body.name: i for i, body in enumerate(bodies)}
    if mirror is not None:
        twin_findings = {twin_name(n, mirror.from_, mirror.to): i for n, i in index_of.items()}
        index_of = twin_findings | index_of
    carries_mass = [False] * len(bodies)
    for i, body in enumerate(bodies):
        if body.mass is None:
            has_own_mass = any(has_mass(s) for s in body.shapes)
        else:
            has_own_mass = value_of(body.mass) > 0
        has_own_mass = has_own_mass or any(value_of(n) > 0 for n in body.inertia or ())
        while has_own_mass and not carries_mass[i]:
            carries_mass[i] = True
            parent = bodies[i].parent
            if parent == "world":
                break
            i = index_of[parent]
    movable = [
        i
        for i, body in enumerate(bodies)
        if body.joint.type != "fixed"
        and not body.joint.driven
        and not value_of(body.joint.armature)
    ]
    text = "this joint moves no mass; give a body that it carries a mass, or the joint an armature"
    return [(("bodies", i, "joint"), text) for i in movable if not carries_mass[i]]


def _check_names(parts: Parts) -> None:
    for name, path in named_parts(parts.puppet):
        if "." in name and name.partition(".")[0] not in parts.puppet.members:
            parts.add_mistake(path, name_mistake(name))
        elif name == "world":
            parts.add_mistake(path, "found 'world', which is the name of the world itself")
        elif name in parts.path_of:
            first_key_path = key_path(parts.path_of[name])
            parts.add_mistake(
                path, f"the name {shown(name)} is taken by {first_key_path}; names are used once"
            )
        else:
            parts.path_of[name] = path


def _check_mirror(parts: Parts) -> None:
    if not parts.mirror_words:
        return
    word, twin_word = parts.mirror_words
    if word == twin_word:
        parts.add_mistake(("mirror", "to"), f"found {shown(twin_word)} for both from and to")
        return
    originals: dict[str, str] = {}
    named_paths = [(n, p) for n, p in named_parts(parts.puppet) if p[0] in _MIRRORED_SECTIONS]
    mirrored_paths = {p[:2] for n, p in named_paths if p[-2] != "joint" and word in n}
    for name, path in named_paths:
        if path[:2] not in mirrored_paths:
            if word in name:
                text = f"the body's name does not contain {shown(word)}, the joint's does"
                parts.add_mistake(path, f"{text}; the mirror reflects bodies with their joints")
            continue
        twin = parts.twin(name)
        taken_path = parts.path_of.get(twin)
        if word not in name or taken_path is not None or twin in originals:
            owner_text = (
                key_path(taken_path)
                if taken_path is not None
                else f"the twin of {originals.get(twin)!r}"
            )
            parts.add_mistake(
                path, f"its twin would be called {shown(twin)}, which is taken by {owner_text}"
            )
        elif not re.fullmatch(NAME, twin, re.ASCII) and re.fullmatch(NAME, name, re.ASCII):
            parts.add_mistake(
                ("mirror", "to"), f"{shown(twin)}, the twin of {name!r}, is not a valid name"
            )
        originals[twin] = name
    if not mirrored_paths:
        words_in_names = {w for n, _ in named_paths for w in re.split(r"[_-]", n)}
        text = f"no body, string or spring has {shown(word)} in its name"
        parts.add_mistake(("mirror", "from"), text + parts.hint(word, words_in_names))


def _check_parents(parts: Parts) -> None:
    parent_of: dict[str, str] = {}
    parents = parts.body_names | {"world"}
    for i, body in enumerate(parts.puppet.bodies):
        name, parent = body.name, body.parent
        if parent == "world" or not isinstance(parent, str):
            continue
        if parent not in parts.body_names:
            hint = parts.hint(parent, parents)
            parts.add_mistake(("bodies", i, "parent"), f"no body is called {shown(parent)}{hint}")
        elif isinstance(name, str) and parts.bodies[name] == i:
            parent_of[name] = parent
            parent_of.setdefault(parts.twin(name), parts.twin(parent))
    visited: set[str] = set()
    for start in parent_of:
        ancestors: dict[str, None] = {}
        name = start
        while name in parent_of and name not in visited and name not in ancestors:
            ancestors[name] = None
            name = parent_of[name]
        if name in ancestors:
            cycle = list(ancestors)[list(ancestors).index(name) :]
            listed_cycle = cycle if len(cycle) < 9 else [*cycle[:7], "...", cycle[-1]]
            text = f"the parents form a cycle: {' -> '.join([*listed_cycle, name])}"
            bodies_here = [n for n in cycle if n in parts.bodies]
            if bodies_here:
                parts.add_mistake(("bodies", parts.bodies[bodies_here[0]], "parent"), text)
        visited.update(ancestors)


def _check_count(parts: Parts) -> None:
    """Checks the total number of parts."""
    counts = dict.fromkeys(_MIRRORED_SECTIONS, 0)
    for key in counts:
        for item in getattr(parts.puppet, key):
            pieces = item.chain.pieces if key == "strings" and item.chain else 1
            count = min(pieces, LIMITS.max_pieces) if isinstance(pieces, int) else 1
            has_twin = isinstance(item.name, str) and parts.twin(item.name) != item.name
            counts[key] += 2 * count if has_twin else count
    total = sum(counts.values())
    if total > LIMITS.max_parts:
        path = max(counts, key=lambda part: counts[part])
        twins_text = ", twins included" if parts.mirror_words else ""
        text = f"found {total} bodies, strings, springs and masses of chains{twins_text}"
        parts.add_mistake((path,), f"{text}; allowed: {LIMITS.max_parts}")


def _check_contact(parts: Parts) -> None:
    """Checks the names in contact pairs."""
    puppet = parts.puppet
    if puppet.contact and FLOOR in parts.path_of:
        text = "found 'floor', which is the floor's name in contact; choose another"
        parts.add_mistake(parts.path_of[FLOOR], text)
    if not isinstance(puppet.contact, Contact):
        return
    other_names = (
        *(obstacle.name for obstacle in puppet.obstacles),
        *puppet.members,
        *puppet.props,
    )
    allowed = {FLOOR, *parts.body_names, *(name for name in other_names if isinstance(name, str))}
    for i, pair in enumerate(puppet.contact.pairs):
        for k, name in enumerate(pair.between):
            if isinstance(name, str) and name not in allowed:
                hint = parts.hint(name, allowed)
                text = f"no body, obstacle, prop or puppet is called {shown(name)}{hint}"
                parts.add_mistake(("contact", "pairs", i, "between", k), text)


def _check_parameters(parts: Parts, data: dict[str, Any]) -> None:
    first_uses: dict[str, tuple[Path, float]] = {}
    for path, parameter in parameters(data):
        name, value = parameter["parameter"], parameter["value"]
        first_path, first_value = first_uses.setdefault(name, (path, value))
        if "." in name and name.partition(".")[0] not in parts.puppet.members:
            parts.add_mistake((*path, "parameter"), name_mistake(name))
        if value != first_value:
            text = f"the parameter {shown(name)} is {value:g} here but {first_value:g} in"
            parts.add_mistake(path, f"{text} {key_path(first_path)}; one name has one value")
