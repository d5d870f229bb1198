"""Stands, the machines that move puppets: their check, set points, G-code and packets.

A stand is the machine that moves a puppet. An axis is a motor with its gear and its drum, belt or
screw; its position p moves driven coordinates q_K of the puppet: ends and lengths of strings,
driven joints. A set point is the position of every axis at one time. The controller is the
electronics that take set points and turn the motors. A margin is the remaining part of a bound,
such as the torque of a motor, and the travel of an axis the range of its positions. Slack is the
length that drums let out and wind in again before the start.
"""

from fantoccini.stand.axes import Axis, AxisMap, AxisMotion, axes_of
from fantoccini.stand.check import StandCheck, check_stand
from fantoccini.stand.controllers import ArtNet, Grbl, Marlin, Osc
from fantoccini.stand.emulator import Emulator, GrblMachine, positions_together, start_waits
from fantoccini.stand.gcode_text import (
    GrblSettings,
    Program,
    gcode,
    gcode_program,
    grbl_settings,
    slow_feed,
)
from fantoccini.stand.limits import QUANTITIES, Limit
from fantoccini.stand.packets import packet_encoder
from fantoccini.stand.point_files import SET_POINT_SUFFIXES, joint_trajectory, save_points
from fantoccini.stand.points import SetPoints, set_points, with_controller
from fantoccini.stand.receiving import Receiver
from fantoccini.stand.resuming import first_lost_line, resume_lines, resume_points
from fantoccini.stand.sending import SendCounts, check_start_time, send_points, udp_sender
from fantoccini.stand.stand_file import (
    Stand,
    is_stand,
    load_stand,
    loads_stand,
    stand_names,
    stand_schema,
)
from fantoccini.stand.streaming import (
    MAX_SILENCE,
    STOPPED,
    Channel,
    StreamCounts,
    gcode_lines,
    serial_port,
    stream,
    stream_together,
)
from fantoccini.stand.suggestions import lost_step_lines, remedies
from fantoccini.stand.tempo import SlowedRun, find_slower_tempo, inputs_of, slow_down

__all__ = [
    "MAX_SILENCE",
    "QUANTITIES",
    "SET_POINT_SUFFIXES",
    "STOPPED",
    "ArtNet",
    "Axis",
    "AxisMap",
    "AxisMotion",
    "Channel",
    "Emulator",
    "Grbl",
    "GrblMachine",
    "GrblSettings",
    "Limit",
    "Marlin",
    "Osc",
    "Program",
    "Receiver",
    "SendCounts",
    "SetPoints",
    "SlowedRun",
    "Stand",
    "StandCheck",
    "StreamCounts",
    "axes_of",
    "check_stand",
    "check_start_time",
    "find_slower_tempo",
    "first_lost_line",
    "gcode",
    "gcode_lines",
    "gcode_program",
    "grbl_settings",
    "inputs_of",
    "is_stand",
    "joint_trajectory",
    "load_stand",
    "loads_stand",
    "lost_step_lines",
    "packet_encoder",
    "positions_together",
    "remedies",
    "resume_lines",
    "resume_points",
    "save_points",
    "send_points",
    "serial_port",
    "set_points",
    "slow_down",
    "slow_feed",
    "stand_names",
    "stand_schema",
    "start_waits",
    "stream",
    "stream_together",
    "udp_sender",
    "with_controller",
]
