"""G-code of set points for GRBL, FluidNC and Marlin; :func:`gcode` also writes that of Klipper.

Positions are in mm, or in degrees for an axis that turns (A, B and C). As in GRBL, the path length
of a move is the root of the sum of squares over all axes, with degrees counted as mm.

A set point is the position of every axis, a motor of the stand, at one time. A dwell is a pause;
the junction deviation is the distance by which a controller may cut a corner.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fantoccini.base import Array, StandError
from fantoccini.stand.axes import axes_of
from fantoccini.stand.controllers import Grbl, Klipper, Marlin, axis_letters
from fantoccini.stand.gcode_words import (
    gcode_units,
    title_lines,
    with_decimals,
    with_significant_digits,
)
from fantoccini.stand.klipper_text import klipper_gcode
from fantoccini.stand.points import SLOW_SPEED_SHARE, SetPoints
from fantoccini.stand.stand_file import Stand
from fantoccini.stand.timed_moves import Limits, TimedMoves, timed_moves

ACCELERATION_RESERVE = 3.0
"""Ratio of the controller's acceleration to that of the axes; it shortens ramps between set points.
"""
SPEED_RESERVE = 1.5
"""Ratio of the controller's largest speed to that of the axes."""
MIN_JUNCTION_DEVIATION = 0.01
"""Smallest junction deviation [mm]."""
MAX_LINE_LENGTH = 79
"""Longest line for GRBL [characters]."""

SETTLING_DWELL = 0.1
"""Dwell before the motion, during which all earlier moves end [s]."""


@dataclass(frozen=True, eq=False)
class GrblSettings(Limits):
    """A controller's settings for its machine; n axes. Units are mm, or degrees for a turning axis.

    Attributes:
        letters: letters of the axes, in order.
        reversed: for every axis, whether its motor turns backwards.
        buffer: size of the serial buffer [characters].
    """

    letters: str
    reversed: tuple[bool, ...]
    buffer: int

    def lines(self) -> list[str]:
        """Lines of GRBL's settings, ``$100=...``."""
        mask = sum(1 << k for k, is_reversed in enumerate(self.reversed) if is_reversed)
        lines = [f"$3={mask}", f"$11={self.junction:.3f}"]
        for k in range(len(self.letters)):
            lines += [
                f"${100 + k}={self.steps[k]:.3f}",
                f"${110 + k}={60.0 * self.rate[k]:.3f}",
                f"${120 + k}={self.acceleration[k]:.3f}",
            ]
        return lines


def grbl_settings(stand: Stand, controller: Any, rate: float) -> GrblSettings:
    """Settings that a controller needs for a stand and a rate of set points.

    Raises:
        StandError: the controller is not GRBL, FluidNC or Marlin.
    """
    if not isinstance(controller, Grbl | Marlin):
        raise StandError(f"{controller.type} is not grbl, fluidnc or marlin; give --controller")
    axes = axes_of(stand)
    scale = gcode_units(axes)
    acceleration = (
        ACCELERATION_RESERVE * scale * np.array([axis.file.acceleration for axis in axes])
    )
    junction = float(np.max(acceleration)) / rate**2 / 4.0
    return GrblSettings(
        np.array([axis.counts_per_unit for axis in axes]) / scale,
        SPEED_RESERVE * scale * np.array([axis.file.speed for axis in axes]),
        acceleration,
        max(MIN_JUNCTION_DEVIATION, junction),
        controller.planner,
        axis_letters(controller, controller.type, tuple(stand.axes))[0],
        tuple(axis.direction < 0 for axis in axes),
        controller.buffer if isinstance(controller, Grbl) else 128,
    )


@dataclass(frozen=True, eq=False)
class Program:
    """G-code of a controller, with the times of its moves.

    Attributes:
        text: the lines.
        first_line: number of the first line of the motion, from 1.
        begin: (m,) times in the set points at which this and the following lines begin [s].
        max_wait: longest duration of the moves that a controller ends before it answers [s].
    """

    text: str
    first_line: int
    begin: Array
    max_wait: float

    def time_of(self, line: int) -> float:
        """Time in the set points at which a line begins [s]; 0 before the motion."""
        k = min(line - self.first_line, len(self.begin) - 1)
        return float(self.begin[k]) if k >= 0 else 0.0


def gcode(points: SetPoints, inverse: bool = True) -> str:
    """G-code of set points for their controller.

    Args:
        points: the set points.
        inverse: for GRBL and FluidNC, whether feeds are inverse times (G93) or mm/min (G94).

    Raises:
        StandError: the controller does not accept G-code, or cannot keep the times.
    """
    if isinstance(points.controller, Klipper):
        return klipper_gcode(points)
    return gcode_program(points, inverse).text


