"""Layout of a trajectory's samples as the runtime writes them.

A sample is one saved instant of a trajectory: an array of numbers, in parts such as q_D and
tension.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from fantoccini.base import Array
from fantoccini.kernel.contract import SAMPLE
from fantoccini.model.tree import Tree
from fantoccini.motion import State


@dataclass(frozen=True)
class SampleLayout:
    """Splits samples of a tree's motion into named parts."""

    tree: Tree

    @cached_property
    def widths(self) -> dict[str, int]:
        """Part name -> number of columns, in order."""
        return {part.name: part.numel(self.tree.sizes) for part in SAMPLE}

    def split(self, samples: Array) -> dict[str, Array]:
        """Parts (T, n) of samples (T, width); a single column is (T,)."""
        return {name: samples[:, columns_of_part] for name, columns_of_part in self.columns.items()}

    def state(self, sample: Array) -> State:
        """The state in a sample (width,)."""
        return State.of_sample(sample, self.columns, self.tree.coordinates)

    @cached_property
    def columns(self) -> dict[str, slice | int]:
        """Part name -> its columns, or the column of a single number."""
        columns: dict[str, slice | int] = {}
        column = 0
        for part, width in zip(SAMPLE, self.widths.values(), strict=True):
            columns[part.name] = slice(column, column + width) if part.shape else column
            column += width
        return columns
