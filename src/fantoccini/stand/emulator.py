"""An emulated GRBL on a pseudo-terminal: answers lines of G-code and counts steps.

It supports the G-code that :func:`gcode` writes, ``$H`` and feed hold. Moves are straight with
trapezoidal speed profiles. The planner raises the start speeds of waiting moves as far as later
moves (or a stop) and the corner between two moves allow:

    start^2 <= next start^2 + 2 a d,   corner^2 = a deviation s / (1 - s),   s = sin(angle / 2)

A move is executed when the planner is full or a line stops the machine. Simulated time passes in
moves and dwells only. The code is independent of GRBL's.

The planner is the buffer of accepted moves that wait for their execution. deviation is the allowed
distance from a corner, a the acceleration, and d the length of a move.
"""

from __future__ import annotations

import math
import os
import re
import select
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from fantoccini.base import Array, Indices, StandError, Times
from fantoccini.stand.gcode_text import MAX_LINE_LENGTH, GrblSettings
from fantoccini.stand.streaming import HOLD, RESET, RESUME
from fantoccini.stand.timed_moves import DWELL

GREETING = b"\r\nGrbl 1.1h ['$' for help]\r\n"
MIN_SPEED = 1.0 / 60.0
"""Speed of the slowest move [units/s]."""

WORD_PATTERN = re.compile(r"([A-Z])([+-]?(?:\d+\.?\d*|\.\d+))")
IGNORED_TEXT = re.compile(r"\([^)]*\)|;.*|\s")
SUPPORTED_COMMANDS = {"G1", "G4", "G10", "G21", "G90", "G92", "G93", "G94", "M2", "M400"}
STRAIGHT_COSINE = 0.999999
"""|cos| of the angle of a corner above which the path counts as straight, or as reversed."""
POLL_TIMEOUT = 0.02
"""Timeout of a wait for characters, after which the stop flag is checked [s]."""


class LineRefusedError(Exception):
    """A line that the machine refuses; the argument is GRBL's error number."""


@dataclass(eq=False)
class PlannedMove:
    """A straight move.

    Attributes:
        begin: (n,) start position [steps].
        delta: (n,) displacement [steps].
        length: path length [units].
        speed: programmed speed [units/s].
        acceleration: acceleration along the path [units/s^2].
        corner_speed: upper bound of the start speed [units/s].
        start_speed: start speed [units/s].
        t: start time [s]; set when the move is executed.
        end_speed: end speed [units/s]; set when the move is executed.
    """

    begin: Indices
    delta: Indices
    length: float
    speed: float
    acceleration: float
    corner_speed: float
    start_speed: float = 0.0
    t: float = 0.0
    end_speed: float = 0.0

    def phases(self) -> tuple[float, float, float, float]:
        """Peak speed [units/s]; durations of acceleration, cruise and deceleration [s]."""
        a, d, v0, v1 = self.acceleration, self.length, self.start_speed, self.end_speed
        peak = min(self.speed, math.sqrt(max(a * d + (v0 * v0 + v1 * v1) / 2.0, 0.0)))
        peak = max(peak, v0, v1)
        rise, fall = (peak - v0) / a, (peak - v1) / a
        cruise = (d - (peak + v0) / 2.0 * rise - (peak + v1) / 2.0 * fall) / peak
        return peak, rise, max(cruise, 0.0), fall

    def max_speed_from(self, speed: float) -> float:
        """Largest speed at one end, given the speed at the other end [units/s]."""
        return math.sqrt(speed * speed + 2.0 * self.acceleration * self.length)

    def fraction_done(self, t: Times) -> Array:
        """(T,) fraction of the path covered, at times since the start of the move [s]."""
        peak, rise, cruise, fall = self.phases()
        a = self.acceleration
        t_rise = np.clip(t, 0.0, rise)
        t_cruise = np.clip(t - rise, 0.0, cruise)
        t_fall = np.clip(t - rise - cruise, 0.0, fall)
        s = self.start_speed * t_rise + a * t_rise**2 / 2.0 + peak * t_cruise
        return np.minimum((s + peak * t_fall - a * t_fall**2 / 2.0) / self.length, 1.0)


