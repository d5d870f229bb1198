"""Planning problems: tasks prepared for searches, and the rollouts that approach their ends.

A rollout is a simulation within a search. An LQR law is the feedback of a linear-quadratic
regulator, and a stance a state of rest in which the floor carries a part of the weight. q_D are the
dynamic coordinates of a puppet and q_K the driven ones: ends and lengths of strings, and driven
joints.
"""

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
