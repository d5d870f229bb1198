"""Motion as data: states, inputs, trajectories and events."""

from fantoccini.motion.columns import Columns
from fantoccini.motion.files import inputs_schema
from fantoccini.motion.input import Input
from fantoccini.motion.state import Event, EventKind, State
from fantoccini.motion.trajectory import Trajectory

__all__ = ["Columns", "Event", "EventKind", "Input", "State", "Trajectory", "inputs_schema"]