@dataclass(eq=False)
class GrblMachine:
    """The controller and its motors.

    Attributes:
        settings: settings of the machine.
        planned: planned moves, whose speeds may still change.
        executed: the moves made so far, in order.
        time: end time of the last executed move [s].
        end_steps: (n,) end position of the last planned move [steps].
        dwell_ends: end times of dwells [s].
    """

    settings: GrblSettings
    planned: deque[PlannedMove] = field(default_factory=deque)
    executed: list[PlannedMove] = field(default_factory=list)
    time: float = 0.0
    end_steps: Indices = field(init=False)
    dwell_ends: list[float] = field(default_factory=list)
    _offset: Array = field(init=False)
    _inverse_time: bool = False  # whether F is moves per minute (G93)
    _feed: float = 0.0
    _last_direction: Array | None = None
    _last_speed: float = 0.0

    def __post_init__(self) -> None:
        n = len(self.settings.letters)
        self.end_steps, self._offset = np.zeros(n, dtype=np.int64), np.zeros(n)

    @property
    def position(self) -> Array:
        """(n,) end of the last planned move, in the axes' positions [units]."""
        return self.end_steps / self.settings.steps - self._offset

    def positions(self, times: Times) -> Array:
        """(T, n) positions of the motors at times [units]."""
        positions = np.zeros((len(times), len(self.settings.letters)), dtype=np.int64)
        begins = np.array([move.t for move in self.executed])
        indices = np.searchsorted(begins, times, side="right") - 1
        for k in np.unique(indices[indices >= 0]):
            move, in_move = self.executed[k], indices == k
            # Bresenham's algorithm: the axis with the most steps makes one at every event.
            n_events = int(np.max(np.abs(move.delta)))
            events = np.floor(move.fraction_done(times[in_move] - move.t) * n_events + 1e-6)
            ratio = np.abs(move.delta) / n_events
            steps = np.floor(events[:, None] * ratio + 0.5).astype(np.int64)
            positions[in_move] = move.begin + np.sign(move.delta) * steps
        return positions / self.settings.steps - self._offset

    def answer(self, text: str) -> str:
        """Executes or plans a line of G-code; returns the controller's answer."""
        try:
            text = IGNORED_TEXT.sub("", text).upper()
            if len(text) > MAX_LINE_LENGTH:
                raise LineRefusedError(11)
            if text == "$H":
                self.finish()
            elif text.startswith("$"):
                raise LineRefusedError(3)
            elif text:
                self._interpret(text)
        except LineRefusedError as error:
            return f"error:{error.args[0]}"
        return "ok"

    def finish(self) -> None:
        """Executes all planned moves; the machine is then at rest."""
        while self.planned:
            self._execute_next()
        self._last_direction, self._last_speed = None, 0.0

    def reset(self) -> None:
        """Drops the waiting moves and resets all modes; the machine stays where it is."""
        if self.planned:
            self.end_steps = self.planned[0].begin
        self.planned.clear()
        self.finish()
        self._inverse_time, self._feed = False, 0.0

    def _interpret(self, text: str) -> None:
        """Executes or plans a line of G-code words."""
        words, unknown_text = WORD_PATTERN.findall(text), WORD_PATTERN.sub("", text)
        if unknown_text:
            raise LineRefusedError(2 if unknown_text[0].isalpha() else 1)
        commands = {f"{letter}{float(value):g}" for letter, value in words if letter in "GM"}
        values = {letter: float(value) for letter, value in words if letter not in "GM"}
        if commands - SUPPORTED_COMMANDS:
            raise LineRefusedError(20)
        if len(commands) + len(values) < len(words):
            raise LineRefusedError(25)
        if commands & {"G93", "G94"}:
            self._inverse_time = "G93" in commands
        letters = enumerate(self.settings.letters)
        target = {k: values.pop(a) for k, a in letters if a in values}
        # In G93, F applies to its own line only.
        feed = values.pop("F", 0.0 if self._inverse_time else self._feed)
        self._feed = self._feed if self._inverse_time else feed
        if "G4" in commands:
            if "P" not in values:
                raise LineRefusedError(2)
            self.finish()
            self.time += math.ceil(values.pop("P") / DWELL - 1e-9) * DWELL
            self.dwell_ends.append(self.time)
        elif commands & {"G10", "G92"}:
            if "G10" in commands and (values.pop("L", 0.0), values.pop("P", 0.0)) != (20.0, 1.0):
                raise LineRefusedError(20)
            if not target:
                raise LineRefusedError(26)
            self.finish()
            for k, value in target.items():  # the present position gets this value
                self._offset[k] = self.end_steps[k] / self.settings.steps[k] - value
        elif target:
            self._move(target, feed / 60.0)
        if values:
            raise LineRefusedError(36)
        if commands & {"M2", "M400"}:
            self.finish()

    def _move(self, target: dict[int, float], rate: float) -> None:
        """Plans a move at a rate [units/s, or moves per second with G93]."""
        settings = self.settings
        if not rate > 0.0:
            raise LineRefusedError(22)
        position = self.position
        position[list(target)] = list(target.values())
        steps = np.rint((position + self._offset) * settings.steps).astype(np.int64)
        delta = steps - self.end_steps
        if not np.any(delta):
            return  # shorter than a step
        length = float(np.linalg.norm(delta / settings.steps))
        direction = delta / settings.steps / length
        is_moving = direction != 0.0
        components = np.abs(direction[is_moving])
        speed = min(
            rate * length if self._inverse_time else rate,
            float(np.min(settings.rate[is_moving] / components)),
        )
        speed = max(speed, MIN_SPEED)
        corner_speed = min(self._corner_speed(direction), self._last_speed, speed)
        acceleration = float(np.min(settings.acceleration[is_moving] / components))
        move = PlannedMove(self.end_steps, delta, length, speed, acceleration, corner_speed)
        self.planned.append(move)
        self.end_steps, self._last_direction, self._last_speed = steps, direction, speed
        self._set_start_speeds()
        while len(self.planned) >= settings.planner:
            self._execute_next()

    def _corner_speed(self, direction: Array) -> float:
        """Largest speed at the corner between the last move and this direction [units/s]."""
        if self._last_direction is None:
            return 0.0
        cosine = -float(np.dot(self._last_direction, direction))
        if cosine > STRAIGHT_COSINE:
            return 0.0
        if cosine < -STRAIGHT_COSINE:
            return math.inf
        change = direction - self._last_direction
        components = np.abs(change / np.linalg.norm(change))
        is_changing = components > 0.0
        a = float(np.min(self.settings.acceleration[is_changing] / components[is_changing]))
        s = math.sqrt((1.0 - cosine) / 2.0)
        return math.sqrt(a * self.settings.junction * s / (1.0 - s))

    def _set_start_speeds(self) -> None:
        """Sets the start speeds of the waiting moves, except that of the first."""
        moves, end_speed = list(self.planned), 0.0
        for move in moves[:0:-1]:
            end_speed = min(move.corner_speed, move.max_speed_from(end_speed))
            move.start_speed = end_speed
        for previous, move in pairwise(moves):
            move.start_speed = min(move.start_speed, previous.max_speed_from(previous.start_speed))

    def _execute_next(self) -> None:
        move = self.planned.popleft()
        move.t, move.end_speed = self.time, self.planned[0].start_speed if self.planned else 0.0
        self.time += sum(move.phases()[1:])
        self.executed.append(move)


