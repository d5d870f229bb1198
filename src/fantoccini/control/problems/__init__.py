"""Planning problems: tasks prepared for searches, and the rollouts that approach their ends."""

from fantoccini.control.problems.derivatives import central_differences, taut_projection
from fantoccini.control.problems.loading import load_problem
from fantoccini.control.problems.lqr_laws import SPEED_WEIGHT
from fantoccini.control.problems.problem import Problem
from fantoccini.control.problems.rollouts import Rollouts

__all__ = [
    "SPEED_WEIGHT",
    "Problem",
    "Rollouts",
    "central_differences",
    "load_problem",
    "taut_projection",
]
