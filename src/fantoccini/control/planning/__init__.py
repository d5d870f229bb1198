"""Planning: inputs that take a puppet to a goal among obstacles."""

from fantoccini.control.planning.api import plan, solve
from fantoccini.control.planning.check import Check
from fantoccini.control.planning.feedback import ClosedLoopRollout, Feedback
from fantoccini.control.planning.options import PLANNERS, SearchOptions
from fantoccini.control.planning.planners import EST2007, Explore
from fantoccini.control.planning.polish import PolishResult, PolishStatus
from fantoccini.control.planning.result import PlanResult
from fantoccini.control.planning.search import Search

__all__ = [
    "EST2007",
    "PLANNERS",
    "Check",
    "ClosedLoopRollout",
    "Explore",
    "Feedback",
    "PlanResult",
    "PolishResult",
    "PolishStatus",
    "Search",
    "SearchOptions",
    "plan",
    "solve",
]
