"""Open Sound Control: a show is directed by messages, and tells what happens by others.

Messages come and go by UDP. python-osc is loaded when it is first needed.
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
    MissingLibraryError,
    StateError,
    socket_at,
    socket_to,
)
from fantoccini.theatre.perform.show import LivePlay, ShowEvent

_LARGEST = 65536
"""Largest size of a datagram [bytes]."""
_PAUSE = 0.2
"""Interval at which the thread looks whether it is to end [s]."""
_ECHO = 1.0
"""Time after a cue is reported in which a message that starts it counts as an echo [s]."""
_SHOWN = 120
"""Longest text of a report on a message [characters]."""


class Address(NamedTuple):
    """Address at which messages are heard, or to which they go."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"

    @classmethod
    def of(cls, text: str) -> Address:
        """The address in a text: ``HOST:PORT``, or a port of this machine.

        Raises:
            ValueError: it is none.
        """
        host, _, port = text.rpartition(":")
        if not port.isdecimal() or not 0 <= int(port) <= 65535:
            raise ValueError(f"found {text!r}; needed: HOST:PORT, such as 127.0.0.1:53001")
        return cls(host or "127.0.0.1", int(port))


@dataclass
class Counts:
    """Counts of messages by their outcome.

    Attributes:
        heard: that were done.
        wrong: that could not be read, or are none of the show's.
        refused: that the show refused.
        echoes: that were sent by ourselves, or are taken for it.
        sent: to the outside.
        lost: that could not be sent.
        last: the last wrong or refused one, in words.
    """

    heard: int = 0
    wrong: int = 0
    refused: int = 0
    echoes: int = 0
    sent: int = 0
    lost: int = 0
    last: str = ""

    def __str__(self) -> str:
        faults = [
            f"{n} {what}"
            for n, what in (
                (self.wrong, "not understood"),
                (self.refused, "refused"),
                (self.echoes, "echoes"),
                (self.lost, "not sent"),
            )
            if n
        ]
        said = f"{self.heard} heard, {self.sent} sent"
        said += "".join(f", {fault}" for fault in faults)
        return f"{said}; {self.last}" if self.last else said


Later = Callable[[Callable[[], None]], object]
"""Has something done in the thread of the show."""


