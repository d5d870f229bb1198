"""Mistakes that concern a puppet as a whole, found in its plain data.

The check reads data with any other mistakes, so that one reading reports everything. It skips data
of the wrong form, which the schema reports.
"""

from __future__ import annotations

import re
from typing import Any

from fantoccini.base.documents import NAME, Finding, Path, key_path, name_mistake, shown, value_of
from fantoccini.model.puppet.chain import DEFAULT_PIECES
from fantoccini.model.puppet.check_coordinates import check_drives, check_pose
from fantoccini.model.puppet.check_paths import check_paths
from fantoccini.model.puppet.contact import FLOOR
from fantoccini.model.puppet.limits import LIMITS
from fantoccini.model.puppet.mirror import reflected, twin_name
from fantoccini.model.puppet.shapes import has_mass
from fantoccini.model.puppet.written import Written, items, named, parameters, word

_MIRRORED = ("bodies", "strings", "springs")


def findings(data: Any) -> list[Finding]:
    """All mistakes that concern more than one part of a puppet.

    Args:
        data: plain data, of any form.
    """
    if not isinstance(data, dict):
        return []
    written = Written(data)
    _names(written)
    _mirror(written)
    _parents(written)
    _parts(written)
    check_paths(written)
    check_pose(written)
    check_drives(written)
    _contact(written)
    _parameters(written)
    return written.found


def twins(data: dict[str, Any]) -> list[Finding]:
    """Mistakes of mirror images, located at their originals in the file.

    Args:
        data: plain data of a puppet without other mistakes.
    """
    out, found = reflected(data)
    if "mirror" not in data:
        return found
    token = data["mirror"]["from"]
    for path, text in findings(out):
        section = data.get(str(path[0]), ())
        if path[0] in _MIRRORED and isinstance(path[1], int) and path[1] >= len(section):
            originals = [i for i, item in enumerate(section) if token in item["name"]]
            twin = out[path[0]][path[1]]["name"]
            path = (path[0], originals[path[1] - len(section)], *path[2:])
            text = f"in its mirrored twin {twin}: {text}"
        found.append((path, text))
    return found


def massless_joints(bodies: tuple[Any, ...], mirror: Any) -> list[Finding]:
    """Joints that make the mass matrix singular: nothing beyond them has mass.

    Args:
        bodies: the bodies of a puppet without other mistakes.
        mirror: its mirror, or None. Mass carried by a twin counts for the original.
    """
    place = {body.name: i for i, body in enumerate(bodies)}
    if mirror is not None:
        twins = {twin_name(n, mirror.from_, mirror.to): i for n, i in place.items()}
        place = twins | place
    heavy = [False] * len(bodies)
    for i, body in enumerate(bodies):
        if body.mass is None:
            own = any(has_mass(s) for s in body.shapes)
        else:
            own = value_of(body.mass) > 0
        own = own or any(value_of(n) > 0 for n in body.inertia or ())
        while own and not heavy[i]:
            heavy[i] = True
            parent = bodies[i].parent
            if parent == "world":
                break
            i = place[parent]
    moving = [
        i
        for i, body in enumerate(bodies)
        if body.joint.type != "fixed"
        and not body.joint.driven
        and not value_of(body.joint.armature)
    ]
    text = (
        "this joint moves no mass; give the body or one it carries a mass, or the joint an armature"
    )
    return [(("bodies", i, "joint"), text) for i in moving if not heavy[i]]


def _names(written: Written) -> None:
    for name, path in named(written.data):
        if "." in name and name.partition(".")[0] not in written.members:
            written.say(path, name_mistake(name))
        elif name == "world":
            written.say(path, "found 'world', which is the name of the world itself")
        elif name in written.owner:
            first = key_path(written.owner[name])
            written.say(path, f"the name {shown(name)} is taken by {first}; names are used once")
        else:
            written.owner[name] = path


