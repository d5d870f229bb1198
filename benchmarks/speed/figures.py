"""Samples, their ratios, and the marks they are held against."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ..strings.report import Section, Table


@dataclass(frozen=True)
class Samples:
    """One number a turn.

    Attributes:
        values: in the order in which they were measured.
    """

    values: tuple[float, ...]

    @property
    def median(self) -> float:
        return statistics.median(self.values)

    def over(self, other: Samples) -> Samples:
        """The ratio in every turn: what slowed a whole turn does not count."""
        return Samples(tuple(a / b for a, b in zip(self.values, other.values, strict=True)))

    def per(self, amount: float) -> Samples:
        """``amount`` over every value: a rate from seconds."""
        return Samples(tuple(amount / x for x in self.values))


def in_turns(actions: Mapping[str, Callable[[], float]], turns: int) -> dict[str, Samples]:
    """Every action once, then every action again: what is compared is measured side by side."""
    taken: dict[str, list[float]] = {name: [] for name in actions}
    for _ in range(turns):
        for name, action in actions.items():
            taken[name].append(action())
    return {name: Samples(tuple(values)) for name, values in taken.items()}


@dataclass(frozen=True)
class Goal:
    """A figure that is to stay below a bound, or above it.

    Attributes:
        what: in words.
        measured: the samples; or why there are none.
        bound: [s], or a ratio.
        at_least: whether the median is to reach the bound, and not to stay below it.
    """

    what: str
    measured: Samples | str
    bound: float
    at_least: bool = True

    @property
    def met(self) -> bool | None:
        """None when it was not measured."""
        if isinstance(self.measured, str):
            return None
        median = self.measured.median
        return median >= self.bound if self.at_least else median <= self.bound


@dataclass
class Chapter:
    """A section of the page and the goals it decides."""

    section: Section
    goals: list[Goal] = field(default_factory=list)


def shown(seconds: float) -> str:
    """Seconds with a fitting unit."""
    for unit, factor in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if abs(seconds) >= factor:
            return f"{seconds / factor:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def times(ratio: float) -> str:
    """A ratio: 9.41x, 1234x."""
    return f"{ratio:.3g}x" if ratio < 100 else f"{ratio:.0f}x"


def spread(samples: Samples, write: Callable[[float], str] = shown) -> list[str]:
    """Median, least and greatest."""
    return [write(x) for x in (samples.median, min(samples.values), max(samples.values))]


def goals_table(chapters: list[Chapter]) -> Table:
    """All marks of the page; those that are missed in bold."""
    rows = []
    for goal in (goal for chapter in chapters for goal in chapter.goals):
        write = times if goal.at_least else shown
        mark = f"{'at least' if goal.at_least else 'at most'} {write(goal.bound)}"
        if isinstance(goal.measured, str):
            cells = [goal.measured, "-", "-"]
        else:
            cells = spread(goal.measured, write)
        met = {True: "yes", False: "**no**", None: "not measured"}[goal.met]
        rows.append([goal.what, *cells, mark, met])
    return Table(["Figure", "median", "min", "max", "target", "met"], rows)
