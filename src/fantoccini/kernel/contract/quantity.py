"""Sizes of a puppet, and quantities with shape, unit and meaning.

D stands for dynamic coordinates, K for driven ones (ends and lengths of strings, driven joints); a
drive moves a coordinate by a motor.
"""

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
    "n_watched": "drives with a command, whose motor or controller may be too weak",
    "n_contacts": "maximum number of contact points in a step; 0 without contact",
    "n_solids": "solids of the links; 0 without contact",
    "n_packed": "numbers of the factor F of M = F^T F",
}
"""Sizes of a puppet in shapes. ``Tree.sizes`` has all except ``n_packed``, which the derivation of
the equations determines."""

Shape = tuple[str | int, ...]
"""Shape: () is a number, (n,) a vector, (n, m) a matrix, stored column by column."""


@dataclass(frozen=True)
class Quantity:
    """An argument, a result, or a part of a sample.

    Attributes:
        name: name in Python, C++ and the docs.
        shape: shape in names of ``SIZES`` and numbers.
        unit: unit; empty if it depends on the coordinates.
        meaning: meaning in one sentence.
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
