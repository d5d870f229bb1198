"""Options of a search for a plan.

A rollout is a simulation of inputs within the search.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

from fantoccini.base import check_not_negative, check_positive
from fantoccini.control.planning.planners import EST2007, Explore, Planner
from fantoccini.control.tasks import Objective

PLANNERS: dict[str, type[Explore] | type[EST2007]] = {"explore": Explore, "est-2007": EST2007}
"""Planners by name."""


@dataclass(frozen=True)
class SearchOptions:
    """Options of a search for a plan.

    Attributes:
        planner: ``"explore"``, ``"est-2007"``, or a function that makes one round.
        time_limit: time limit of the search for a first plan [s].
        iterations: largest number of rollouts of that search; unlimited by default.
        improve: time for better plans and for ending nearer to the goal, after the first plan [s].
        confirm: whether a plan must hold in a second simulation: it ends within the tolerance and
            makes only allowed touches. Otherwise the search goes on. This takes some milliseconds
            per plan; without it, the first ``bool(plan)`` takes them.
        objective: cost that better plans reduce; the problem's by default.
        seed: seed of all random choices.

    Raises:
        ValueError: number out of range, or an unknown planner or objective.
    """

    planner: str | Planner = "explore"
    time_limit: float = 10.0
    iterations: int | None = None
    improve: float = 0.0
    confirm: bool = True
    objective: str | Objective | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        check_positive(time_limit=self.time_limit)
        check_not_negative(improve=self.improve)
        if self.iterations is not None and not self.iterations >= 1:
            raise ValueError(f"iterations is {self.iterations}; it must be at least 1")
        if isinstance(self.planner, str) and self.planner not in PLANNERS:
            names = ", ".join(PLANNERS)
            raise ValueError(f"planner is {self.planner!r}; it must be one of {names}")
        if self.objective is not None:
            Objective.of(self.objective)

    @property
    def planner_name(self) -> str:
        """The planner's name; empty if it has none."""
        return self.planner if isinstance(self.planner, str) else ""

    @property
    def planner_round(self) -> Planner:
        """The function for one round of the planner."""
        return PLANNERS[self.planner]() if isinstance(self.planner, str) else self.planner


class SearchKeywords(TypedDict, total=False):
    """The fields of :class:`SearchOptions` as keyword arguments."""

    planner: str | Planner
    time_limit: float
    iterations: int | None
    improve: float
    confirm: bool
    objective: str | Objective | None
    seed: int
