"""Motion as data: states, inputs, trajectories and events."""

from fantoccini.motion.columns import Columns
from fantoccini.motion.contacts import ContactPoints, pair_name
from fantoccini.motion.files import inputs_schema
from fantoccini.motion.input import Input
from fantoccini.motion.input_derivative import InputDerivative
from fantoccini.motion.inputs import Inputs
from fantoccini.motion.overload import Overload, overloads
from fantoccini.motion.state import EventKind, EventRecord, State, States, check_size
from fantoccini.motion.trajectories import SAVED, Trajectories
from fantoccini.motion.trajectory import Trajectory

__all__ = [
    "SAVED",
    "Columns",
    "ContactPoints",
    "EventKind",
    "EventRecord",
    "Input",
    "InputDerivative",
    "Inputs",
    "Overload",
    "State",
    "States",
    "Trajectories",
    "Trajectory",
    "check_size",
    "inputs_schema",
    "overloads",
    "pair_name",
]
