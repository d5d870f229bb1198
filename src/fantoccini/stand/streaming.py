"""Streaming of G-code to controllers, without overfilling their buffers.

The characters of unanswered lines never exceed the size of a controller's buffer. Several
controllers begin their motions together, after the moves that precede these; then each runs by its
own clock.

A line is a line of G-code, which the controller acknowledges when it has accepted it. A hold is a
stop that can be resumed.
"""

from __future__ import annotations

import os
import re
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Protocol

from fantoccini.base import MissingLibraryError, OnProgress, Progress, StandError, StreamError

HOLD, RESUME, RESET = b"!", b"~", b"\x18"
"""GRBL's one-character commands."""
MAX_SILENCE = 30.0
"""Longest wait for an answer [s], in addition to the duration of moves that precede it."""
STOPPED = "stopped here"
"""Reason of the error when a hold is not followed by a resume."""
GRBL_ERRORS = {
    1: "a word does not begin with a letter",
    2: "a number is missing or wrong",
    3: "this $ command is not known",
    9: "locked: home ($H) or unlock ($X) first",
    11: "the line is too long",
    15: "the target is outside of the machine's travel",
    20: "this command is not known",
    22: "no feed rate was given",
    25: "a word occurs twice",
    26: "no axis is named",
    36: "a word is not used by this command",
}
"""GRBL's error numbers and their meanings."""

_COMMENT = re.compile(r"\([^)]*\)|;.*")
_ERROR = re.compile(r"(error|alarm):\s*(\d+)?", re.IGNORECASE)
_RESTART = re.compile(r"grbl\w* |\[MSG:INFO: FluidNC|marlin |start$|rst:0x|ets ", re.IGNORECASE)
"""Beginnings of the greetings of GRBL, FluidNC, Marlin and the loader of an ESP32 after a reset."""
POLL_INTERVAL = 1e-3
"""Interval at which silent controllers are checked for answers [s]."""
HOLD_TIME = 0.5
"""Time in which the axes come to rest after a feed hold [s]."""
GREETING_TIME = 2.0
"""Longest wait for a controller's greeting after its port was opened [s]."""


class Port(Protocol):
    """Methods of a serial port that a stream uses; a lost connection raises an OSError."""

    def write(self, data: bytes) -> Any:
        """Sends data."""

    @property
    def in_waiting(self) -> int:
        """Number of characters that have arrived."""

    def read(self, size: int) -> bytes:
        """The next characters."""


@dataclass(frozen=True)
class Line:
    """A line to send.

    Attributes:
        number: line number in the file, from 1.
        text: text of the line, without comments and surrounding spaces.
    """

    number: int
    text: str


@dataclass
class StreamCounts:
    """Progress of a stream.

    Attributes:
        sent, acknowledged: number of lines sent, and of lines acknowledged.
        max_unanswered: largest number of unanswered characters.
        last_line: number of the last acknowledged line.
    """

    sent: int = 0
    acknowledged: int = 0
    max_unanswered: int = 0
    last_line: int = 0


def gcode_lines(text: str) -> list[Line]:
    """The lines of a file that are sent: without comments and empty lines."""
    lines = []
    for number, line in enumerate(text.splitlines(), 1):
        content = _COMMENT.sub("", line).strip()
        if content:
            lines.append(Line(number, content))
    return lines