def start_waits(machines: Sequence[GrblMachine]) -> list[float]:
    """Time that each machine waits for a common start, after its first dwell [s]."""
    begins = [machine.dwell_ends[0] if machine.dwell_ends else 0.0 for machine in machines]
    return [max(begins) - begin for begin in begins]


def positions_together(machines: Sequence[GrblMachine], times: Times) -> Array:
    """(T, n) positions of the motors of all machines, after a common start [units]."""
    series = []
    for machine, wait in zip(machines, start_waits(machines), strict=True):
        begin = machine.dwell_ends[0] if machine.dwell_ends else 0.0
        machine_times = np.where(times < begin + wait, np.minimum(times, begin), times - wait)
        series.append(machine.positions(machine_times))
    return np.concatenate(series, axis=1)


class Emulator:
    """An emulated controller at the other end of a pseudo-terminal; runs in its own thread.

    Args:
        machine: executes the lines.
        pace: real time spent on each line [s]; moves take no real time.
        on_line: callback with every line and its answer.

    Attributes:
        port: name of the terminal to stream to.
        machine: the machine, with the moves executed so far.
        lines: received lines, in order.
        max_buffered: largest number of characters in the buffer.
        overrun: number of characters lost to a full buffer.
        held: whether a feed hold is active.
        resets: number of resets.
    """

    def __init__(
        self,
        machine: GrblMachine,
        pace: float = 0.0,
        on_line: Callable[[str, str], None] | None = None,
    ):
        if sys.platform == "win32":
            raise StandError("the emulator needs pseudo-terminals, which Windows lacks")
        import tty

        self.machine, self.pace, self.on_line = machine, pace, on_line
        self.lines: list[str] = []
        self.max_buffered = self.overrun = self.resets = 0
        self.held = False
        self._received = bytearray()
        self._stop = threading.Event()
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> Emulator:
        self._thread.start()
        os.write(self._master, GREETING)
        return self

    def __exit__(self, *_: object) -> None:
        self.unplug()
        self._thread.join()

    def unplug(self) -> None:
        """Ends the connection soon, as a pulled plug does."""
        self._stop.set()

    def wait_until_read(self) -> None:
        """Waits until all its answers have been read, at most five seconds."""
        import fcntl
        import termios

        end = time.monotonic() + 5.0
        while time.monotonic() < end and any(fcntl.ioctl(self._slave, termios.FIONREAD, bytes(4))):
            time.sleep(POLL_TIMEOUT)

    def _serve(self) -> None:
        while not self._stop.is_set():
            wait = 0.0 if self._ready else POLL_TIMEOUT
            while select.select([self._master], [], [], wait)[0]:
                wait = 0.0  # read all waiting characters before the next line
                for character in os.read(self._master, 4096):
                    self._receive(bytes([character]))
            if self._ready:
                self._answer_line()
        os.close(self._slave)
        os.close(self._master)

    @property
    def _ready(self) -> bool:
        """Whether a complete line is waiting and no hold is active."""
        return b"\n" in self._received and not self.held

    def _receive(self, character: bytes) -> None:
        """Executes a one-character command; other characters go into the buffer, unless full."""
        if character == RESET:
            self._received.clear()
            self.machine.reset()
            self.held = False
            self.resets += 1
            os.write(self._master, GREETING)
        elif character in (HOLD, RESUME):
            self.held = character == HOLD
        elif len(self._received) >= self.machine.settings.buffer:
            self.overrun += 1
        else:
            self._received += character
            self.max_buffered = max(self.max_buffered, len(self._received))

    def _answer_line(self) -> None:
        end = self._received.index(b"\n")
        text = self._received[:end].decode("ascii", "replace").strip("\r")
        time.sleep(self.pace)
        answer = self.machine.answer(text)
        del self._received[: end + 1]
        self.lines.append(text)
        os.write(self._master, f"{answer}\r\n".encode())
        if self.on_line is not None:
            self.on_line(text, answer)
