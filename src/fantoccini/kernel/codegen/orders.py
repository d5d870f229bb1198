"""Names and units of the entries of a puppet's vectors, for the C99 header.

Names from the user's file are data: :func:`shown` allows only harmless characters in comments.

q_D and v_D are the dynamic coordinates and velocities, q_K and v_K the driven ones: ends and
lengths of strings, driven joints. A link is a body on its joint. A row of the tree describes a
string, limit, spring or drive, a row of the coordinate table one coordinate.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from fantoccini.model.tree import Tree

_HARMLESS = re.compile(r"[A-Za-z0-9_./-]+", re.ASCII)

NAMES = {
    "n_qD": "q_D",
    "n_vD": "v_D",
    "n_qK": "q_K",
    "n_vK": "v_K",
    "n_strings": "strings",
    "n_limits": "limits",
    "n_rows": "rows",
    "n_links": "links",
    "n_points": "points",
    "n_p": "p",
}
"""Size -> name of the list that it counts."""


@dataclass(frozen=True)
class Order:
    """Names and units of the entries of a vector.

    Attributes:
        title: title of the list.
        entries: one line for every entry.
    """

    title: str
    entries: tuple[str, ...]


def orders(tree: Tree) -> dict[str, Order]:
    """Name in ``NAMES`` -> entries of a tree's vector."""
    table = tree.coordinates
    units = {row.name: row.unit for row in table.rows}
    rows = [f"{shown(s.name)} [m]" for s in tree.strings]
    limits = [f"{shown(r.name)} [{_LIMIT_UNITS.get(r.side, 'rad or m')}]" for r in tree.limits]
    parameters = [f"{shown(n)}, in the puppet file {x!r}" for n, x in tree.parameters.items()]
    links = [shown(link.name) for link in tree.links]
    points = [
        f"{shown(s.name)}, point {k + 1} of {len(s.points)}"
        for s in tree.strings
        for k in range(len(s.points))
    ]
    return {
        "q_D": Order("dynamic configuration", _configuration(table.q_D, units)),
        "v_D": Order("dynamic velocities and forces", _velocities(table.v_D, units)),
        "q_K": Order("driven configuration", _configuration(table.q_K, units)),
        "v_K": Order("driven velocities and forces", _velocities(table.v_K, units)),
        "strings": Order("strings", tuple(rows)),
        "limits": Order("limits", tuple(limits)),
        "rows": Order("strings, then limits", tuple(rows + limits)),
        "links": Order("bodies, and the driven ends of strings", tuple(links)),
        "points": Order("points of the strings", tuple(points)),
        "p": Order("parameters", tuple(parameters)),
    }


_LIMIT_UNITS = {"cone": "1", "twist.lower": "rad", "twist.upper": "rad"}


def shown(name: str) -> str:
    """A name, if it is harmless in a comment.

    Raises:
        ValueError: it has a character that names in puppet files cannot have.
    """
    if not _HARMLESS.fullmatch(name):
        raise ValueError(f"{name!r} cannot stand in generated text")
    return name


def _configuration(names: Iterable[str], units: dict[str, str]) -> tuple[str, ...]:
    return tuple(f"{shown(name)} [{units[name]}]" for name in names)


def _velocities(names: Iterable[str], units: dict[str, str]) -> tuple[str, ...]:
    """Velocities with units: m/s and N for lengths, rad/s and N m for all others."""
    unit = {"m": "m/s], force [N", "rad": "rad/s], force [N m"}
    return tuple(f"{shown(n)} [{unit[units.get(n, 'rad')]}]" for n in names)
