"""Layout of a trajectory's rows as the runtime writes them (``cpp/fantoccini/record.hpp``)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from fantoccini.arrays import Array
from fantoccini.tree import Tree

_SINGLE = ("t", "kinetic", "potential", "work", "damping", "impact", "slip_loss")


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
        t, m = self.tree.coordinates, self.tree.n_rows
        return {
            "t": 1,
            "q_D": t.n_qD,
            "v_D": t.n_vD,
            "acc_D": t.n_vD,
            "q_K": t.n_qK,
            "v_K": t.n_vK,
            "acc_K": t.n_vK,
            "tension": m,
            "taut": m,
            "kinetic": 1,
            "potential": 1,
            "work": 1,
            "damping": 1,
            "impact": 1,
            "slip_loss": 1,
            "slip": len(self.tree.strings),
        }

    def split(self, rows: Array) -> dict[str, Array]:
        """Parts (T, n) of rows (T, width); single columns come as (T,)."""
        return {name: rows[:, place] for name, place in self._places.items()}

    @cached_property
    def _places(self) -> dict[str, slice | int]:
        places, at = {}, 0
        for name, width in self.widths.items():
            places[name] = at if name in _SINGLE else slice(at, at + width)
            at += width
        return places