def gcode_program(points: SetPoints, inverse: bool = True) -> Program:
    """:func:`gcode` for GRBL, FluidNC and Marlin, with the times of its moves."""
    if not isinstance(points.controller, Grbl | Marlin):
        raise StandError(
            f"{points.controller.type} does not accept G-code; needed: another ending, or "
            "--controller grbl, fluidnc, marlin or klipper"
        )
    settings = grbl_settings(points.map.stand, points.controller, points.rate)
    moves = timed_moves(points.motion.t, points.counts, settings)
    is_marlin = isinstance(points.controller, Marlin)
    writer = GcodeWriter(points, settings, inverse and not is_marlin, is_marlin)
    lines = [
        *_header(points, settings, is_marlin),
        *writer.lines_before(),
        *writer.lines_of_motion(moves),
        *writer.lines_after(),
    ]
    _check_port_speed(points, moves, lines)
    begin = moves.begin
    if points.resumed is not None:
        begin = np.interp(begin, points.motion.t, points.resumed)
    # Before a dwell and at the end, a controller answers once its planner is empty.
    window = np.ones(settings.planner + 1)
    max_wait = float(np.max(np.convolve([0.0, *writer.seconds], window)))
    return Program("\n".join([*lines, ""]), lines.index("; motion") + 2, begin, max_wait)


def slow_feed(points: SetPoints) -> float:
    """Feed at which no axis exceeds ``SLOW_SPEED_SHARE`` of its largest speed [mm/min].

    At least 1, the minimum of GRBL.
    """
    speeds = np.array([axis.file.speed for axis in points.axes]) * gcode_units(points.axes)
    return max(1.0, float(np.floor(60.0 * SLOW_SPEED_SHARE * np.min(speeds))))


def _first_move_time(points: SetPoints) -> float:
    """Longest duration of homing, or of a slow move to where a stream resumes [s]."""
    travels = np.ptp([axis.travel for axis in points.axes], axis=1)
    path_length = float(np.linalg.norm(travels * gcode_units(points.axes)))
    homing_times = [
        travel / axis.file.home.speed
        for axis, travel in zip(points.axes, travels, strict=True)
        if axis.file.home is not None
    ]
    return max(60.0 * path_length / slow_feed(points), sum(homing_times) if points.home else 0.0)


class GcodeWriter:
    """Writer of G-code lines for GRBL, FluidNC and Marlin.

    Attributes:
        seconds: longest durations of the lines that move the axes or dwell, in order [s].
    """

    def __init__(self, points: SetPoints, settings: GrblSettings, inverse: bool, is_marlin: bool):
        self.points, self.settings = points, settings
        self.inverse, self.is_marlin = inverse, is_marlin
        self.scale = gcode_units(points.axes)
        self.last_words: dict[str, str] = {}  # letter of an axis -> its last position
        has_first_move = points.home or points.resumed is not None
        self.seconds = [_first_move_time(points)] if has_first_move else []

    def lines_before(self) -> list[str]:
        """Lines before the motion: units, homing, slack, and the move to the start."""
        points, names = self.points, self.settings.letters
        lines = ["G21", "G90", "G94"]
        if points.resumed is not None:
            words = self._words(self._whole_steps(points.motion.position[0] * self.scale))
            lines.append(f"G1{words}F{slow_feed(points):g}")
        elif points.home:
            home = self._words(self._whole_steps(points.home_position() * self.scale))
            lines += ["G28" if self.is_marlin else "$H", self._set_position(home)]
        else:
            targets = points.targets_before()
            known_position = targets[-1] if targets else points.motion.position[0]
            lines.append(
                self._set_position(self._words(self._whole_steps(known_position * self.scale)))
            )
        position = points.home_position() if points.home else points.motion.position[0]
        for target in points.targets_before():
            lines += self._slow_move(position, target)
            position = target
        self.last_words = dict(zip(names, self._position_texts(points.counts[0]), strict=True))
        return [*lines, self._dwell(SETTLING_DWELL), *(["G93"] if self.inverse else []), "; motion"]

    def lines_of_motion(self, moves: TimedMoves) -> list[str]:
        """Lines of the motion."""
        lines = []
        self.seconds += moves.seconds.tolist()
        for k in range(len(moves)):
            if moves.dwells[k]:
                lines.append(self._dwell(moves.seconds[k]))
                continue
            previous_words = {**self.last_words}
            words = self._changed_words(self._position_texts(moves.target[k]))
            length = moves.length[k]
            if self.is_marlin:
                length = self._marlin_length(previous_words)
            speed = moves.speed[k] * length / moves.length[k]
            feed = 60.0 * speed / length if self.inverse else 60.0 * speed
            lines.append(f"G1{words}F{with_significant_digits(feed, 8)}")
        return lines

    def lines_after(self) -> list[str]:
        """Lines after the motion: parking and the end."""
        lines = ["; end", "G94"]
        parking_position = self.points.target_after()
        if parking_position is not None:
            lines += self._slow_move(self.points.motion.position[-1], parking_position)
        # Both wait for the end of all moves before they are acknowledged.
        return [*lines, "M400" if self.is_marlin else "M2"]

    def _slow_move(self, start: Array, end: Array) -> list[str]:
        """A slow move to positions [m or rad]."""
        distance = np.abs(end - start) * self.scale
        if not np.any(np.rint(distance * self.settings.steps)):
            return []
        length = float(np.linalg.norm(distance))
        speed = np.array([axis.file.speed for axis in self.points.axes]) * self.scale
        is_moving = distance > 0.0
        rate = SLOW_SPEED_SHARE * float(np.min(speed[is_moving] * length / distance[is_moving]))
        words = self._words(self._whole_steps(end * self.scale))
        self.seconds.append(length / rate)
        return [f"G1{words}F{with_significant_digits(60.0 * rate, 6)}"]

    def _set_position(self, words: str) -> str:
        """The command that sets the present position to these words."""
        return f"G92{words}" if self.is_marlin else f"G10L20P1{words}"

    def _dwell(self, seconds: float) -> str:
        return (
            f"G4P{1000.0 * seconds:.0f}"
            if self.is_marlin
            else f"G4P{with_significant_digits(seconds, 6)}"
        )

    def _whole_steps(self, position: Array) -> Array:
        return np.rint(position * self.settings.steps)

    def _position_texts(self, steps: Array) -> list[str]:
        """Positions of whole steps, with as many decimals as one step needs."""
        return [
            with_decimals(
                float(count / steps_per_unit),
                int(np.clip(np.ceil(np.log10(steps_per_unit)) + 2, 3, 5)),
            )
            for count, steps_per_unit in zip(steps, self.settings.steps, strict=True)
        ]

    def _words(self, steps: Array) -> str:
        return "".join(
            map("".join, zip(self.settings.letters, self._position_texts(steps), strict=True))
        )

    def _changed_words(self, texts: list[str]) -> str:
        words = ""
        for letter, text in zip(self.settings.letters, texts, strict=True):
            if self.last_words.get(letter) != text:
                self.last_words[letter] = text
                words += letter + text
        return words

    def _marlin_length(self, previous_words: dict[str, str]) -> float:
        """Path length as Marlin computes it: over X, Y and Z, or over the others if those rest."""
        distances = {
            letter: float(self.last_words[letter]) - float(previous_words[letter])
            for letter in self.last_words
        }
        linear = np.array([distances[letter] for letter in distances if letter in "XYZ"])
        if np.any(linear):
            return float(np.linalg.norm(linear))
        return float(
            np.linalg.norm([distances[letter] for letter in distances if letter not in "XYZ"])
        )


