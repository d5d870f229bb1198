"""Optimal control: minimum-cost motions of a puppet within bounds.

q_D are the dynamic coordinates of the puppet and q_K the driven ones (ends and lengths of strings,
driven joints); v_D and v_K are their velocities. The inputs u are the accelerations acc_K of the
driven coordinates, constant over each of N intervals; x_i is the state at node i, the start of
interval i, and z = (dq_D, dv_D, dq_K, dv_K) a change of it. A row is a condition low <= r <= high
on a number r of the motion, such as a tension. The gap consists of the errors of the last state and
of the touches: points that should pass a place. A stage program is a quadratic program with one
stage for each interval.
"""

from fantoccini.control.optimal.api import check_task, follow, optimise, refuse_winches
from fantoccini.control.optimal.iterations import Improvable, Limits, improve
from fantoccini.control.optimal.mpc import MPC, MPCStatus
from fantoccini.control.optimal.outlook import reach_notes
from fantoccini.control.optimal.reached import ReachedPose, ReachedPoses
from fantoccini.control.optimal.reaching import TargetKey, reach
from fantoccini.control.optimal.result import Optimum
from fantoccini.control.optimal.tuning import DrawOptions, TuningResult, tune

__all__ = [
    "MPC",
    "DrawOptions",
    "Improvable",
    "Limits",
    "MPCStatus",
    "Optimum",
    "ReachedPose",
    "ReachedPoses",
    "TargetKey",
    "TuningResult",
    "check_task",
    "follow",
    "improve",
    "optimise",
    "reach",
    "reach_notes",
    "refuse_winches",
    "tune",
]
