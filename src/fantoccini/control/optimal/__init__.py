"""Optimal control: minimum-cost motions of a puppet within bounds."""

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
