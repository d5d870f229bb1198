"""Layout of a trajectory's rows as the runtime writes them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from fantoccini.arrays import Array
from fantoccini.contract import SAMPLE
from fantoccini.tree import Tree


@dataclass(frozen=True)
class RowLayout:
    """Splits rows into named parts.

    Attributes:
        tree: whose rows they are.
    """

    tree: Tree

    @property
    def widths(self) -> dict[str, int]:
        """Part name -> number of columns, in order."""
        sizes = self.tree.sizes
        return {part.name: part.numel(sizes) for part in SAMPLE}

    def split(self, rows: Array) -> dict[str, Array]:
        """Parts (T, n) of rows (T, width); single columns come as (T,)."""
        return {name: rows[:, place] for name, place in self._places.items()}

    @cached_property
    def _places(self) -> dict[str, slice | int]:
        places, at, shapes = {}, 0, {part.name: part.shape for part in SAMPLE}
        for name, width in self.widths.items():
            places[name] = slice(at, at + width) if shapes[name] else at
            at += width
        return places