class Osc:
    """Messages from and to a show.

    In: ``/go``, ``/hold``, ``/resume``, ``/cue/N/start``, ``/cue/next``, ``/cue/repeat``,
    ``/player/NAME/take``, ``/player/NAME/give``, ``/panic``; without arguments, or with one number
    that is not 0, as buttons send it. Out: ``/cue/N/start`` and ``/cue/N/end`` with number, name
    and time of the play, ``/wait`` and ``/act`` with the name and the time. Those are no commands:
    they have more arguments.

    Attributes:
        counts: what became of messages.
        heard_at: the address of ``hear``; with the port that was free for port 0.

    Args:
        show: that is directed.
        hear: where messages are heard; None for none.
        send: where messages go; None for nowhere.
        later: has commands done in the thread of the show.

    Raises:
        MissingLibraryError: python-osc is not installed.
        StateError: an address cannot be used.
    """

    def __init__(self, show: LivePlay, hear: Address | None, send: Address | None, later: Later):
        self._show, self._send, self._later = show, send, later
        self.counts = Counts()
        self._packet, self._builder = _library()
        self._told: dict[int, float] = {}
        self._end = threading.Event()
        self._out: socket.socket | None = None
        self._in: socket.socket | None = None
        self.heard_at = hear
        try:
            if send is not None:
                self._out, self._there = socket_to(*send)
            if hear is not None:
                self._in = socket_at(*hear)
        except AddressError as error:
            self.stop()
            raise StateError(f"OSC messages: {error}") from None
        if self._out is not None:
            show.listen(self._tell)
        if self._in is not None:
            self._in.settimeout(_PAUSE)
            self.heard_at = Address(*self._in.getsockname()[:2])
            self._thread = threading.Thread(target=self._listen, name="osc", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Hears and sends no more."""
        self._end.set()
        if self._in is not None:
            self._thread.join(timeout=2.0)
            self._in.close()
        if self._out is not None:
            self._out.close()

    # -- in ----------------------------------------------------------------------------------

    def _listen(self) -> None:
        assert self._in is not None
        while not self._end.is_set():
            try:
                data, _ = self._in.recvfrom(_LARGEST)
            except TimeoutError:
                continue
            except OSError:
                continue  # an answer of the network to what was sent
            self._read(data)

    def _read(self, data: bytes) -> None:
        try:
            found = [timed.message for timed in self._packet(data).messages]
        except Exception as error:  # python-osc raises more than its own on broken datagrams
            self._wrong(f"{len(data)} bytes: {error or type(error).__name__}")
            return
        for message in found:
            self._obey(str(message.address), list(message.params))

    def _obey(self, address: str, values: list[Any]) -> None:
        do = self._command(address)
        if do is None:
            self._wrong(
                f"{address}; allowed: /go, /hold, /resume, /cue/N/start, /cue/next, "
                "/cue/repeat, /player/NAME/take, /player/NAME/give, /panic"
            )
            return
        if len(values) > 1:
            self.counts.echoes += 1
            return
        if values and not isinstance(values[0], int | float):
            self._wrong(f"{address} {values[0]!r}; needed: no argument, or a number")
            return
        if values and not values[0]:
            return  # a button is released
        number = _number(address)
        if time.monotonic() - self._told.get(number, -_ECHO) < _ECHO:
            self.counts.echoes += 1
            return
        self._later(lambda: self._do(address, do))

    def _do(self, address: str, do: Callable[[], None]) -> None:
        try:
            do()
        except FantocciniError as error:
            self.counts.refused += 1
            self.counts.last = f"{address}: {error}"[:_SHOWN]
            return
        self.counts.heard += 1

    def _command(self, address: str) -> Callable[[], None] | None:
        """Request of an address; None if it has none."""
        show = self._show
        plain: dict[str, Callable[[], None]] = {
            "/go": show.go,
            "/hold": show.hold,
            "/resume": show.resume,
            "/cue/next": show.skip,
            "/cue/repeat": show.repeat,
            "/panic": show.panic,
        }
        if address in plain:
            return plain[address]
        if number := _number(address):
            return lambda: show.start(number)
        if found := re.fullmatch(r"/player/([^/]+)/(take|give)", address):
            who, what = found.groups()
            return lambda: show.take(who) if what == "take" else show.give(who)
        return None

    def _wrong(self, what: str) -> None:
        self.counts.wrong += 1
        self.counts.last = f"not understood: {what}"[:_SHOWN]

    # -- out ---------------------------------------------------------------------------------

    def _tell(self, what: ShowEvent) -> None:
        if what.number:
            address = f"/cue/{what.number}/{what.kind}"
            values: tuple[Any, ...] = (what.number, what.name, what.t)
            if what.kind == "start":
                self._told[what.number] = time.monotonic()
        else:
            address, values = f"/{what.kind}", (what.name, what.t)
        message = self._builder(address)
        for value in values:
            message.add_arg(value)
        assert self._out is not None
        try:
            self._out.sendto(message.build().dgram, self._there)
        except OSError as error:
            self.counts.lost += 1
            self.counts.last = f"not sent to {self._send}: {error.strerror}"
            return
        self.counts.sent += 1


def _number(address: str) -> int:
    """The cue of ``/cue/N/start``; 0 for other addresses."""
    found = re.fullmatch(r"/cue/([0-9]{1,6})/start", address)
    return int(found[1]) if found else 0


def _library() -> tuple[Any, Any]:
    """The classes that read datagrams and build messages."""
    try:
        from pythonosc.osc_message_builder import OscMessageBuilder
        from pythonosc.osc_packet import OscPacket
    except ImportError:
        raise MissingLibraryError("OSC", "python-osc", "osc") from None
    return OscPacket, OscMessageBuilder
