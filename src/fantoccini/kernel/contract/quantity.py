"""Sizes of a puppet, and quantities with shape, unit and meaning."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

SIZES: dict[str, str] = {
    "n_qD": "numbers of the dynamic configuration",
    "n_vD": "dynamic velocities",
    "n_qK": "numbers of the driven configuration",
    "n_vK": "driven velocities",
    "n_v": "velocities: dynamic, then driven",
    "n_strings": "strings",
    "n_limits": "limits",
    "n_rows": "one-sided rows: strings, then limits",
    "n_p": "parameters",
    "n_links": "links",
    "n_points": "points of all strings",
    "n_motors": "velocities that motors move",
    "n_watched": "drives that may be too weak for their command",
    "n_contacts": "contact points that a step has room for; 0 without contact",
    "n_solids": "solids of the links, where they may touch; else 0",
    "n_packed": "numbers of the factor M = F^T F",
}
"""Every size of a puppet that a shape may name. ``Tree.sizes`` has all but ``n_packed``, which is
known once the equations are derived."""

Shape = tuple[str | int, ...]
"""() is a number, (n,) a vector, (n, m) a matrix, stored column by column."""


@dataclass(frozen=True)
class Quantity:
    """An argument, a result, or a part of a sample.

    Attributes:
        name: the same in Python, C++ and the docs.
        shape: in names of ``SIZES`` and numbers.
        unit: empty where it follows from the coordinates.
        meaning: in one sentence.
    """

    name: str
    shape: Shape
    unit: str
    meaning: str

    def dimensions(self, sizes: Mapping[str, int]) -> tuple[int, ...]:
        """The shape in numbers."""
        return tuple(n if isinstance(n, int) else sizes[n] for n in self.shape)

    def numel(self, sizes: Mapping[str, int]) -> int:
        """The number of entries."""
        return math.prod(self.dimensions(sizes))

    @property
    def described(self) -> str:
        """Meaning and unit."""
        return f"{self.meaning} [{self.unit}]" if self.unit else self.meaning
