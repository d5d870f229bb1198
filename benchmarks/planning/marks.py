"""Figures and their marks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..strings.report import Table


@dataclass(frozen=True)
class Mark:
    """A figure and what it is to be.

    Attributes:
        what: in words.
        value: measured.
        bound: that it is held against.
        unit: of both; "%" for shares.
        at_least: whether it is to reach the bound, or to stay at or below it.
    """

    what: str
    value: float
    bound: float
    unit: str
    at_least: bool = False

    @property
    def met(self) -> bool:
        return self.value >= self.bound if self.at_least else self.value <= self.bound

    def row(self) -> list[str]:
        """Its row of the table."""
        words = "at least" if self.at_least else "at most"
        wanted = f"{words} {self.bound:g} {self.unit}"
        return [self.what, f"{self.value:.3g} {self.unit}", wanted, "yes" if self.met else "**no**"]


def marks_table(marks: Sequence[Mark]) -> Table:
    """All marks."""
    return Table(["Figure", "measured", "target", "met"], [m.row() for m in marks])


def spread(values: Sequence[float], factor: float = 1.0) -> list[str]:
    """Median, 90 %, 99 %, greatest."""
    found = factor * np.array(values)
    parts = (*np.quantile(found, [0.5, 0.9, 0.99]), found.max())
    return [f"{x:.3g}" for x in parts]


def share(hits: Sequence[bool]) -> float:
    """Of those that are true [%]."""
    return 100.0 * float(np.mean(np.asarray(hits, dtype=bool)))
