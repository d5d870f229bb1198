"""Open Sound Control: messages that direct a show, and messages that report its events.

Messages are sent and received by UDP. python-osc is loaded when it is first needed.

A cue is a line of a play: a verb with its player and time.
"""

from __future__ import annotations

import re
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from fantoccini.base import (
    AddressError,
    FantocciniError,
    StateError,
    osc_library,
    socket_at,
    socket_to,
)
from fantoccini.theatre.perform.show import LivePlay, ShowEvent

_MAX_DATAGRAM_SIZE = 65536
"""Largest size of a datagram [bytes]."""
_POLL_INTERVAL = 0.2
"""Interval at which the thread checks whether it should end [s]."""
_ECHO_TIME = 1.0
"""Time after a cue is reported in which a message that starts it counts as an echo [s]."""
_MAX_REPORT_LENGTH = 120
"""Largest length of a report on a message [characters]."""
MAX_WAITING = 100
"""Largest number of commands that wait for the show; further ones are refused."""


class Address(NamedTuple):
    """Address at which messages are received, or to which they are sent."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"

    @classmethod
    def parse(cls, text: str) -> Address:
        """Address in a text: ``HOST:PORT``, or a port of this machine.

        Raises:
            ValueError: the text is not an address.
        """
        host, _, port = text.rpartition(":")
        if not port.isdecimal() or not 0 <= int(port) <= 65535:
            raise ValueError(f"found {text!r}; needed: HOST:PORT, such as 127.0.0.1:53001")
        return cls(host or "127.0.0.1", int(port))


@dataclass
class Counts:
    """Numbers of messages by outcome.

    Attributes:
        heard: number of messages that were executed.
        wrong: number of messages that could not be read, or are not commands of the show.
        refused: number of messages that the show refused.
        echoes: number of messages that came from this program, or probably did.
        sent: number of messages that were sent.
        lost: number of messages that could not be sent.
        last_fault: the last message that was wrong, refused or lost, in words.
    """

    heard: int = 0
    wrong: int = 0
    refused: int = 0
    echoes: int = 0
    sent: int = 0
    lost: int = 0
    last_fault: str = ""

    def __str__(self) -> str:
        faults = [
            f"{n} {outcome}"
            for n, outcome in (
                (self.wrong, "not understood"),
                (self.refused, "refused"),
                (self.echoes, "echoes"),
                (self.lost, "not sent"),
            )
            if n
        ]
        text = f"{self.heard} heard, {self.sent} sent"
        text += "".join(f", {fault}" for fault in faults)
        return f"{text}; {self.last_fault}" if self.last_fault else text


RunLater = Callable[[Callable[[], None]], object]
"""Executes a function in the thread of the show."""


class Osc:
    """Messages to and from a show.

    Commands: ``/go``, ``/hold``, ``/resume``, ``/cue/N/start``, ``/cue/next``, ``/cue/repeat``,
    ``/player/NAME/take``, ``/player/NAME/give``, ``/panic``. They have no arguments, or one number
    other than 0, as buttons send it. Reports: ``/cue/N/start`` and ``/cue/N/end`` with number, name
    and time in the play, ``/wait`` and ``/act`` with name and time. Reports are not executed as
    commands, because they have more arguments.

    Attributes:
        counts: numbers of messages by outcome.
        heard_at: address of ``hear``, with the assigned port if it was 0.

    Args:
        show: show that is directed.
        hear: address at which messages are received; None for no messages.
        send: address to which messages are sent; None for no messages.
        run_later: executes commands in the thread of the show.

    Raises:
        MissingLibraryError: python-osc is not installed.
        StateError: an address cannot be used.
    """

    def __init__(
        self, show: LivePlay, hear: Address | None, send: Address | None, run_later: RunLater
    ):
        self._show, self._send, self._run_later = show, send, run_later
        self.counts = Counts()
        self._library = osc_library()
        self._report_times: dict[int, float] = {}
        self._free_slots = threading.BoundedSemaphore(MAX_WAITING)
        self._stop_event = threading.Event()
        self._out_socket: socket.socket | None = None
        self._in_socket: socket.socket | None = None
        self.heard_at = hear
        try:
            if send is not None:
                self._out_socket, self._destination = socket_to(*send)
            if hear is not None:
                self._in_socket = socket_at(*hear)
        except AddressError as error:
            self.stop()
            raise StateError(f"OSC messages: {error}") from None
        if self._out_socket is not None:
            show.listen(self._report)
        if self._in_socket is not None:
            self._in_socket.settimeout(_POLL_INTERVAL)
            self.heard_at = Address(*self._in_socket.getsockname()[:2])
            self._thread = threading.Thread(target=self._listen, name="osc", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Ends receiving and sending."""
        self._stop_event.set()
        if self._in_socket is not None:
            self._thread.join(timeout=2.0)
            self._in_socket.close()
        if self._out_socket is not None:
            self._out_socket.close()

    # -- in ----------------------------------------------------------------------------------

    def _listen(self) -> None:
        assert self._in_socket is not None
        while not self._stop_event.is_set():
            try:
                data, _ = self._in_socket.recvfrom(_MAX_DATAGRAM_SIZE)
            except TimeoutError:
                continue
            except OSError:
                continue  # an answer of the network to a message that was sent
            self._handle_datagram(data)

    def _handle_datagram(self, data: bytes) -> None:
        try:
            messages = [timed.message for timed in self._library.Packet(data).messages]
        except Exception as error:  # python-osc raises more than its own on broken datagrams
            self._note_wrong(f"{len(data)} bytes: {error or type(error).__name__}")
            return
        for message in messages:
            self._handle_message(str(message.address), list(message.params))

    def _handle_message(self, address: str, values: list[Any]) -> None:
        """Executes a message as a command, unless it is wrong, refused or an echo."""
        command = self._command(address)
        if command is None:
            self._note_wrong(
                f"{address}; allowed: /go, /hold, /resume, /cue/N/start, /cue/next, "
                "/cue/repeat, /player/NAME/take, /player/NAME/give, /panic"
            )
            return
        if len(values) > 1:
            self.counts.echoes += 1
            return
        if values and not isinstance(values[0], int | float):
            self._note_wrong(f"{address} {values[0]!r}; needed: no argument, or a number")
            return
        if values and not values[0]:
            return  # a button was released
        number = _number(address)
        if time.monotonic() - self._report_times.get(number, -_ECHO_TIME) < _ECHO_TIME:
            self.counts.echoes += 1
            return
        if self._free_slots.acquire(blocking=False):
            self._run_later(lambda: self._run_command(address, command))
        else:
            self._note_refused(address, f"{MAX_WAITING} commands wait already")

    def _run_command(self, address: str, command: Callable[[], None]) -> None:
        self._free_slots.release()
        try:
            command()
        except FantocciniError as error:
            self._note_refused(address, str(error))
            return
        self.counts.heard += 1

    def _note_refused(self, address: str, reason: str) -> None:
        self.counts.refused += 1
        self.counts.last_fault = f"{address}: {reason}"[:_MAX_REPORT_LENGTH]

    def _command(self, address: str) -> Callable[[], None] | None:
        """Command of an address; None for unknown addresses."""
        show = self._show
        commands: dict[str, Callable[[], None]] = {
            "/go": show.go,
            "/hold": show.hold,
            "/resume": show.resume,
            "/cue/next": show.skip,
            "/cue/repeat": show.repeat,
            "/panic": show.panic,
        }
        if address in commands:
            return commands[address]
        if number := _number(address):
            return lambda: show.start(number)
        if match := re.fullmatch(r"/player/([^/]+)/(take|give)", address):
            who, action = match.groups()
            return lambda: show.take(who) if action == "take" else show.give(who)
        return None

    def _note_wrong(self, text: str) -> None:
        self.counts.wrong += 1
        self.counts.last_fault = f"not understood: {text}"[:_MAX_REPORT_LENGTH]

    # -- out ---------------------------------------------------------------------------------

    def _report(self, event: ShowEvent) -> None:
        if event.number:
            address = f"/cue/{event.number}/{event.kind}"
            values: tuple[Any, ...] = (event.number, event.name, event.t)
            if event.kind == "start":
                self._report_times[event.number] = time.monotonic()
        else:
            address, values = f"/{event.kind}", (event.name, event.t)
        message = self._library.MessageBuilder(address)
        for value in values:
            message.add_arg(value)
        assert self._out_socket is not None
        try:
            self._out_socket.sendto(message.build().dgram, self._destination)
        except OSError as error:
            self.counts.lost += 1
            self.counts.last_fault = f"not sent to {self._send}: {error.strerror}"
            return
        self.counts.sent += 1


def _number(address: str) -> int:
    """Number of the cue in ``/cue/N/start``; 0 for other addresses."""
    match = re.fullmatch(r"/cue/([0-9]{1,6})/start", address)
    return int(match[1]) if match else 0
