"""G-code of set points for Klipper."""

from __future__ import annotations

import re

from fantoccini.base import Array
from fantoccini.stand.gcode_words import (
    gcode_units,
    title_lines,
    with_decimals,
    with_significant_digits,
)
from fantoccini.stand.points import SLOW_SPEED_SHARE, SetPoints

_NAME = re.compile(r"[A-Za-z0-9_]+")


def klipper_gcode(points: SetPoints) -> str:
    """G-code for Klipper: every axis is a `manual_stepper`, and G4 keeps the time."""
    names = [str(points.controller.names.get(a.name, a.name)) for a in points.axes]
    mistakes = [
        (("controller", "names", axis.name), f"found {name!r}; needed: letters, digits and _")
        for axis, name in zip(points.axes, names, strict=True)
        if not _NAME.fullmatch(name)
    ]
    points.map.stand.raise_if_any([*mistakes])
    scale, motion = gcode_units(points.axes), points.motion
    lines = title_lines(points)
    start = points.home_position() if points.home else motion.position[0]
    for k, (name, axis) in enumerate(zip(names, points.axes, strict=True)):
        if points.home and axis.file.home is not None:
            home = axis.file.home
            low_end, high_end = (scale[k] * x for x in axis.travel)
            homing_move = (low_end - high_end) if home.towards == "min" else (high_end - low_end)
            lines += [
                f"MANUAL_STEPPER STEPPER={name} ENABLE=1 SET_POSITION=0",
                f"MANUAL_STEPPER STEPPER={name} MOVE={with_decimals(homing_move, 4)} "
                f"SPEED={with_significant_digits(home.speed * scale[k], 6)} STOP_ON_ENDSTOP=1",
                f"MANUAL_STEPPER STEPPER={name} "
                f"SET_POSITION={with_decimals(home.at * scale[k], 4)}",
                f"MANUAL_STEPPER STEPPER={name} MOVE={with_decimals(start[k] * scale[k], 4)} "
                f"SPEED={with_significant_digits(home.speed * scale[k], 6)}",
            ]
        else:
            lines.append(
                f"MANUAL_STEPPER STEPPER={name} ENABLE=1 "
                f"SET_POSITION={with_decimals(start[k] * scale[k], 4)}"
            )
    for target in points.targets_before():
        lines += _move(points, names, start, target, None)
        start = target
    lines.append("; motion")
    for i in range(len(motion) - 1):
        seconds = float(motion.t[i + 1] - motion.t[i])
        p = motion.position
        lines += _move(points, names, p[i], p[i + 1], seconds)
    lines.append("; end")
    parking_position = points.target_after()
    if parking_position is not None:
        lines += _move(points, names, motion.position[-1], parking_position, None)
    return "\n".join([*lines, ""])


def _move(
    points: SetPoints, names: list[str], first: Array, last: Array, seconds: float | None
) -> list[str]:
    """A move of all axes and a wait for its end; slow, unless ``seconds`` gives its duration."""
    scale = gcode_units(points.axes)
    lines = []
    begin, end = ([float(with_decimals(x, 4)) for x in p * scale] for p in (first, last))
    distances = [abs(b - a) for a, b in zip(begin, end, strict=True)]
    duration, accelerations = seconds or 0.0, [0.0] * len(names)
    if seconds is None:
        max_speeds = [axis.file.speed or 0.0 for axis in points.axes]
        speeds = [SLOW_SPEED_SHARE * s * v for s, v in zip(scale, max_speeds, strict=True)]
        accelerations = [
            s * (a.file.acceleration or 0.0) for s, a in zip(scale, points.axes, strict=True)
        ]
        duration = max(d / v for d, v in zip(distances, speeds, strict=True))
    for k, name in enumerate(names):
        if distances[k]:
            lines.append(
                f"MANUAL_STEPPER STEPPER={name} MOVE={with_decimals(end[k], 4)} "
                f"SPEED={with_significant_digits(distances[k] / duration, 9)} "
                f"ACCEL={with_significant_digits(accelerations[k], 6)} SYNC=0"
            )
    if seconds is None and lines:  # each ramp adds speed / acceleration
        duration += max(d / duration / a for d, a in zip(distances, accelerations, strict=True))
    return [*lines, f"G4 P{with_significant_digits(1000.0 * duration, 9)}"] if duration else []


def klipper_macro(text: str, name: str) -> str:
    """G-code lines as a `[gcode_macro]` section of Klipper's configuration."""
    lines = [f"  {line}" for line in text.splitlines() if not line.startswith(";")]
    return "\n".join([f"[gcode_macro {name}]", "gcode:", *lines, ""])
