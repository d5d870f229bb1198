"""Streaming G-code to a controller: no more characters under way than its buffer holds."""

from __future__ import annotations

import re
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

from fantoccini.base import MissingLibraryError, OnProgress, Progress, StandError, StreamError

HOLD, RESUME, RESET = b"!", b"~", b"\x18"
SILENCE = 30.0
"""Time without an answer after which a controller is given up [s]; dwells and homing are waits."""
STOPPED = "stopped here"
"""Why a stream ended, after a hold."""
GENTLE_FEED = 600.0
"""With which the axes go where a stream goes on [mm/min]."""
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

_COMMENT = re.compile(r"\([^)]*\)|;.*")
_ERROR = re.compile(r"(error|alarm):\s*(\d+)?", re.IGNORECASE)
_WORD = re.compile(r"([A-Z])(-?[\d.]+)")
_STOPS = 0.5
"""Time in which a feed hold comes to rest [s]."""
_WAKE = 2.0
"""Time in which a controller greets after its port was opened [s]."""


class Port(Protocol):
    """What a serial port is to a stream."""

    def write(self, data: bytes) -> Any:
        """Sends."""

    def readline(self) -> bytes:
        """The next line; what there is of it after a short wait."""


@dataclass(frozen=True)
class Line:
    """A line to send.

    Attributes:
        number: in the file, from 1.
        text: of it, without comments and blanks at its ends.
    """

    number: int
    text: str


@dataclass
class Streamed:
    """How far a stream is.

    Attributes:
        sent, done: lines sent, and lines that the controller took.
        most: most characters that were under way.
        last: number of the last line that it took.
    """

    sent: int = 0
    done: int = 0
    most: int = 0
    last: int = 0


def lines_of(text: str) -> list[Line]:
    """The lines of a file that are to be sent."""
    found = []
    for number, line in enumerate(text.splitlines(), 1):
        bare = _COMMENT.sub("", line).strip()
        if bare:
            found.append(Line(number, bare))
    return found


def first_lost(text: str, last: int, planner: int) -> int:
    """Number of the first line that a reset may have lost, where line ``last`` was taken.

    Moves that were taken wait in the controller's planner, until a dwell lets it make them all.
    """
    lines = [line for line in lines_of(text) if line.number <= last]
    first = last
    for line in reversed(lines[-planner:]):
        if not line.text.startswith(("G1", "X")):
            break
        first = line.number
    return first


def resumed(text: str, first: int, feed: float = GENTLE_FEED) -> list[Line]:
    """The lines from number ``first`` on, with what they need of those before.

    The controller must still know where its axes are. They go gently to where the line before left
    them. Its modes are set; homing and what calls positions by others are not repeated.

    Args:
        text: of the file.
        first: number of the line.
        feed: with which the axes go there [mm/min].

    Raises:
        StandError: there is no such line.
    """
    lines = lines_of(text)
    rest = [line for line in lines if line.number >= first]
    if not rest:
        raise StandError(f"there is no line {first} to go on from; the last is {lines[-1].number}")
    at: dict[str, str] = {}
    mode = "G94"
    for line in lines:
        if line.number >= first:
            break
        if line.text in ("G93", "G94"):
            mode = line.text
        for letter, value in _WORD.findall(line.text) if _positions(line.text) else ():
            if letter in "XYZABCUVW":
                at[letter] = value
    words = "".join(letter + value for letter, value in at.items())
    begin = ["G21", "G90", "G94"]
    if words:
        begin += [f"G1{words}F{feed:g}", "G4P0.1"]
    return [*(Line(first, text) for text in [*begin, mode]), *rest]


def stream(
    port: Port,
    lines: Sequence[Line],
    buffer: int = 128,
    counting: bool = True,
    *,
    progress: OnProgress | None = None,
    silence: float = SILENCE,
    counts: Streamed | None = None,
    hold: threading.Event | None = None,
    go_on: Callable[[Streamed], bool] | None = None,
) -> Streamed:
    """Sends lines, and waits until the controller took them all.

    Args:
        port: of the controller.
        lines: to send.
        buffer: characters that the controller holds, one of which stays free.
        counting: whether to count characters; otherwise a line waits for the last one's ``ok``.
        progress: called when the controller took a line.
        silence: longest wait for an answer [s].
        counts: to count in, for who catches what interrupts.
        hold: set from elsewhere to hold all motion.
        go_on: then asked whether to go on or to stop.

    Raises:
        StreamError: it refused a line, or does not answer; it was held and reset.
    """
    done = counts or Streamed()
    waiting: deque[Line] = deque()
    todo = deque(lines)
    room = buffer - 1
    for line in lines:
        if len(line.text) + 1 > room:
            raise StreamError(line.number, line.text, f"longer than the buffer of {buffer}")
    heard = time.monotonic()
    while todo or waiting:
        if hold is not None and hold.is_set():
            port.write(HOLD)
            hold.clear()
            line = waiting[0] if waiting else todo[0]
            if go_on is None or not go_on(done):
                _stop(port)
                raise StreamError(line.number, line.text, STOPPED)
            port.write(RESUME)
            heard = time.monotonic()
        under_way = sum(len(line.text) + 1 for line in waiting)
        fits = bool(todo) and under_way + len(todo[0].text) + 1 <= room
        if fits and (counting or not waiting):
            line = todo.popleft()
            port.write(line.text.encode("ascii", "replace") + b"\n")
            waiting.append(line)
            done.sent += 1
            done.most = max(done.most, under_way + len(line.text) + 1)
            continue
        answer = port.readline().decode("ascii", "replace").strip()
        wrong = _ERROR.match(answer)
        if wrong:
            _stop(port)
            raise StreamError(waiting[0].number, waiting[0].text, _reason(answer, wrong))
        if answer:
            heard = time.monotonic()
        elif time.monotonic() - heard > silence:
            _stop(port)
            text = f"no answer in {silence:g} s"
            raise StreamError(waiting[0].number, waiting[0].text, text)
        if answer.lower() == "ok" or answer.lower().startswith("ok "):
            line = waiting.popleft()
            done.done, done.last = done.done + 1, line.number
            if progress is not None:
                progress(Progress(done=done.done, total=len(lines)))
    return done


@contextmanager
def serial_port(name: str, baud: int) -> Iterator[Port]:
    """A serial port; what the controller says when it wakes is read.

    Raises:
        MissingLibraryError: pyserial is not installed.
        StandError: it cannot be opened.
    """
    try:
        import serial
    except ImportError:
        raise MissingLibraryError("streaming", "pyserial", "serial") from None
    try:
        port = serial.Serial(name, baud, timeout=0.1, write_timeout=SILENCE)
    except (OSError, ValueError) as error:  # serial.SerialException is an OSError
        raise StandError(f"cannot open {name}: {error}") from None
    with port:
        end = time.monotonic() + _WAKE
        while time.monotonic() < end:
            if b"grbl" in port.readline().lower():
                break
        yield port


def _positions(text: str) -> bool:
    return text.startswith(("G1", "G0", "X", "G92")) or text.startswith("G10L20P1")


def _stop(port: Port) -> None:
    """Feed hold, then a reset, which keeps positions where nothing moves any more."""
    port.write(HOLD)
    time.sleep(_STOPS)
    port.write(RESET)


def _reason(answer: str, wrong: re.Match[str]) -> str:
    number = int(wrong[2]) if wrong[2] else None
    known = ERRORS.get(number or 0) if wrong[1].lower() == "error" else None
    return f"{answer}, {known}" if known else answer
