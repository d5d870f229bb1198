"""Planning problems: goals among obstacles, and the rollouts that approach them."""

from fantoccini.control.problems.derivatives import central_differences, taut_projection
from fantoccini.control.problems.funnels import SPEED_WEIGHT
from fantoccini.control.problems.goals import Goal, GoalLike
from fantoccini.control.problems.objective import OBJECTIVES, TIME, Objective
from fantoccini.control.problems.problem import Problem
from fantoccini.control.problems.problem_file import load_problem, problem_names, problem_schema
from fantoccini.control.problems.rollouts import RolloutOptions, Rollouts
from fantoccini.control.problems.state_arrays import StateArrays, flattened
from fantoccini.control.problems.touches import Meeting, Touches, carried

__all__ = [
    "OBJECTIVES",
    "SPEED_WEIGHT",
    "TIME",
    "Goal",
    "GoalLike",
    "Meeting",
    "Objective",
    "Problem",
    "RolloutOptions",
    "Rollouts",
    "StateArrays",
    "Touches",
    "carried",
    "central_differences",
    "flattened",
    "load_problem",
    "problem_names",
    "problem_schema",
    "taut_projection",
]