def _header(points: SetPoints, settings: GrblSettings, is_marlin: bool) -> list[str]:
    """Comment lines: the stand, the letter of every axis, and the controller's settings."""
    lines = title_lines(points)
    for letter, axis in zip(settings.letters, points.axes, strict=True):
        lines.append(f"; {letter} = {axis.name} [{'mm' if axis.unit == 'm' else 'deg'}]")
    if not is_marlin:
        return [*lines, "; settings", *(f"; {line}" for line in settings.lines())]
    values_by_code = {"M92": settings.steps, "M203": settings.rate, "M201": settings.acceleration}
    lines.append("; settings")
    for code, values in values_by_code.items():
        words = (f"{a}{v:.3f}" for a, v in zip(settings.letters, values, strict=True))
        lines.append(f"; {code} {' '.join(words)}")
    return [
        *lines,
        f"; M204 T{np.max(settings.acceleration):.3f}",
        f"; M205 J{settings.junction:.3f}",
    ]


def _check_port_speed(points: SetPoints, moves: TimedMoves, lines: list[str]) -> None:
    """Raises a StandError if the port cannot carry the lines in time."""
    if isinstance(points.controller, Grbl):
        longest = max((line for line in lines if not line.startswith(";")), key=len)
        if len(longest) > MAX_LINE_LENGTH:
            raise StandError(
                f"a line has {len(longest)} characters, GRBL accepts {MAX_LINE_LENGTH}"
            )
    motion_lines = lines[lines.index("; motion") + 1 : lines.index("; end")]
    seconds = np.array([10.0 * (len(line) + 1) / points.controller.baud for line in motion_lines])
    moves_ahead = points.controller.planner - 1
    for i in range(len(motion_lines) - moves_ahead):
        sending_time, moving_time = (
            np.sum(seconds[i : i + moves_ahead]),
            np.sum(moves.seconds[i : i + moves_ahead]),
        )
        if sending_time > moving_time:
            raise StandError(
                f"at {points.controller.baud} baud, {moves_ahead} lines take {sending_time:.3f} s, "
                "but "
                f"the moves last {moving_time:.3f} s (t = {moves.begin[i]:.3f} s); needed: fewer "
                "set points per second (--rate), or a faster port"
            )
