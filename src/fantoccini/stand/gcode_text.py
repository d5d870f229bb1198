"""G-code of set points for GRBL, FluidNC, Marlin and Klipper.

Lengths are mm; an axis that turns counts in degrees, as the letters A, B and C do. The path of a
move is the root of the sum of squares over all axes, degrees beside mm, as GRBL takes it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from fantoccini.base import Array, StandError
from fantoccini.stand.axes import Axis, axes_of
from fantoccini.stand.controllers import Grbl, Klipper, Marlin
from fantoccini.stand.points import GENTLE, SetPoints
from fantoccini.stand.stand_file import Stand
from fantoccini.stand.timed_moves import Limits, TimedMoves, timed_moves

LETTERS = {"grbl": "XYZABC", "fluidnc": "XYZABC", "marlin": "XYZABCUVW"}
"""Of axes that a controller knows."""
SPARE = 3.0
"""Acceleration that the controller is to have, over that of the axes: its ramps are short, between
set points that keep the axes' own."""
SPARE_RATE = 1.5
"""Speed that it is to have, over that of the axes."""
LEAST_JUNCTION = 0.01
"""Deviation at junctions [mm]."""
LONGEST = 79
"""Characters of a line for GRBL."""

_KLIPPER_NAME = re.compile(r"[A-Za-z0-9_]+")
_PAUSE = 0.1
"""Of a dwell before the motion, in which all moves come to their end [s]."""


@dataclass(frozen=True, eq=False)
class GrblSettings(Limits):
    """What a controller is told of its machine; n axes. Units are mm, or degrees of a turn.

    Attributes:
        letters: of the axes, in order.
        reversed: which motors turn backwards.
        buffer: characters that its serial buffer holds.
    """

    letters: str
    reversed: tuple[bool, ...]
    buffer: int

    def lines(self) -> list[str]:
        """As GRBL's own settings, ``$100=...``."""
        mask = sum(1 << k for k, back in enumerate(self.reversed) if back)
        found = [f"$3={mask}", f"$11={self.junction:.3f}"]
        for k in range(len(self.letters)):
            found += [
                f"${100 + k}={self.steps[k]:.3f}",
                f"${110 + k}={60.0 * self.rate[k]:.3f}",
                f"${120 + k}={self.acceleration[k]:.3f}",
            ]
        return found


def units(axes: tuple[Axis, ...]) -> Array:
    """(n,) units of G-code per unit of the axes: mm per m, or degrees per rad."""
    return np.array([1000.0 if axis.unit == "m" else np.degrees(1.0) for axis in axes])


def letters(stand: Stand, controller: Any) -> str:
    """Of a stand's axes, in order.

    Raises:
        StandError: there are too many axes.
        FileError: the controller has other names.
    """
    known, axes = LETTERS[controller.type], tuple(stand.axes)
    if len(axes) > len(known):
        raise StandError(
            f"{controller.type} moves up to {len(known)} axes, the stand has {len(axes)}; needed: "
            "several controllers, or klipper"
        )
    names = controller.names
    free = [letter for letter in known if letter not in names.values()]
    out, found = [], []
    for axis in axes:
        name = str(names[axis]) if axis in names else free.pop(0)
        if name not in known or name in out:
            text = f"found {name!r}; needed: a letter of {known}, one an axis"
            found.append((("controller", "names", axis), text))
        out.append(name)
    stand.refuse([*found])
    return "".join(out)


def grbl_settings(stand: Stand, controller: Any, rate: float) -> GrblSettings:
    """What a controller is to be told of a stand that takes set points at a rate.

    Raises:
        StandError, FileError: as of :func:`letters`; it is not GRBL, FluidNC or Marlin.
    """
    if not isinstance(controller, Grbl | Marlin):
        raise StandError(f"{controller.type} is not grbl, fluidnc or marlin; give --controller")
    axes = axes_of(stand)
    scale = units(axes)
    acceleration = SPARE * scale * np.array([axis.file.acceleration for axis in axes])
    junction = float(np.max(acceleration)) / rate**2 / 4.0
    return GrblSettings(
        np.array([axis.counts for axis in axes]) / scale,
        SPARE_RATE * scale * np.array([axis.file.speed for axis in axes]),
        acceleration,
        max(LEAST_JUNCTION, junction),
        controller.planner,
        letters(stand, controller),
        tuple(axis.direction < 0 for axis in axes),
        controller.buffer if isinstance(controller, Grbl) else 128,
    )


