"""simulate: a marionette, a start state and inputs -> Trajectory; sensitivity: its derivatives."""

from fantoccini.simulate.catch import Passage
from fantoccini.simulate.integrators import INTEGRATORS
from fantoccini.simulate.run import simulate, trajectory_of_rows
from fantoccini.simulate.sensitivity import Sensitivity, sensitivity

__all__ = [
    "INTEGRATORS",
    "Passage",
    "Sensitivity",
    "sensitivity",
    "simulate",
    "trajectory_of_rows",
]
