"""Answers to problems of control, and their truth."""

from __future__ import annotations

from abc import ABC, abstractmethod


class Answer(ABC):
    """The answer to a problem of control.

    It is true if it is solved: it holds, and it is at a minimum if the search minimised a cost. An
    answer that only holds is feasible; one that does not violates a bound or misses the goal. Its
    ``status`` says how the search ended.
    """

    @property
    @abstractmethod
    def holds(self) -> bool:
        """Whether it keeps its bounds and arrives, judged by a simulation of its own."""

    @property
    def is_minimum(self) -> bool:
        """Whether it is at a minimum of what was minimised; true where nothing was."""
        return True

    def __bool__(self) -> bool:
        return self.holds and self.is_minimum