def gcode(points: SetPoints, inverse: bool = True) -> str:
    """The lines for the points' controller.

    Args:
        points: the set points.
        inverse: of GRBL and FluidNC, whether moves have inverse times (G93) or mm/min (G94).

    Raises:
        StandError: the controller takes no G-code, or cannot keep the times.
    """
    if isinstance(points.controller, Klipper):
        return _klipper(points)
    if not isinstance(points.controller, Grbl | Marlin):
        raise StandError(
            f"{points.controller.type} takes no G-code; needed: another ending, or --controller "
            "grbl, fluidnc, marlin or klipper"
        )
    settings = grbl_settings(points.map.stand, points.controller, points.rate)
    moves = timed_moves(points.motion.t, points.counts, settings)
    marlin = isinstance(points.controller, Marlin)
    text = _Text(points, settings, inverse and not marlin, marlin)
    lines = [*_head(points, settings, marlin), *text.before(), *text.timed(moves), *text.after()]
    _refuse_slow_port(points, moves, lines)
    return "\n".join([*lines, ""])


def gentle_feed(points: SetPoints) -> float:
    """Feed at which no axis is faster than gently [mm/min]."""
    speeds = np.array([axis.file.speed for axis in points.axes]) * units(points.axes)
    return float(np.floor(60.0 * GENTLE * np.min(speeds)))


class _Text:
    """Lines for GRBL and firmware like it."""

    def __init__(self, points: SetPoints, settings: GrblSettings, inverse: bool, marlin: bool):
        self.points, self.settings = points, settings
        self.inverse, self.marlin = inverse, marlin
        self.scale = units(points.axes)
        self.at: dict[str, str] = {}

    def before(self) -> list[str]:
        points, names = self.points, self.settings.letters
        lines = ["G21", "G90", "G94"]
        if points.home:
            home = self._words(self._steps(points.at_home() * self.scale))
            lines += ["G28" if self.marlin else "$H", self._called(home)]
        else:
            legs = points.legs_before()
            first = legs[-1] if legs else points.motion.position[0]
            lines.append(self._called(self._words(self._steps(first * self.scale))))
        at = points.at_home() if points.home else points.motion.position[0]
        for leg in points.legs_before():
            lines += self._gently(at, leg)
            at = leg
        self.at = dict(zip(names, self._texts(points.counts[0]), strict=True))
        return [*lines, self._dwell(_PAUSE), *(["G93"] if self.inverse else []), "; motion"]

    def timed(self, moves: TimedMoves) -> list[str]:
        lines = []
        for k in range(len(moves)):
            if moves.dwells[k]:
                lines.append(self._dwell(moves.seconds[k]))
                continue
            before = {**self.at}
            words = self._changed(self._texts(moves.target[k]))
            length = moves.length[k]
            if self.marlin:
                length = self._marlin_length(before)
            speed = moves.speed[k] * length / moves.length[k]
            feed = 60.0 * speed / length if self.inverse else 60.0 * speed
            lines.append(f"G1{words}F{_digits(feed, 8)}")
        return lines

    def after(self) -> list[str]:
        lines = ["; end", "G94"]
        park = self.points.leg_after()
        if park is not None:
            lines += self._gently(self.points.motion.position[-1], park)
        return lines if self.marlin else [*lines, "M2"]

    def _gently(self, first: Array, last: Array) -> list[str]:
        """A slow move to positions [m or rad]."""
        far = np.abs(last - first) * self.scale
        if not np.any(np.rint(far * self.settings.steps)):
            return []
        length = float(np.linalg.norm(far))
        speed = np.array([axis.file.speed for axis in self.points.axes]) * self.scale
        moved = far > 0.0
        rate = GENTLE * float(np.min(speed[moved] * length / far[moved]))
        words = self._words(self._steps(last * self.scale))
        return [f"G1{words}F{_digits(60.0 * rate, 6)}"]

    def _called(self, words: str) -> str:
        """Calls where the axes stand."""
        return f"G92{words}" if self.marlin else f"G10L20P1{words}"

    def _dwell(self, seconds: float) -> str:
        return f"G4P{1000.0 * seconds:.0f}" if self.marlin else f"G4P{_digits(seconds, 6)}"

    def _steps(self, position: Array) -> Array:
        return np.rint(position * self.settings.steps)

    def _texts(self, steps: Array) -> list[str]:
        """Positions of whole steps, as they are written."""
        return [
            _fixed(float(count / per), int(np.clip(np.ceil(np.log10(per)) + 2, 3, 5)))
            for count, per in zip(steps, self.settings.steps, strict=True)
        ]

    def _words(self, steps: Array) -> str:
        return "".join(map("".join, zip(self.settings.letters, self._texts(steps), strict=True)))

    def _changed(self, texts: list[str]) -> str:
        out = ""
        for letter, text in zip(self.settings.letters, texts, strict=True):
            if self.at.get(letter) != text:
                self.at[letter] = text
                out += letter + text
        return out

    def _marlin_length(self, before: dict[str, str]) -> float:
        """Of the path as Marlin takes it: X, Y and Z, or the others where those stand."""
        far = {a: float(self.at[a]) - float(before[a]) for a in self.at}
        linear = np.array([far[a] for a in far if a in "XYZ"])
        if np.any(linear):
            return float(np.linalg.norm(linear))
        return float(np.linalg.norm([far[a] for a in far if a not in "XYZ"]))


