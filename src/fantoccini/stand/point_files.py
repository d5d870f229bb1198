"""Files of set points: tables, ROS 2 trajectories and G-code.

A set point is the position of every axis, a motor of the stand, at one time.
"""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.base import StandError, replacing
from fantoccini.base.documents import yaml_of
from fantoccini.stand.controllers import Dynamixel, Klipper, ODrive, Ros2
from fantoccini.stand.gcode_text import gcode
from fantoccini.stand.klipper_text import klipper_macro
from fantoccini.stand.points import SetPoints

SET_POINT_SUFFIXES = (".csv", ".gcode", ".nc", ".cfg", ".json", ".yaml", ".yml")
"""Endings of files that can be written."""
DYNAMIXEL_CENTRE, COUNTS_PER_TURN = 2048, 4096
"""Counts of a Dynamixel at position 0, and per turn."""


def save_points(points: SetPoints, path: str | os.PathLike[str]) -> Path:
    """Writes set points to a file; its ending and the controller select the format.

    Raises:
        StandError: the controller does not read such a file, or its format has no times.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".csv":
        text = csv_text(points)
    elif suffix in (".json", ".yaml", ".yml"):
        text = _trajectory_text(points, suffix)
    elif suffix in (".gcode", ".nc"):
        text = gcode(points)
    elif suffix == ".cfg" and isinstance(points.controller, Klipper):
        text = klipper_macro(gcode(points), "FANTOCCINI")
    else:
        raise StandError(
            f"{path}: no set points for {points.controller.type} end in {suffix!r}; allowed: "
            ".csv, .gcode and .nc, .json and .yaml (ROS 2), .cfg (klipper)"
        )
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def csv_text(points: SetPoints) -> str:
    """CSV text: time, then every axis, in the controller's units.

    ODrive: turns of the motor and turns per second; Dynamixel: counts; others: [m or rad].
    """
    motion, controller, axes = points.complete_motion(), points.controller, points.axes
    names = [str(controller.names.get(axis.name, axis.name)) for axis in axes]
    for name in names:
        if "," in name or '"' in name:
            raise StandError(f'names of axes: found {name!r}; needed: a name without , or "')
    turns = np.array([axis.direction * axis.ratio / (2.0 * math.pi) for axis in axes])
    if isinstance(controller, ODrive):
        headings = [f"{name}.{quantity}" for name in names for quantity in ("position", "velocity")]
        values = np.stack([motion.position * turns, motion.velocity * turns], axis=2)
        rows = values.reshape(len(motion), -1)
    elif isinstance(controller, Dynamixel):
        headings, rows = (
            names,
            np.rint(DYNAMIXEL_CENTRE + COUNTS_PER_TURN * motion.position * turns),
        )
    else:
        units = ["m" if axis.unit == "m" else "rad" for axis in axes]
        headings = [f"{name} [{unit}]" for name, unit in zip(names, units, strict=True)]
        rows = motion.position
    are_counts = isinstance(controller, Dynamixel)
    lines = [",".join(["t [s]", *headings])]
    for t, row in zip(motion.t, rows, strict=True):
        cells = (f"{x:.0f}" if are_counts else f"{x:.9g}" for x in row)
        lines.append(",".join([f"{t:.6f}", *cells]))
    return "\n".join([*lines, ""])


def joint_trajectory(points: SetPoints) -> dict[str, Any]:
    """The fields of a ROS 2 ``trajectory_msgs/JointTrajectory``."""
    motion, controller = points.complete_motion(), points.controller
    rows = zip(motion.t, motion.position, motion.velocity, motion.acceleration, strict=True)
    return {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": [str(controller.names.get(a.name, a.name)) for a in points.axes],
        "points": [
            {
                "positions": p.tolist(),
                "velocities": v.tolist(),
                "accelerations": a.tolist(),
                "effort": [],
                "time_from_start": _time_fields(float(t)),
            }
            for t, p, v, a in rows
        ],
    }


def _trajectory_text(points: SetPoints, suffix: str) -> str:
    if not isinstance(points.controller, Ros2):
        raise StandError(
            f"{suffix} is a ROS 2 JointTrajectory, and the controller is "
            f"{points.controller.type}; needed: --controller ros2, or another ending"
        )
    data = joint_trajectory(points)
    return json.dumps(data, indent=1) + "\n" if suffix == ".json" else yaml_of(data)


def _time_fields(t: float) -> dict[str, int]:
    nanoseconds = round(t * 1e9)
    return {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