class Channel:
    """Connection to a controller, with the lines to send to it.

    Args:
        port: port of the controller.
        lines: the lines.
        buffer: size of the controller's buffer [characters]; one character stays free.
        counting: whether to send lines ahead, counting the characters in the buffer; otherwise
            every line waits for the ``ok`` of the previous one.
        name: name of the controller, if there are several.
        start: number of the first line that waits until all controllers have reached theirs; None
            if no line waits.

    Attributes:
        counts: lines sent and acknowledged.
        last_answer_time: time of the last answer, or of the last line after a pause [s].

    Raises:
        StreamError: a line is longer than the buffer.
    """

    def __init__(
        self,
        port: Port,
        lines: Sequence[Line],
        buffer: int = 128,
        counting: bool = True,
        *,
        name: str = "",
        start: int | None = None,
        counts: StreamCounts | None = None,
    ):
        self.port, self.name, self.counts = port, name, counts or StreamCounts()
        self.n_lines, self.last_answer_time = len(lines), time.monotonic()
        self._counting, self._start, self._capacity = counting, start, buffer - 1
        self._unsent, self._unanswered = deque(lines), deque[Line]()
        self._received = b""
        for line in lines:
            if len(line.text) + 1 > self._capacity:
                text = f"longer than the buffer of {buffer}"
                raise StreamError(line.number, line.text, text, name)

    @property
    def ended(self) -> bool:
        """Whether all lines are acknowledged."""
        return not self._unsent and not self._unanswered

    @property
    def is_waiting(self) -> bool:
        """Whether the next line waits for the other controllers."""
        if self._start is None or self._unanswered:
            return False
        return bool(self._unsent) and self._unsent[0].number >= self._start

    def send(self, started: bool) -> bool:
        """Sends the next line if the buffer has room for it; returns whether it was sent."""
        if not self._unsent or (self._unanswered and not self._counting):
            return False
        line = self._unsent[0]
        if not started and self._start is not None and line.number >= self._start:
            return False
        n_unanswered = sum(len(line.text) + 1 for line in self._unanswered) + len(line.text) + 1
        if n_unanswered > self._capacity:
            return False
        if not self._unanswered:
            self.last_answer_time = time.monotonic()
        self.write(line.text.encode("ascii", "replace") + b"\n")
        self._unanswered.append(self._unsent.popleft())
        self.counts.sent += 1
        self.counts.max_unanswered = max(self.counts.max_unanswered, n_unanswered)
        return True

    def read_answers(self) -> bool:
        """Reads the answers that have arrived; returns whether there were any.

        Raises:
            StreamError: the controller refused a line or restarted, or the connection is lost.
        """
        try:
            self._received += self.port.read(self.port.in_waiting)
        except OSError as error:
            raise self.connection_error(error) from None
        *answers, self._received = self._received.split(b"\n")
        for answer in answers:
            self._handle_answer(answer.decode("ascii", "replace").strip())
        return bool(answers)

    def write(self, data: bytes) -> None:
        """Sends data.

        Raises:
            StreamError: the connection is lost.
        """
        try:
            self.port.write(data)
        except OSError as error:
            raise self.connection_error(error) from None

    def check_silence(self, silence: float) -> None:
        """Raises a StreamError if an answer is missing for longer than ``silence`` [s]."""
        if self._unanswered and time.monotonic() - self.last_answer_time > silence:
            raise self.error(f"no answer in {silence:.3g} s")

    def error(self, reason: str) -> StreamError:
        """An error at the first line that is not acknowledged."""
        line = (self._unanswered or self._unsent or [Line(self.counts.last_line, "")])[0]
        return StreamError(line.number, line.text, reason, self.name)

    def connection_error(self, error: OSError) -> StreamError:
        """The error of a lost connection."""
        return self.error(f"the connection is lost: {error.strerror or error}")

    def _handle_answer(self, answer: str) -> None:
        if answer:
            self.last_answer_time = time.monotonic()
        error = _ERROR.match(answer)
        if error:
            raise self.error(_error_text(answer, error))
        # A late greeting, before the first answer, does not mean a restart.
        if self.counts.acknowledged and _RESTART.match(answer):
            raise self.error(f"the controller restarted and dropped its lines ({answer})")
        if self._unanswered and (answer.lower() == "ok" or answer.lower().startswith("ok ")):
            line = self._unanswered.popleft()
            self.counts.acknowledged, self.counts.last_line = (
                self.counts.acknowledged + 1,
                line.number,
            )