def _head(points: SetPoints, settings: GrblSettings, marlin: bool) -> list[str]:
    """Comments: what this is, which axis is which, and what the controller must be told."""
    name, seconds = points.map.stand.name, points.motion.t[-1]
    lines = [f"; {name}: {len(points)} set points in {seconds:.3f} s"]
    for letter, axis in zip(settings.letters, points.axes, strict=True):
        lines.append(f"; {letter} = {axis.name} [{'mm' if axis.unit == 'm' else 'deg'}]")
    if not marlin:
        return [*lines, "; settings", *(f"; {line}" for line in settings.lines())]
    pairs = {"M92": settings.steps, "M203": settings.rate, "M201": settings.acceleration}
    lines.append("; settings")
    for code, values in pairs.items():
        words = (f"{a}{v:.3f}" for a, v in zip(settings.letters, values, strict=True))
        lines.append(f"; {code} {' '.join(words)}")
    return [
        *lines,
        f"; M204 T{np.max(settings.acceleration):.3f}",
        f"; M205 J{settings.junction:.3f}",
    ]


def _refuse_slow_port(points: SetPoints, moves: TimedMoves, lines: list[str]) -> None:
    """Raises a StandError where the port cannot carry the lines in time."""
    if isinstance(points.controller, Grbl):
        longest = max((line for line in lines if not line.startswith(";")), key=len)
        if len(longest) > LONGEST:
            raise StandError(f"a line has {len(longest)} characters, GRBL takes {LONGEST}")
    own = lines[lines.index("; motion") + 1 : lines.index("; end")]
    seconds = np.array([10.0 * (len(line) + 1) / points.controller.baud for line in own])
    known = points.controller.planner - 1
    for i in range(len(own) - known):
        sent, lasts = np.sum(seconds[i : i + known]), np.sum(moves.seconds[i : i + known])
        if sent > lasts:
            raise StandError(
                f"at {points.controller.baud} baud, {known} lines take {sent:.3f} s, and the moves "
                f"last {lasts:.3f} s (t = {moves.begin[i]:.3f} s); needed: fewer set points per "
                "second (--rate), or a faster port"
            )


