"""simulate: a marionette, a start state and inputs -> Trajectory; sensitivity: its derivatives.

q_D are the dynamic coordinates and q_K the driven ones (ends and lengths of strings, driven
joints), v and acc their velocities and accelerations. A row is a string or a joint limit, and the
taut rows are the active set. At a catch a slack string becomes taut, with an impulse; the saltation
matrix maps a change of the state before such an event to the change after it. Breaks are the times
at which the pieces of an input meet.
"""

from fantoccini.dynamics.simulation.batch import simulate_batch
from fantoccini.dynamics.simulation.effort_of_contacts import contact_effort
from fantoccini.dynamics.simulation.intervals import interval_derivatives
from fantoccini.dynamics.simulation.judging import with_verdict
from fantoccini.dynamics.simulation.pace import SlowRunWarning
from fantoccini.dynamics.simulation.run import simulate, trajectory_of_samples
from fantoccini.dynamics.simulation.saltation import Passage
from fantoccini.dynamics.simulation.sensitivities import RunSensitivity, sensitivity

__all__ = [
    "Passage",
    "RunSensitivity",
    "SlowRunWarning",
    "contact_effort",
    "interval_derivatives",
    "sensitivity",
    "simulate",
    "simulate_batch",
    "trajectory_of_samples",
    "with_verdict",
]
