"""Plausibility of the two halves of a puppet: strings without a twin, parts on the wrong side.

A part is paired with another if a word in its name, ``left``, is replaced by ``right`` there; in a
file with a mirror, the words are the mirror's.

A twin is the mirror image of a body, joint or string. A member is a puppet of a scene.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from fantoccini.base import Array
from fantoccini.base.documents import Finding, Number
from fantoccini.model.puppet import Puppet, String, twin_name
from fantoccini.model.tree import Tree, link_inertia

_SIDE_WORDS = ("left", "right")
MAX_OVERLAP = 1e-3
"""Largest distance of twins that lie in one another, relative to the puppet's size."""
MIN_OFFSET = 0.02
"""Smallest distance of twins with distinct sides, relative to the puppet's size."""


def side_findings(
    puppet: Puppet, tree: Tree, poses: Array, size: float, number: Callable[[Number], float]
) -> Iterator[Finding]:
    """Findings on the halves of a puppet.

    Args:
        puppet: the puppet as its file describes it.
        tree: its tree, with twins.
        poses: (n_links, 3, 4) poses of the links in the file's pose.
        size: size of the puppet [m].
        number: function from a number of the file, or its parameter, to the value.
    """
    mirror = puppet.mirror
    words = _SIDE_WORDS if mirror is None else (mirror.from_, mirror.to)
    yield from _twin_findings(puppet, words, _centres(tree, poses, number), size)
    unpaired_strings = {} if mirror is not None else _single_strings(puppet, words)
    for i, string in enumerate(puppet.strings):
        text = _string_remark(string, words, mirrored=mirror is not None) or unpaired_strings.get(
            i, ""
        )
        if text:
            yield ("strings", i, "name"), text


def _centres(tree: Tree, poses: Array, number: Callable[[Number], float]) -> dict[str, Array]:
    """Body with mass -> (3,) centre of mass in the world."""
    centres = {}
    for link, pose in zip(tree.links, poses, strict=True):
        mass, centre, _ = link_inertia(link, number)
        if mass > 0.0:
            centres[link.name] = pose[:, :3] @ centre + pose[:, 3]
    return centres


def _twin_findings(
    puppet: Puppet, words: tuple[str, str], centres: dict[str, Array], size: float
) -> Iterator[Finding]:
    """Twins that overlap, and twins on the side opposite to their names."""
    offsets: dict[str, dict[int, Array]] = {}  # by member of a scene: each faces its own way
    for i, body in enumerate(puppet.bodies):
        member, dot, part_name = body.name.rpartition(".")
        twin = member + dot + twin_name(part_name, *words)
        if twin == body.name or not {body.name, twin} <= {*centres}:
            continue
        offset = centres[body.name] - centres[twin]
        if np.linalg.norm(offset) >= MAX_OVERLAP * size:
            offsets.setdefault(member, {})[i] = offset
        elif puppet.mirror is not None:  # those of a flat puppet may lie in one another
            text = f"found {body.name} and {twin} in one another: move the joint off the middle"
            yield ("bodies", i, "joint"), text
    for twin_offsets in offsets.values():
        axis = int(np.argmax(np.sum(np.abs(list(twin_offsets.values())), axis=0)))
        offsets_along = {i: float(offset[axis]) for i, offset in twin_offsets.items()}
        side_sign = np.sign(sum(offsets_along.values()))
        for i, distance in offsets_along.items():
            if distance * side_sign < -MIN_OFFSET * size:
                text = f"found {puppet.bodies[i].name} on the side of the parts named {words[1]}"
                yield ("bodies", i, "joint"), f"{text}, which the others named {words[0]} are not"


def _single_strings(puppet: Puppet, words: tuple[str, str]) -> dict[int, str]:
    """Strings named after a side that have no twin, in a puppet whose bodies come in pairs.

    A string whose bodies are the twins of another one's is its twin, whatever its name.

    Returns:
        Index of the string -> remark.
    """
    pairs: dict[str, tuple[str, str]] = {}  # by member of a scene
    bodies = {body.name for body in puppet.bodies}
    for body in puppet.bodies:
        twin = _twin_name(body.name, words)
        if twin != body.name and twin in bodies:
            pairs.setdefault(body.name.rpartition(".")[0], (body.name, twin))
    names = {string.name for string in puppet.strings}
    bodies_of_strings = [_tied_bodies(string) for string in puppet.strings]
    remarks = {}
    for i, string in enumerate(puppet.strings):
        twin, pair = _twin_name(string.name, words), pairs.get(string.name.rpartition(".")[0])
        mirrored_bodies = [_twin_name(body, words) for body in bodies_of_strings[i]]
        has_twin = twin in names or (
            mirrored_bodies != bodies_of_strings[i] and mirrored_bodies in bodies_of_strings
        )
        if pair is None or twin == string.name or has_twin:
            continue
        text = f"found {string.name!r} and no string {twin!r}, although the bodies come in pairs"
        remarks[i] = f"{text}, such as {pair[0]} and {pair[1]}: is a string missing?"
    return remarks


def _twin_name(name: str, words: tuple[str, str]) -> str:
    """Name of a part or of a scene member's part, with left and right exchanged."""
    member, dot, part_name = name.rpartition(".")
    twin = twin_name(part_name, *words)
    return member + dot + (twin if twin != part_name else twin_name(part_name, *words[::-1]))


def _tied_bodies(string: String) -> list[str]:
    """Names of the bodies to which a string is tied, in the order of its path."""
    return [end.body for end in string.path if end.body]


def _string_remark(string: String, words: tuple[str, str], mirrored: bool) -> str:
    """Remark on a string whose name contradicts the sides of its bodies; may be empty."""
    bodies = _tied_bodies(string)
    name = string.name.rpartition(".")[2]
    sides_of_bodies = {word for word in words for body in bodies if word in body.rpartition(".")[2]}
    if len(sides_of_bodies) != 1:
        return ""
    (side,) = sides_of_bodies
    (other_side,) = set(words) - sides_of_bodies
    if other_side in name:
        return f"found {string.name!r} for a string that holds {bodies[0]}: is it on that side?"
    if mirrored and side == words[0] and side not in name:
        text = f"found {string.name!r} without {side!r}, though the string holds {bodies[0]}: "
        return text + f"only names with {side!r} have twins"
    return ""
