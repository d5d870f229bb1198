"""Planning: from here to there among obstacles."""

from fantoccini.plan.check import Check
from fantoccini.plan.clearance import Clearance, Nearest
from fantoccini.plan.feedback import Feedback, Followed
from fantoccini.plan.goals import Goal, Rows
from fantoccini.plan.objective import OBJECTIVES, Objective
from fantoccini.plan.obstacles import HalfSpace
from fantoccini.plan.plan import plan, solve
from fantoccini.plan.planners import EST2007, Explore
from fantoccini.plan.polish import Polish, PolishStatus
from fantoccini.plan.problem import Problem
from fantoccini.plan.problem_file import load_problem, problem_names, problem_schema
from fantoccini.plan.result import PlanResult, PlanStatus
from fantoccini.plan.search import PLANNERS, Search

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
    "Nearest",
    "Objective",
    "PlanResult",
    "PlanStatus",
    "Polish",
    "PolishStatus",
    "Problem",
    "Rows",
    "Search",
    "load_problem",
    "plan",
    "problem_names",
    "problem_schema",
    "solve",
]
