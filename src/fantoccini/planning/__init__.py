"""Planning: inputs that take a puppet to a goal among obstacles."""

from fantoccini.clearance import Clearance, HalfSpace, Nearest
from fantoccini.planning.api import plan, solve
from fantoccini.planning.check import Check
from fantoccini.planning.feedback import Feedback, Followed
from fantoccini.planning.goals import Goal
from fantoccini.planning.objective import OBJECTIVES, Objective
from fantoccini.planning.options import PLANNERS, SearchOptions
from fantoccini.planning.planners import EST2007, Explore
from fantoccini.planning.polish import Polish, PolishStatus
from fantoccini.planning.problem import Problem
from fantoccini.planning.problem_file import load_problem, problem_names, problem_schema
from fantoccini.planning.result import PlanResult, PlanStatus
from fantoccini.planning.search import Search
from fantoccini.planning.state_arrays import StateArrays
from fantoccini.planning.touches import Meeting, Touches

__all__ = [
    "EST2007",
    "OBJECTIVES",
    "PLANNERS",
    "Check",
    "Clearance",
    "Explore",
    "Feedback",
    "Followed",
    "Goal",
    "HalfSpace",
    "Meeting",
    "Nearest",
    "Objective",
    "PlanResult",
    "PlanStatus",
    "Polish",
    "PolishStatus",
    "Problem",
    "Search",
    "SearchOptions",
    "StateArrays",
    "Touches",
    "load_problem",
    "plan",
    "problem_names",
    "problem_schema",
    "solve",
]
