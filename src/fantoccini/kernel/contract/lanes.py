"""The lane record: arrays of n trajectories that are advanced together, in pieces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fantoccini.kernel.contract.samples import SUMS
from fantoccini.kernel.contract.structure import IN, OUT, Field

Width = str | int | None
"""Width of a trajectory's part: names of sizes joined by " + ", or a number; None for a scalar."""


@dataclass(frozen=True)
class LanePart:
    """An array of the lane record, (n, width) or (n,).

    Attributes:
        name: name in Python and C++.
        width: see :data:`Width`.
        type: type of the pointer in C++.
        meaning: meaning with unit.
    """

    name: str
    width: Width
    type: str
    meaning: str = ""

    def shape(self, n: int, sizes: Mapping[str, int]) -> tuple[int, ...]:
        """The shape of the array for n trajectories."""
        if self.width is None:
            return (n,)
        if isinstance(self.width, int):
            return (n, self.width)
        return (n, sum(sizes[name] for name in self.width.split(" + ")))

    @property
    def field(self) -> Field:
        """The field of a structure for this array."""
        shape = "(n,)" if self.width is None else f"(n, {self.width})"
        return Field(self.name, self.type, f"{shape} {self.meaning}".rstrip())


LANE: tuple[LanePart, ...] = (
    LanePart("fresh", None, "unsigned char*", "whether to restart from the arrays; cleared"),
    LanePart("p", "n_p", IN),
    LanePart("q_D", "n_qD", OUT, "state before the piece, then after it"),
    LanePart("v_D", "n_vD", OUT),
    LanePart("q_K", "n_qK", OUT),
    LanePart("v_K", "n_vK", OUT),
    LanePart("slip", "n_strings", OUT),
    LanePart("tension", "n_rows", OUT, "written"),
    LanePart("taut", "n_rows", "unsigned char*", "written"),
    LanePart("books", len(SUMS), OUT, "work, damping, impact, slip loss, friction; written [J]"),
    LanePart("violation", None, OUT, "largest violation since the start; written"),
    LanePart("advanced", None, OUT, "time advanced in the piece; written [s]"),
    LanePart("status", None, "int*", "Status; written"),
    LanePart("blame", "n_rows + n_watched", OUT, "attribution of the status; written"),
)
"""The lane record of compiled code and Python."""
