"""Stands: the machines that move puppets, and whether they can do a motion."""

from fantoccini.stand.axes import Axis, AxisMap, AxisMotion, axes_of
from fantoccini.stand.check import StandCheck, check_stand
from fantoccini.stand.controllers import ArtNet, Grbl, Marlin, Osc
from fantoccini.stand.emulator import Emulator, GrblMachine
from fantoccini.stand.gcode_text import GrblSettings, gcode, gentle_feed, grbl_settings
from fantoccini.stand.helping import lost_lines, remedies
from fantoccini.stand.limits import QUANTITIES, Limit
from fantoccini.stand.packets import packets_of
from fantoccini.stand.point_files import ENDINGS, joint_trajectory, save_points
from fantoccini.stand.points import SetPoints, controller_of, set_points
from fantoccini.stand.receiving import Receiver
from fantoccini.stand.sending import Sending, check_first, send_points, udp_sender
from fantoccini.stand.stand_file import (
    Stand,
    is_stand,
    load_stand,
    loads_stand,
    stand_names,
    stand_schema,
)
from fantoccini.stand.streaming import (
    STOPPED,
    Streamed,
    first_lost,
    lines_of,
    resumed,
    serial_port,
    stream,
)
from fantoccini.stand.tempo import SlowedRun, inputs_of, slowed, slower

__all__ = [
    "ENDINGS",
    "QUANTITIES",
    "STOPPED",
    "ArtNet",
    "Axis",
    "AxisMap",
    "AxisMotion",
    "Emulator",
    "Grbl",
    "GrblMachine",
    "GrblSettings",
    "Limit",
    "Marlin",
    "Osc",
    "Receiver",
    "Sending",
    "SetPoints",
    "SlowedRun",
    "Stand",
    "StandCheck",
    "Streamed",
    "axes_of",
    "check_first",
    "check_stand",
    "controller_of",
    "first_lost",
    "gcode",
    "gentle_feed",
    "grbl_settings",
    "inputs_of",
    "is_stand",
    "joint_trajectory",
    "lines_of",
    "load_stand",
    "loads_stand",
    "lost_lines",
    "packets_of",
    "remedies",
    "resumed",
    "save_points",
    "send_points",
    "serial_port",
    "set_points",
    "slowed",
    "slower",
    "stand_names",
    "stand_schema",
    "stream",
    "udp_sender",
]
