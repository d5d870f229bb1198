"""Pairs that keep apart: of strings, and of strings and bodies."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from fantoccini.base import Array
from fantoccini.dynamics.clearance.blocks import Pairs
from fantoccini.dynamics.marionette import Marionette


class Kind(IntEnum):
    """What a string is measured against."""

    STRING = 0
    OTHERS_BODY = 1
    OWN_BODY = 2


@dataclass(frozen=True, eq=False)
class StringPairs:
    """The pairs of a puppet or a scene.

    Attributes:
        names: of what is measured, by group: a string's, and another's or a body's.
        kinds: by group.
        every: all pairs of cores, groups of strings first.
        of_strings: those of two strings, as chords without thickness.
    """

    names: tuple[tuple[str, str], ...]
    kinds: tuple[Kind, ...]
    every: Pairs
    of_strings: Pairs


def string_pairs(
    marionette: Marionette, links: list[int], radii: Array, radius: float, *, own: bool = True
) -> StringPairs:
    """The pairs, numbered as cores are: pieces of strings, then solids.

    Args:
        marionette: a puppet or a scene.
        links: that carry the solids.
        radii: (n_solids,) [m].
        radius: of strings [m].
        own: whether ``every`` includes pairs within one puppet; ``of_strings`` always does.
    """
    tree, member = marionette.tree, marionette.puppet.member_of
    of_piece = [i for i, string in enumerate(tree.strings) for _ in string.points[1:]]
    pieces = [[n for n, of in enumerate(of_piece) if of == i] for i in range(len(tree.strings))]
    solids = {
        link: [n for n, of in enumerate(links, len(of_piece)) if of == link]
        for link in dict.fromkeys(links)
    }
    names: list[tuple[str, str]] = []
    kinds: list[Kind] = []
    found: list[tuple[int, int, int]] = []

    def add(kind: Kind, i: int, other: str, cores: list[int]) -> None:
        found.extend((a, b, len(names)) for a in pieces[i] for b in cores)
        names.append((tree.strings[i].name, other))
        kinds.append(kind)

    for i, string in enumerate(tree.strings):
        for j, other in enumerate(tree.strings[:i]):
            if not {(p.link, p.at) for p in string.points} & {(p.link, p.at) for p in other.points}:
                add(Kind.STRING, j, string.name, pieces[i])
    n = len(found)
    for i, string in enumerate(tree.strings):
        for link, cores in solids.items():
            if link not in {p.link for p in string.points}:
                body = tree.links[link].name
                same = member(body) == member(string.name)
                add(Kind.OWN_BODY if same else Kind.OTHERS_BODY, i, body, cores)
    first, second, group = np.array(found, dtype=int).reshape(-1, 3).T
    thick = np.concatenate([np.full(len(of_piece), radius), radii])
    kept = np.array([own or member(a) != member(b) for a, b in names], dtype=bool)[group]
    i, j = first[kept], second[kept]
    every = Pairs(i, j, group[kept], thick[i] + thick[j])
    of_strings = Pairs(first[:n], second[:n], group[:n], np.zeros(n))
    return StringPairs(tuple(names), tuple(kinds), every, of_strings)
