"""Emulated stand that receives packets over a network and moves its motors.

A packet contains the position of every axis, a motor of the stand.
"""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np

from fantoccini.base import AddressError, Array, StandError, Times, osc_library, socket_at
from fantoccini.stand.axes import axes_of
from fantoccini.stand.controllers import ArtNet, Osc
from fantoccini.stand.gcode_words import gcode_units
from fantoccini.stand.packets import (
    DMX_HEADER,
    DMX_OPCODE,
    PACKET_HEADER,
    PROTOCOL_ID,
    ArtNetEncoder,
    dmx_channels,
    osc_addresses,
)
from fantoccini.stand.stand_file import Stand

WATCHDOG_TIMEOUT = 0.5
"""Time without packets after which the watchdog stops the motors [s]."""
MAX_DATAGRAM = 65_536
"""Largest size of a datagram [bytes]."""
STOP_CHECK_INTERVAL = 0.05
"""Interval at which the thread checks its stop flag [s]."""


class Receiver:
    """Emulated motors that move to the positions in received packets; runs in its own thread.

    Args:
        stand: the stand.
        controller: osc or artnet.
        host, port: address to listen on; the controller's by default, and a free port for 0.

    Attributes:
        address: the address it listens on.
        n_unreadable: number of packets that could not be read.
        stops: number of times the watchdog stopped the motors.

    Raises:
        StandError: it cannot listen there, or the controller does not accept packets.
        FileError: the stand's file has wrong names of axes.
        MissingLibraryError: python-osc is not installed.
    """

    def __init__(
        self, stand: Stand, controller: Any, host: str | None = None, port: int | None = None
    ):
        self._reader = _packet_reader(stand, controller)
        axes = axes_of(stand)
        self._counts, self._scale = np.array([a.counts_per_unit for a in axes]), gcode_units(axes)
        endpoint = (host or controller.host, controller.port if port is None else port)
        try:
            self._socket = socket_at(*endpoint, many=True)
        except AddressError as error:
            raise StandError(str(error)) from None
        self._socket.settimeout(STOP_CHECK_INTERVAL)
        self.address: tuple[str, int] = self._socket.getsockname()[:2]
        self.n_unreadable = self.stops = 0
        self._received: list[tuple[float, Array]] = []
        self._moving = False
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="stand", daemon=True)

    def __enter__(self) -> Receiver:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stops listening."""
        self._end.set()
        self._thread.join()
        self._socket.close()

    def __len__(self) -> int:
        return len(self._received)

    @property
    def silent(self) -> bool:
        """Whether the watchdog has stopped the motors."""
        return bool(self._received) and not self._moving

    @property
    def t(self) -> Times:
        """(T,) arrival times of the packets, from the first one on [s]."""
        return np.array([arrival - self._received[0][0] for arrival, _ in self._received])

    @property
    def steps(self) -> Array:
        """(T, n) positions received, in microsteps or counts."""
        return np.rint(np.array([p for _, p in self._received]) * self._counts)

    def positions(self, t: Times) -> Array:
        """(T, n) motor positions [mm or deg]: whole steps, linear in time between packets."""
        positions = self.steps / self._counts * self._scale
        return np.stack([np.interp(t, self.t, x) for x in positions.T], axis=-1)

    def _serve(self) -> None:
        last_packet_time = time.monotonic()
        while not self._end.is_set():
            if self._moving and time.monotonic() - last_packet_time > WATCHDOG_TIMEOUT:
                self._moving = False
                self.stops += 1
            try:
                data = self._socket.recv(MAX_DATAGRAM)
            except OSError:
                continue
            position = self._reader.position(data)
            if position is None:
                self.n_unreadable += 1
                continue
            last_packet_time = time.monotonic()
            self._received.append((last_packet_time, position))
            self._moving = True


def _packet_reader(stand: Stand, controller: Any) -> _OscReader | _ArtNetReader:
    if isinstance(controller, Osc):
        return _OscReader(osc_addresses(stand, controller))
    if isinstance(controller, ArtNet):
        return _ArtNetReader(stand, controller)
    raise StandError(
        f"{controller.type} does not accept packets; needed: --controller osc or artnet"
    )


class _OscReader:
    def __init__(self, addresses: tuple[str, ...]):
        self._library, self._addresses = osc_library(), addresses

    def position(self, data: bytes) -> Array | None:
        """(n,) positions in a packet; None if it cannot be read."""
        try:
            messages = [timed.message for timed in self._library.Packet(data).messages]
            values = {m.address: float(m.params[0]) for m in messages if len(m.params) == 1}
        except Exception:  # python-osc also raises exceptions of other modules
            return None
        if any(address not in values for address in self._addresses):
            return None
        position = np.array([values[address] for address in self._addresses])
        return position if np.all(np.isfinite(position)) else None


class _ArtNetReader:
    def __init__(self, stand: Stand, controller: ArtNet):
        self._encoder = ArtNetEncoder(axes_of(stand), dmx_channels(stand, controller), controller)
        self._universe = controller.universe

    def position(self, data: bytes) -> Array | None:
        """(n,) positions in a packet; None if it cannot be read or is for another universe."""
        size = PACKET_HEADER.size + DMX_HEADER.size
        if len(data) < size or PACKET_HEADER.unpack_from(data) != (PROTOCOL_ID, DMX_OPCODE):
            return None
        _, _, _, low_byte, high_byte, length = DMX_HEADER.unpack_from(data, PACKET_HEADER.size)
        dmx_data, first = data[size : size + length], self._encoder.first_channels
        n_channels = self._encoder.channels_per_axis
        if (
            256 * high_byte + low_byte != self._universe
            or len(dmx_data) < max(first) + n_channels - 1
        ):
            return None
        values = [int.from_bytes(dmx_data[k - 1 : k - 1 + n_channels], "big") for k in first]
        return self._encoder.positions(np.array(values))
