"""Stands: the machines that move puppets, and whether they can do a motion."""

from fantoccini.stand.axes import Axis, AxisMap, AxisMotion, axes_of
from fantoccini.stand.check import QUANTITIES, Limit, StandCheck, check_stand
from fantoccini.stand.helping import lost_lines, remedies
from fantoccini.stand.stand_file import (
    Stand,
    is_stand,
    load_stand,
    loads_stand,
    stand_names,
    stand_schema,
)
from fantoccini.stand.tempo import Slowed, inputs_of, slowed, slower

__all__ = [
    "QUANTITIES",
    "Axis",
    "AxisMap",
    "AxisMotion",
    "Limit",
    "Slowed",
    "Stand",
    "StandCheck",
    "axes_of",
    "check_stand",
    "inputs_of",
    "is_stand",
    "load_stand",
    "loads_stand",
    "lost_lines",
    "remedies",
    "slowed",
    "slower",
    "stand_names",
    "stand_schema",
]
