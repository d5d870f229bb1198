"""Pairs to keep apart: two strings, or a string and a body.

A core is the segment, box or ellipsoid that stands for a piece of a string or for a solid. A member
is a puppet of a scene. A marionette is a puppet with its compiled equations; `marionette.puppet` is
the description in its file. A link is a body on its joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from fantoccini.base import Array
from fantoccini.dynamics.clearance.blocks import Pairs
from fantoccini.dynamics.marionette import Marionette


class Kind(IntEnum):
    """Kind of a pair, by the partner of its string."""

    STRING = 0
    OTHERS_BODY = 1
    OWN_BODY = 2


@dataclass(frozen=True, eq=False)
class StringPairs:
    """The pairs of a puppet or a scene.

    Attributes:
        names: names of a string, and of another string or a body, for each group.
        kinds: kind of each group.
        all_pairs: all pairs of cores, groups of strings first.
        string_string_pairs: pairs of two strings, as chords without thickness.
    """

    names: tuple[tuple[str, str], ...]
    kinds: tuple[Kind, ...]
    all_pairs: Pairs
    string_string_pairs: Pairs


def string_pairs(
    marionette: Marionette, links: list[int], radii: Array, radius: float, *, own: bool = True
) -> StringPairs:
    """All pairs of cores; these are pieces of strings first, then solids.

    Args:
        marionette: a puppet or a scene.
        links: links that carry the solids.
        radii: (n_solids,) radii of the solids [m].
        radius: half the thickness of strings [m].
        own: whether ``all_pairs`` includes pairs within one puppet; ``string_string_pairs`` always
            does.
    """
    tree, member = marionette.tree, marionette.puppet.member_of
    string_of_piece = [i for i, string in enumerate(tree.strings) for _ in string.points[1:]]
    pieces_of_string = [
        [n for n, owner in enumerate(string_of_piece) if owner == i]
        for i in range(len(tree.strings))
    ]
    solids_of_link = {
        link: [n for n, owner in enumerate(links, len(string_of_piece)) if owner == link]
        for link in dict.fromkeys(links)
    }
    names: list[tuple[str, str]] = []
    kinds: list[Kind] = []
    triples: list[tuple[int, int, int]] = []

    def add(kind: Kind, i: int, other: str, cores: list[int]) -> None:
        triples.extend((a, b, len(names)) for a in pieces_of_string[i] for b in cores)
        names.append((tree.strings[i].name, other))
        kinds.append(kind)

    for i, string in enumerate(tree.strings):
        for j, other in enumerate(tree.strings[:i]):
            if not {(p.link, p.at) for p in string.points} & {(p.link, p.at) for p in other.points}:
                add(Kind.STRING, j, string.name, pieces_of_string[i])
    n = len(triples)
    for i, string in enumerate(tree.strings):
        for link, cores in solids_of_link.items():
            if link not in {p.link for p in string.points}:
                body = tree.links[link].name
                is_same_member = member(body) == member(string.name)
                add(Kind.OWN_BODY if is_same_member else Kind.OTHERS_BODY, i, body, cores)
    first_core, second_core, group = np.array(triples, dtype=int).reshape(-1, 3).T
    radius_of_core = np.concatenate([np.full(len(string_of_piece), radius), radii])
    is_selected = np.array([own or member(a) != member(b) for a, b in names], dtype=bool)[group]
    i, j = first_core[is_selected], second_core[is_selected]
    all_pairs = Pairs(i, j, group[is_selected], radius_of_core[i] + radius_of_core[j])
    string_string_pairs = Pairs(first_core[:n], second_core[:n], group[:n], np.zeros(n))
    return StringPairs(tuple(names), tuple(kinds), all_pairs, string_string_pairs)