def _mirror(written: Written) -> None:
    if not written.rule:
        return
    token, to = written.rule
    if token == to:
        written.say(("mirror", "to"), f"found {shown(to)} for both from and to")
        return
    made: dict[str, str] = {}
    carried = [(n, p) for n, p in named(written.data) if p[0] in _MIRRORED]
    mirrored = {p[:2] for n, p in carried if p[-2] != "joint" and token in n}
    for name, path in carried:
        if path[:2] not in mirrored:
            if token in name:
                text = f"the body's name does not contain {shown(token)}, the joint's does"
                written.say(path, f"{text}; the mirror reflects bodies with their joints")
            continue
        twin = written.twin(name)
        taken = written.owner.get(twin)
        if token not in name or taken is not None or twin in made:
            by = key_path(taken) if taken is not None else f"the twin of {made.get(twin)!r}"
            written.say(path, f"its twin would be called {shown(twin)}, which is taken by {by}")
        elif not re.fullmatch(NAME, twin, re.ASCII) and re.fullmatch(NAME, name, re.ASCII):
            written.say(
                ("mirror", "to"), f"{shown(twin)}, the twin of {name!r}, is not a valid name"
            )
        made[twin] = name
    if not mirrored:
        shared = {w for n, _ in carried for w in re.split(r"[_-]", n)}
        text = f"no body, string or spring has {shown(token)} in its name"
        written.say(("mirror", "from"), text + written.near(token, shared))


def _parents(written: Written) -> None:
    bodies = items(written.data, "bodies")
    parent_of: dict[str, str] = {}
    parents = written.known | {"world"}
    for i, body in bodies:
        name, parent = word(body, "name"), word(body, "parent")
        if parent is None or parent == "world":
            continue
        if parent not in written.known:
            hint = written.near(parent, parents)
            written.say(("bodies", i, "parent"), f"no body is called {shown(parent)}{hint}")
        elif name is not None and written.bodies[name] == i:
            parent_of[name] = parent
            parent_of.setdefault(written.twin(name), written.twin(parent))
    done: set[str] = set()
    for start in parent_of:
        walk: dict[str, None] = {}
        name = start
        while name in parent_of and name not in done and name not in walk:
            walk[name] = None
            name = parent_of[name]
        if name in walk:
            ring = list(walk)[list(walk).index(name) :]
            shown_ring = ring if len(ring) < 9 else [*ring[:7], "...", ring[-1]]
            text = f"the parents form a cycle: {' -> '.join([*shown_ring, name])}"
            firsts = [n for n in ring if n in written.bodies]
            if firsts:
                written.say(("bodies", written.bodies[firsts[0]], "parent"), text)
        done.update(walk)


def _parts(written: Written) -> None:
    """Checks the number of parts."""
    parts = dict.fromkeys(_MIRRORED, 0)
    for key in parts:
        for _, item in items(written.data, key):
            name, chain, count = word(item, "name"), item.get("chain"), 1
            if isinstance(chain, dict):
                pieces = chain.get("pieces", DEFAULT_PIECES)
                count = min(pieces, LIMITS.max_pieces) if isinstance(pieces, int) else 1
            twice = name is not None and written.twin(name) != name
            parts[key] += 2 * count if twice else count
    total = sum(parts.values())
    if total > LIMITS.max_parts:
        path = max(parts, key=lambda part: parts[part])
        more = ", twins included" if written.rule else ""
        text = f"found {total} bodies, strings, springs and masses of chains{more}"
        written.say((path,), f"{text}; allowed: {LIMITS.max_parts}")


def _contact(written: Written) -> None:
    """Checks the names of pairs with rules of their own."""
    if written.data.get("contact") and FLOOR in written.owner:
        text = "found 'floor', which is the floor's name in contact; choose another"
        written.say(written.owner[FLOOR], text)
    obstacles = {word(item, "name") for _, item in items(written.data, "obstacles")}
    props = written.data.get("props")
    listed = [*written.members, *(props if isinstance(props, list) else ())]
    allowed = {FLOOR, *written.known, *(n for n in (*obstacles, *listed) if isinstance(n, str))}
    for i, pair in items(written.data.get("contact"), "pairs"):
        between = pair.get("between")
        for k, name in enumerate(between if isinstance(between, list) else []):
            if isinstance(name, str) and name not in allowed:
                hint = written.near(name, allowed)
                text = f"no body, obstacle, prop or puppet is called {shown(name)}{hint}"
                written.say(("contact", "pairs", i, "between", k), text)


def _parameters(written: Written) -> None:
    first: dict[str, tuple[Path, float]] = {}
    for path, found in parameters(written.data):
        name, value = found["parameter"], found["value"]
        place, known = first.setdefault(name, (path, value))
        if "." in name and name.partition(".")[0] not in written.members:
            written.say((*path, "parameter"), name_mistake(name))
        if value != known:
            text = f"the parameter {shown(name)} is {value:g} here but {known:g} in"
            written.say(path, f"{text} {key_path(place)}; one name has one value")
