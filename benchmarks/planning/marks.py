"""Figures and their targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..strings.report import Table


@dataclass(frozen=True)
class Mark:
    """A figure and its target.

    Attributes:
        what: description.
        value: measured value.
        bound: target.
        unit: unit of both; "%" for shares.
        at_least: whether the bound is a minimum; otherwise it is a maximum.
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
        """The row of the table."""
        words = "at least" if self.at_least else "at most"
        wanted = f"{words} {self.bound:g} {self.unit}"
        return [self.what, f"{self.value:.3g} {self.unit}", wanted, "yes" if self.met else "**no**"]


def marks_table(marks: Sequence[Mark]) -> Table:
    """All marks."""
    return Table(["Figure", "measured", "target", "met"], [m.row() for m in marks])


def spread(values: Sequence[float], factor: float = 1.0) -> list[str]:
    """Median, 90 %, 99 %, maximum."""
    scaled = factor * np.array(values)
    parts = (*np.quantile(scaled, [0.5, 0.9, 0.99]), scaled.max())
    return [f"{x:.3g}" for x in parts]


def percentage(hits: Sequence[bool]) -> float:
    """Share of true values [%]."""
    return 100.0 * float(np.mean(np.asarray(hits, dtype=bool)))
