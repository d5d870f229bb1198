"""Planning problems: tasks prepared for searches, and the rollouts that approach their ends."""

from fantoccini.control.problems.derivatives import central_differences, taut_projection
from fantoccini.control.problems.lqr_laws import SPEED_WEIGHT
from fantoccini.control.problems.objective import OBJECTIVES, TIME, Objective
from fantoccini.control.problems.problem import Problem
from fantoccini.control.problems.problem_file import load_problem, problem_names, problem_schema
from fantoccini.control.problems.rollouts import RolloutOptions, Rollouts

__all__ = [
    "OBJECTIVES",
    "SPEED_WEIGHT",
    "TIME",
    "Objective",
    "Problem",
    "RolloutOptions",
    "Rollouts",
    "central_differences",
    "load_problem",
    "problem_names",
    "problem_schema",
    "taut_projection",
]