def stream(
    port: Port,
    lines: Sequence[Line],
    buffer: int = 128,
    counting: bool = True,
    *,
    progress: OnProgress | None = None,
    silence: float = MAX_SILENCE,
    counts: StreamCounts | None = None,
    hold: threading.Event | None = None,
    should_resume: Callable[[StreamCounts], bool] | None = None,
) -> StreamCounts:
    """Sends lines, and returns when the controller has acknowledged them all.

    Args:
        port, lines, buffer, counting: see :class:`Channel`.
        progress, silence, hold: see :func:`stream_together`.
        counts: object that is updated, so that it is available after an exception.
        should_resume: callback that decides, during a hold, whether to resume.

    Raises:
        StreamError: the controller refused a line, restarted or does not answer, the connection is
            lost, or it was held and reset.
    """
    channel = Channel(port, lines, buffer, counting, counts=counts)
    resumes = None if should_resume is None else lambda: should_resume(channel.counts)
    stream_together([channel], progress=progress, silence=silence, hold=hold, should_resume=resumes)
    return channel.counts


def stream_together(
    channels: Sequence[Channel],
    *,
    progress: OnProgress | None = None,
    silence: float = MAX_SILENCE,
    hold: threading.Event | None = None,
    should_resume: Callable[[], bool] | None = None,
) -> None:
    """Sends lines to several controllers, and returns when they have acknowledged them all.

    After an error of one controller, all are stopped.

    Args:
        channels: the controllers with their lines.
        progress: callback after every acknowledged line.
        silence: longest wait for an answer [s]; for lines of a :class:`Program` at least its
            ``max_wait`` and a reserve.
        hold: event that another thread sets to hold all motion.
        should_resume: callback that decides, during a hold, whether to resume.

    Raises:
        StreamError: see :func:`stream`.
    """
    try:
        _send_all(channels, progress, silence, hold or threading.Event(), should_resume)
    except StreamError:
        _stop(channels)
        raise


def _send_all(
    channels: Sequence[Channel],
    progress: OnProgress | None,
    silence: float,
    hold: threading.Event,
    should_resume: Callable[[], bool] | None,
) -> None:
    """Sends all lines; raises a StreamError without stopping the controllers."""
    total, n_done, started = sum(channel.n_lines for channel in channels), 0, False
    while not all(channel.ended for channel in channels):
        if hold.is_set():
            hold.clear()
            _hold(channels, should_resume)
        started = started or all(channel.is_waiting or channel.ended for channel in channels)
        progressed = [channel.send(started) for channel in channels]
        progressed += [channel.read_answers() for channel in channels]
        if not any(progressed):
            time.sleep(POLL_INTERVAL)
        for channel in channels:
            channel.check_silence(silence)
        acknowledged = sum(channel.counts.acknowledged for channel in channels)
        if progress is not None:
            for count in range(n_done + 1, acknowledged + 1):
                progress(Progress(done=count, total=total))
        n_done = acknowledged


def _hold(channels: Sequence[Channel], should_resume: Callable[[], bool] | None) -> None:
    """Holds all controllers until ``should_resume`` is true; raises a StreamError otherwise."""
    for channel in channels:
        channel.write(HOLD)
    if should_resume is None or not should_resume():
        for channel in channels:
            channel.read_answers()  # answers that arrived during the hold
        raise next(channel for channel in channels if not channel.ended).error(STOPPED)
    for channel in channels:
        channel.write(RESUME)
        channel.last_answer_time = time.monotonic()


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
        port = serial.Serial(name, baud, timeout=0.1, write_timeout=MAX_SILENCE)
    except (OSError, ValueError) as error:  # serial.SerialException is an OSError
        code = getattr(error, "errno", None)  # pyserial repeats name and code in its text
        raise StandError(f"cannot open {name}: {os.strerror(code) if code else error}") from None
    with port:
        end = time.monotonic() + GREETING_TIME
        while time.monotonic() < end:
            if b"grbl" in port.readline().lower():
                break
        yield port


def _stop(channels: Sequence[Channel]) -> None:
    """Stops by a feed hold and then a reset, which keeps positions because nothing moves."""
    for command, pause in ((HOLD, HOLD_TIME), (RESET, 0.0)):
        for channel in channels:
            with suppress(OSError):  # of a lost connection
                channel.port.write(command)
        time.sleep(pause)


def _error_text(answer: str, error: re.Match[str]) -> str:
    number = int(error[2]) if error[2] else None
    meaning = GRBL_ERRORS.get(number or 0) if error[1].lower() == "error" else None
    return f"{answer}, {meaning}" if meaning else answer
