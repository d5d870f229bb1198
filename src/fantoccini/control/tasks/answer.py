"""Answers to problems of control, and their statuses.

An answer holds if its event-driven run keeps its bounds; it is a minimum if no small change lowers
its cost. It is true if both are the case.
"""

from __future__ import annotations

from fantoccini.base import Outcome


class AnswerStatus(Outcome):
    """End of a search: whether its answer holds, and whether it is at a minimum."""

    SOLVED = "the residual of the conditions of optimality is below the tolerance"
    NARROW = "all spreads are narrow"
    EXACT = "the plan ends within the tolerance and touches only allowed solids, in simulation too"
    REACHED = "the pose reaches its places"

    SETTLED = "steps hardly lower the cost any more; the residual is above the tolerance"
    STALLED = "no step lowers the cost any more, but the residual is above the tolerance"
    ITERATIONS = "the limit of iterations ended the search; this is the best motion so far"
    GENERATIONS = "the limit of generations ended the search; these are the best numbers so far"
    TIMEOUT = "the time limit ended the search; this is the best so far"
    STOPPED = "the search was interrupted; this is the best so far"
    GUESS = "the search ended at a motion that does not hold; this is the guess, which does"

    VIOLATED = "the motion leaves its bounds, or does not reach its end or a place"
    NO_RUN = "the motion exists in time steps, but an event-driven run of its inputs is incomplete"
    UNCONFIRMED = "the plan ends within the tolerance by time-stepping; it was not confirmed"
    APPROXIMATE = "the search ended outside of the tolerance; this is the nearest plan"
    OUT_OF_TIME = (
        "the time limit ended the search outside of the tolerance; this is the nearest plan"
    )
    INFEASIBLE_START = "the start is in collision or outside of the bounds"
    INFEASIBLE_GOAL = "the goal is out of reach"
    OUT_OF_REACH = "no nearby hanging pose is nearer"
    TIPS = "nearer poses are unstable: the puppet would tip over into another pose"
    UNSURE = "the search ended undecided; there may be nearer poses"

    @property
    def holds(self) -> bool:
        """Whether the answer keeps its bounds and reaches its goal, by a separate simulation."""
        return self in _HOLDS

    @property
    def is_minimum(self) -> bool:
        """Whether the cost is at a minimum; true if the search minimises no cost."""
        return self not in _NO_MINIMUM


_FEASIBLE = frozenset(
    AnswerStatus[name]
    for name in ("SETTLED", "STALLED", "ITERATIONS", "GENERATIONS", "TIMEOUT", "STOPPED", "GUESS")
)
_HOLDS = _FEASIBLE | {
    AnswerStatus.SOLVED,
    AnswerStatus.NARROW,
    AnswerStatus.EXACT,
    AnswerStatus.REACHED,
}
_NO_MINIMUM = _FEASIBLE | {AnswerStatus.VIOLATED, AnswerStatus.NO_RUN}


class Answer:
    """The answer to a problem of control.

    It is true if it is solved: it holds, and the cost, if there is one, is at a minimum. An answer
    that only holds is feasible; one that does not hold violates a bound or misses the goal.

    Attributes:
        status: status at the end of the search.
    """

    status: AnswerStatus

    @property
    def holds(self) -> bool:
        """Whether it keeps its bounds and reaches its goal, by a separate simulation."""
        return self.status.holds

    @property
    def is_minimum(self) -> bool:
        """Whether the cost is at a minimum; true if the search minimises no cost."""
        return self.status.is_minimum

    @property
    def message(self) -> str:
        """Description of the end of the search."""
        return self.status.message

    def __bool__(self) -> bool:
        return self.holds and self.is_minimum
