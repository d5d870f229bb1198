"""An emulated GRBL: lines of G-code in, ``ok`` or ``error:N`` out, and steps counted per axis.

It knows G0, G1, G4, G10 L20, G20, G21, G90, G91, G92, G93, G94, M2, M30, `$H`, `$X`, `$I`, `$$` and
feed hold. Time is its own: a line takes none but what its moves take.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

import numpy as np

from fantoccini.arrays import Array, Times
from fantoccini.stand.grbl_planner import GrblSettings, Planner

ERRORS = {
    1: "a word does not begin with a letter",
    2: "a number is missing or wrong",
    3: "this $ command is not known",
    9: "locked: home ($H) or unlock ($X) first",
    11: "the line is too long",
    15: "the target is outside of the machine's travel",
    20: "this command is not known",
    22: "no feed rate was given",
    25: "a word stands twice",
    26: "no axis is named",
    36: "a word is not used by this command",
}
"""GRBL's numbers of errors, and what they mean."""
LONGEST = 79
"""Characters that a line has at most."""
DWELL = 0.05
"""Dwells are multiples of this, rounded up [s]."""

_WORD = re.compile(r"([A-Z])([+-]?(?:\d+\.?\d*|\.\d+))")
_DROPPED = re.compile(r"\([^)]*\)|;.*|\s")
_MODES = {"G0", "G1", "G20", "G21", "G90", "G91", "G93", "G94", "M2", "M30"}
_COMMANDS = {"G4", "G10", "G92"}


class _Refused(Exception):
    """A line that cannot be done, with its number."""


@dataclass(eq=False)
class GrblMachine:
    """The controller and its motors.

    Attributes:
        settings: of the machine.
        planner: its moves.
        locked: whether it waits to be unlocked.
        starts: times at which it went on after a dwell [s].
    """

    settings: GrblSettings
    planner: Planner = field(init=False)
    locked: bool = False
    starts: list[float] = field(default_factory=list)
    _motion: str = "G0"
    _unit: float = 1.0
    _relative: bool = False
    _inverse: bool = False
    _feed: float = 0.0
    _offset: Array = field(init=False)

    def __post_init__(self) -> None:
        self.planner = Planner(self.settings)
        self._offset = np.zeros(len(self.settings.letters))

    @property
    def position(self) -> Array:
        """(n,) where the last planned move ends, in the axes' own positions [units]."""
        return self.planner.steps / self.settings.steps - self._offset

    def positions(self, times: Times) -> Array:
        """(T, n) positions of the motors at times [units]."""
        return self.planner.steps_at(times) / self.settings.steps - self._offset

    def line(self, text: str) -> str:
        """Its answer to a line."""
        try:
            text = _DROPPED.sub("", text).upper()
            if len(text) > LONGEST:
                raise _Refused(11)
            if text.startswith("$"):
                return self._system(text)
            if text:
                if self.locked:
                    raise _Refused(9)
                self._block(_words(text))
        except _Refused as refused:
            return f"error:{refused.args[0]}"
        return "ok"

    def reset(self) -> None:
        """Drops what waits, and all modes."""
        self.planner.clear()
        self._motion, self._unit, self._relative, self._inverse = "G0", 1.0, False, False
        self._feed = 0.0

    def _system(self, text: str) -> str:
        if text == "$H":
            self.planner.finish()
            self.locked = False
        elif text == "$X":
            self.locked = False
        elif text == "$$":
            return "\r\n".join([*self.settings.lines(), "ok"])
        elif text == "$I":
            return "[VER:1.1 emulated]\r\nok"
        else:
            raise _Refused(3)
        return "ok"

    def _block(self, words: list[tuple[str, float]]) -> None:
        commands = [f"{letter}{value:g}" for letter, value in words if letter in "GM"]
        unknown = [c for c in commands if c not in _MODES and c not in _COMMANDS]
        if unknown:
            raise _Refused(20)
        values: dict[str, float] = {}
        for letter, value in words:
            if letter in "GMN":
                continue
            if letter in values:
                raise _Refused(25)
            values[letter] = value
        for command in commands:
            self._mode(command)
        moved = {a: values.pop(a) for a in self.settings.letters if a in values}
        if self._inverse:
            feed = values.pop("F", 0.0)  # of this line only
        else:
            feed = self._feed = values.pop("F", self._feed / self._unit) * self._unit
        if "G4" in commands:
            if "P" not in values:
                raise _Refused(2)
            self.planner.wait(math.ceil(values.pop("P") / DWELL - 1e-9) * DWELL)
            self.starts.append(self.planner.time)
        elif "G92" in commands or "G10" in commands:
            self._set(moved, values, "G10" in commands)
        elif moved:
            self._move(moved, feed)
        if values:
            raise _Refused(36)
        if "M2" in commands or "M30" in commands:
            self.planner.finish()

    def _mode(self, command: str) -> None:
        if command in ("G0", "G1"):
            self._motion = command
        elif command in ("G20", "G21"):
            self._unit = 25.4 if command == "G20" else 1.0
        elif command in ("G90", "G91"):
            self._relative = command == "G91"
        elif command in ("G93", "G94"):
            self._inverse = command == "G93"

    def _set(self, moved: dict[str, float], values: dict[str, float], stored: bool) -> None:
        """Calls where it stands by other positions."""
        if stored and (values.pop("L", 0.0) != 20.0 or values.pop("P", 0.0) not in (0.0, 1.0)):
            raise _Refused(20)
        if not moved:
            raise _Refused(26)
        self.planner.finish()
        for letter, value in moved.items():
            k = self.settings.letters.index(letter)
            at = self.planner.steps[k] / self.settings.steps[k]
            self._offset[k] = at - value * self._unit

    def _move(self, moved: dict[str, float], feed: float) -> None:
        rate = feed / 60.0
        if self._motion == "G0":
            rate = math.inf
        elif not rate > 0.0:
            raise _Refused(22)
        target = self.position
        for letter, value in moved.items():
            k = self.settings.letters.index(letter)
            target[k] = value * self._unit + (target[k] if self._relative else 0.0)
        steps = np.rint((target + self._offset) * self.settings.steps).astype(np.int64)
        self.planner.add(steps, rate, self._inverse and self._motion == "G1")


def _words(text: str) -> list[tuple[str, float]]:
    found, at = [], 0
    while at < len(text):
        match = _WORD.match(text, at)
        if match is None:
            raise _Refused(2 if text[at].isalpha() else 1)
        found.append((match[1], float(match[2])))
        at = match.end()
    return found
