"""simulate: a marionette, a start state and inputs -> Trajectory; sensitivity: its derivatives."""

from fantoccini.simulation.batch import simulate_batch
from fantoccini.simulation.catch import Passage
from fantoccini.simulation.pace import SlowRunWarning
from fantoccini.simulation.run import simulate, trajectory_of_samples
from fantoccini.simulation.sensitivities import Sensitivity, sensitivity

__all__ = [
    "Passage",
    "Sensitivity",
    "SlowRunWarning",
    "sensitivity",
    "simulate",
    "simulate_batch",
    "trajectory_of_samples",
]
