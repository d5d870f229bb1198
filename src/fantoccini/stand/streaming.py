"""Streaming of G-code to a controller, with no more unanswered characters than its buffer holds."""

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
"""Time without an answer after which a stream gives up [s]; dwells and homing take long."""
STOPPED = "stopped here"
"""Reason of a stream that was held and not resumed."""
RETURN_FEED = 600.0
"""Feed of the move to where a stream resumes [mm/min]."""
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
"""GRBL's error numbers and their meanings."""

_COMMENT = re.compile(r"\([^)]*\)|;.*")
_ERROR = re.compile(r"(error|alarm):\s*(\d+)?", re.IGNORECASE)
_WORD = re.compile(r"([A-Z])(-?[\d.]+)")
HOLD_TIME = 0.5
"""Time within which a feed hold comes to rest [s]."""
GREETING_TIME = 2.0
"""Longest wait for a controller's greeting after its port was opened [s]."""


class Port(Protocol):
    """The methods of a serial port that a stream uses."""

    def write(self, data: bytes) -> Any:
        """Sends data."""

    def readline(self) -> bytes:
        """The next line, or the part of it that arrived within a short timeout."""


@dataclass(frozen=True)
class Line:
    """A line to send.

    Attributes:
        number: line number in the file, from 1.
        text: its text, without comments and surrounding blanks.
    """

    number: int
    text: str


@dataclass
class Streamed:
    """Progress of a stream.

    Attributes:
        sent, done: number of lines sent, and of lines acknowledged.
        most: largest number of unanswered characters.
        last: number of the last acknowledged line.
    """

    sent: int = 0
    done: int = 0
    most: int = 0
    last: int = 0


def lines_of(text: str) -> list[Line]:
    """The lines of a file that are sent: without comments and empty lines."""
    lines = []
    for number, line in enumerate(text.splitlines(), 1):
        content = _COMMENT.sub("", line).strip()
        if content:
            lines.append(Line(number, content))
    return lines


def first_lost(text: str, last: int, planner: int) -> int:
    """Number of the first line that a reset may have lost, if ``last`` was acknowledged last.

    Acknowledged moves wait in the controller's planner; only a dwell guarantees that all were made.
    """
    taken = [line for line in lines_of(text) if line.number <= last]
    first = last
    for line in reversed(taken[-planner:]):
        if not line.text.startswith(("G1", "X")):
            break
        first = line.number
    return first


def resumed(text: str, first: int, feed: float = RETURN_FEED) -> list[Line]:
    """The lines from number ``first`` on, after lines that restore the controller's state.

    The controller must still know its axes' positions. The modes are set again, and the axes go
    slowly to the end of the previous line. Homing and set positions are not repeated.

    Args:
        text: text of the file.
        first: number of the first line to send.
        feed: feed of the move to the end of the previous line [mm/min].

    Raises:
        StandError: there is no such line.
    """
    lines = lines_of(text)
    rest = [line for line in lines if line.number >= first]
    if not rest:
        raise StandError(f"there is no line {first} to go on from; the last is {lines[-1].number}")
    positions: dict[str, str] = {}
    mode = "G94"
    for line in lines:
        if line.number >= first:
            break
        if line.text in ("G93", "G94"):
            mode = line.text
        for letter, value in _WORD.findall(line.text) if _sets_position(line.text) else ():
            if letter in "XYZABCUVW":
                positions[letter] = value
    words = "".join(letter + value for letter, value in positions.items())
    preamble = ["G21", "G90", "G94"]
    if words:
        preamble += [f"G1{words}F{feed:g}", "G4P0.1"]
    return [*(Line(first, text) for text in [*preamble, mode]), *rest]


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
    """Sends lines, and returns when the controller has acknowledged them all.

    Args:
        port: port of the controller.
        lines: the lines.
        buffer: size of the controller's buffer, of which one stays free [characters].
        counting: whether to fill the buffer by counting characters; otherwise every line waits for
            the ``ok`` of the previous one.
        progress: callback after every acknowledged line.
        silence: longest wait for an answer [s].
        counts: object that is updated, so that it is available after an exception.
        hold: event that another thread sets to hold all motion.
        go_on: callback that decides, during a hold, whether to go on.

    Raises:
        StreamError: the controller refused a line or does not answer, or it was held and reset.
    """
    done = counts or Streamed()
    unanswered: deque[Line] = deque()
    unsent = deque(lines)
    capacity = buffer - 1
    for line in lines:
        if len(line.text) + 1 > capacity:
            raise StreamError(line.number, line.text, f"longer than the buffer of {buffer}")
    last_answer = time.monotonic()
    while unsent or unanswered:
        if hold is not None and hold.is_set():
            port.write(HOLD)
            hold.clear()
            line = unanswered[0] if unanswered else unsent[0]
            if go_on is None or not go_on(done):
                _stop(port)
                raise StreamError(line.number, line.text, STOPPED)
            port.write(RESUME)
            last_answer = time.monotonic()
        n_unanswered = sum(len(line.text) + 1 for line in unanswered)
        fits_buffer = bool(unsent) and n_unanswered + len(unsent[0].text) + 1 <= capacity
        if fits_buffer and (counting or not unanswered):
            line = unsent.popleft()
            port.write(line.text.encode("ascii", "replace") + b"\n")
            unanswered.append(line)
            done.sent += 1
            done.most = max(done.most, n_unanswered + len(line.text) + 1)
            continue
        answer = port.readline().decode("ascii", "replace").strip()
        error = _ERROR.match(answer)
        if error:
            _stop(port)
            raise StreamError(unanswered[0].number, unanswered[0].text, _reason(answer, error))
        if answer:
            last_answer = time.monotonic()
        elif time.monotonic() - last_answer > silence:
            _stop(port)
            text = f"no answer in {silence:g} s"
            raise StreamError(unanswered[0].number, unanswered[0].text, text)
        if answer.lower() == "ok" or answer.lower().startswith("ok "):
            line = unanswered.popleft()
            done.done, done.last = done.done + 1, line.number
            if progress is not None:
                progress(Progress(done=done.done, total=len(lines)))
    return done


@contextmanager
def serial_port(name: str, baud: int) -> Iterator[Port]:
    """An open serial port, after the controller's greeting.

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
        end = time.monotonic() + GREETING_TIME
        while time.monotonic() < end:
            if b"grbl" in port.readline().lower():
                break
        yield port


def _sets_position(text: str) -> bool:
    return text.startswith(("G1", "G0", "X", "G92")) or text.startswith("G10L20P1")


def _stop(port: Port) -> None:
    """Stops by a feed hold and then a reset, which keeps positions because nothing moves."""
    port.write(HOLD)
    time.sleep(HOLD_TIME)
    port.write(RESET)


def _reason(answer: str, error: re.Match[str]) -> str:
    number = int(error[2]) if error[2] else None
    meaning = ERRORS.get(number or 0) if error[1].lower() == "error" else None
    return f"{answer}, {meaning}" if meaning else answer
