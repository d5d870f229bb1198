"""Samples, their ratios, and their targets."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ..strings.report import Section, Table


@dataclass(frozen=True)
class Samples:
    """One number per turn.

    Attributes:
        values: values in the order of measurement.
    """

    values: tuple[float, ...]

    @property
    def median(self) -> float:
        return statistics.median(self.values)

    def over(self, other: Samples) -> Samples:
        """The ratio in every turn: load that slows a whole turn cancels."""
        return Samples(tuple(a / b for a, b in zip(self.values, other.values, strict=True)))

    def per(self, amount: float) -> Samples:
        """``amount`` over every value: rates from times."""
        return Samples(tuple(amount / x for x in self.values))


def in_turns(actions: Mapping[str, Callable[[], float]], turns: int) -> dict[str, Samples]:
    """Samples of actions that run in turns, so that compared ones are measured side by side."""
    taken: dict[str, list[float]] = {name: [] for name in actions}
    for _ in range(turns):
        for name, action in actions.items():
            taken[name].append(action())
    return {name: Samples(tuple(values)) for name, values in taken.items()}


@dataclass(frozen=True)
class Goal:
    """A figure with an upper or a lower bound as its target.

    Attributes:
        what: description.
        measured: the samples, or the reason why there are none.
        bound: target [s], or a ratio.
        at_least: whether the bound is a minimum of the median; otherwise it is a maximum.
    """

    what: str
    measured: Samples | str
    bound: float
    at_least: bool = True

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None if it was not measured."""
        if isinstance(self.measured, str):
            return None
        median = self.measured.median
        return median >= self.bound if self.at_least else median <= self.bound


@dataclass
class Chapter:
    """A section of the page and the goals it decides."""

    section: Section
    goals: list[Goal] = field(default_factory=list)


def time_text(seconds: float) -> str:
    """A time in a suitable unit."""
    for unit, factor in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if abs(seconds) >= factor:
            return f"{seconds / factor:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def ratio_text(ratio: float) -> str:
    """A ratio: 9.41x, 1234x."""
    return f"{ratio:.3g}x" if ratio < 100 else f"{ratio:.0f}x"


def spread_text(samples: Samples, write: Callable[[float], str] = time_text) -> list[str]:
    """Median, minimum and maximum."""
    return [write(x) for x in (samples.median, min(samples.values), max(samples.values))]


def goals_table(chapters: list[Chapter]) -> Table:
    """All targets of the page; missed ones in bold."""
    rows = []
    for goal in (goal for chapter in chapters for goal in chapter.goals):
        write = ratio_text if goal.at_least else time_text
        mark = f"{'at least' if goal.at_least else 'at most'} {write(goal.bound)}"
        if isinstance(goal.measured, str):
            cells = [goal.measured, "-", "-"]
        else:
            cells = spread_text(goal.measured, write)
        met = {True: "yes", False: "**no**", None: "not measured"}[goal.met]
        rows.append([goal.what, *cells, mark, met])
    return Table(["Figure", "median", "min", "max", "target", "met"], rows)
