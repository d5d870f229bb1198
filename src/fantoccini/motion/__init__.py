"""Motion as data: states, inputs, trajectories and events."""

from fantoccini.motion.columns import Columns
from fantoccini.motion.files import inputs_schema
from fantoccini.motion.input import Input
from fantoccini.motion.inputs import Inputs
from fantoccini.motion.overload import Overload, overloads
from fantoccini.motion.state import Event, EventKind, State, States
from fantoccini.motion.trajectories import SAVED, Trajectories
from fantoccini.motion.trajectory import Trajectory

__all__ = [
    "SAVED",
    "Columns",
    "Event",
    "EventKind",
    "Input",
    "Inputs",
    "Overload",
    "State",
    "States",
    "Trajectories",
    "Trajectory",
    "inputs_schema",
    "overloads",
]