def _klipper(points: SetPoints) -> str:
    """A macro file for Klipper: every axis a `manual_stepper`; G4 is the clock."""
    names = [str(points.controller.names.get(a.name, a.name)) for a in points.axes]
    found = [
        (("controller", "names", axis.name), f"found {name!r}; needed: letters, digits and _")
        for axis, name in zip(points.axes, names, strict=True)
        if not _KLIPPER_NAME.fullmatch(name)
    ]
    points.map.stand.refuse([*found])
    scale, motion = units(points.axes), points.motion
    lines = [f"; {points.map.stand.name}: {len(points)} set points in {motion.t[-1]:.3f} s"]
    start = points.at_home() if points.home else motion.position[0]
    for k, (name, axis) in enumerate(zip(names, points.axes, strict=True)):
        if points.home and axis.file.home is not None:
            home = axis.file.home
            first, last = (scale[k] * x for x in axis.travel)
            over = (first - last) if home.towards == "min" else (last - first)
            lines += [
                f"MANUAL_STEPPER STEPPER={name} ENABLE=1 SET_POSITION=0",
                f"MANUAL_STEPPER STEPPER={name} MOVE={_fixed(over, 4)} "
                f"SPEED={_digits(home.speed * scale[k], 6)} STOP_ON_ENDSTOP=1",
                f"MANUAL_STEPPER STEPPER={name} SET_POSITION={_fixed(home.at * scale[k], 4)}",
                f"MANUAL_STEPPER STEPPER={name} MOVE={_fixed(start[k] * scale[k], 4)} "
                f"SPEED={_digits(home.speed * scale[k], 6)}",
            ]
        else:
            lines.append(
                f"MANUAL_STEPPER STEPPER={name} ENABLE=1 "
                f"SET_POSITION={_fixed(start[k] * scale[k], 4)}"
            )
    for leg in points.legs_before():
        lines += _klipper_move(points, names, start, leg, None)
        start = leg
    lines.append("; motion")
    for i in range(len(motion) - 1):
        seconds = float(motion.t[i + 1] - motion.t[i])
        p = motion.position
        lines += _klipper_move(points, names, p[i], p[i + 1], seconds)
    lines.append("; end")
    park = points.leg_after()
    if park is not None:
        lines += _klipper_move(points, names, motion.position[-1], park, None)
    return "\n".join([*lines, ""])


def _klipper_move(
    points: SetPoints, names: list[str], first: Array, last: Array, seconds: float | None
) -> list[str]:
    """All axes together, evenly in a time, or gently; then the clock goes on."""
    scale = units(points.axes)
    lines = []
    begin, end = ([float(_fixed(x, 4)) for x in p * scale] for p in (first, last))
    far = [abs(b - a) for a, b in zip(begin, end, strict=True)]
    lasts, ramps = seconds or 0.0, [0.0] * len(names)
    if seconds is None:
        top = [axis.file.speed or 0.0 for axis in points.axes]
        speeds = [GENTLE * s * v for s, v in zip(scale, top, strict=True)]
        ramps = [s * (a.file.acceleration or 0.0) for s, a in zip(scale, points.axes, strict=True)]
        lasts = max(d / v for d, v in zip(far, speeds, strict=True))
    for k, name in enumerate(names):
        if far[k]:
            lines.append(
                f"MANUAL_STEPPER STEPPER={name} MOVE={_fixed(end[k], 4)} "
                f"SPEED={_digits(far[k] / lasts, 9)} ACCEL={_digits(ramps[k], 6)} SYNC=0"
            )
    if seconds is None and lines:  # each ramp takes speed / acceleration more
        lasts += max(d / lasts / a for d, a in zip(far, ramps, strict=True))
    return [*lines, f"G4 P{_digits(1000.0 * lasts, 9)}"] if lasts else []


def macro(text: str, name: str) -> str:
    """Lines of Klipper as a `[gcode_macro]` of its configuration."""
    lines = [f"  {line}" for line in text.splitlines() if not line.startswith(";")]
    return "\n".join([f"[gcode_macro {name}]", "gcode:", *lines, ""])


def _fixed(value: float, decimals: int) -> str:
    text = f"{value:.{decimals}f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def _digits(value: float, digits: int) -> str:
    """A positive number with so many digits, without exponent."""
    before = int(np.floor(np.log10(value))) + 1 if value > 0.0 else 1
    return _fixed(value, max(0, digits - max(before, 1)))
