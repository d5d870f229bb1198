"""Motion as data: states, inputs, trajectories and events.

q_D are the dynamic coordinates of a puppet, which move by the equations of motion, and q_K the
driven ones, which inputs give as functions of time: ends of strings, lengths of strings, driven
joints. v_D, v_K and acc_D, acc_K are their velocities and accelerations; n_qD, n_vD, n_qK and n_vK
are the numbers of coordinates and velocities. An input consists of pieces, polynomials with
coefficients `coef` that meet at the times `breaks`. Slip is the length that a winch has let out
because the tension reached its largest one; `taut` marks the strings that pull.
"""

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
