"""Motion as data: states, inputs, trajectories and events."""

from fantoccini.motion import binding, joints, pieces, reading
from fantoccini.motion.archive import RECORDING_FORMAT, RECORDING_FORMATS, mesh_files, restored
from fantoccini.motion.binding import check_same_puppet
from fantoccini.motion.channel import SAME_TIME, Channel, Points
from fantoccini.motion.columns import Columns
from fantoccini.motion.contacts import ContactPoints, pair_name
from fantoccini.motion.files import csv_columns, inputs_schema
from fantoccini.motion.input import Input
from fantoccini.motion.input_derivative import InputDerivative
from fantoccini.motion.inputs import Inputs
from fantoccini.motion.overload import Overload, overloads
from fantoccini.motion.packing import pack_run, unpack_run
from fantoccini.motion.pieces import channel_names, constants
from fantoccini.motion.reading import Table
from fantoccini.motion.state import EventKind, EventRecord, State, States, check_size
from fantoccini.motion.trajectories import RESIDUAL, SAVED, UNDETERMINED, Trajectories
from fantoccini.motion.trajectory import LEDGER, Trajectory

__all__ = [
    "LEDGER",
    "RECORDING_FORMAT",
    "RECORDING_FORMATS",
    "RESIDUAL",
    "SAME_TIME",
    "SAVED",
    "UNDETERMINED",
    "Channel",
    "Columns",
    "ContactPoints",
    "EventKind",
    "EventRecord",
    "Input",
    "InputDerivative",
    "Inputs",
    "Overload",
    "Points",
    "State",
    "States",
    "Table",
    "Trajectories",
    "Trajectory",
    "binding",
    "channel_names",
    "check_same_puppet",
    "check_size",
    "constants",
    "csv_columns",
    "inputs_schema",
    "joints",
    "mesh_files",
    "overloads",
    "pack_run",
    "pair_name",
    "pieces",
    "reading",
    "restored",
    "unpack_run",
]
