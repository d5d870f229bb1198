"""Packets of axis positions for controllers on a network: Open Sound Control and Art-Net.

OSC: a bundle, tagged with the time at which it is due, with one message for every axis: its
position [m or rad] as a 32-bit float. Art-Net: an ArtDmx packet; an axis with b bits has the value

    value = rint((2^b - 1) (p - low) / (high - low)),   the coarse channel before the fine one
"""

from __future__ import annotations

import re
import struct
from typing import Any, Protocol

import numpy as np

from fantoccini.base import Array, Indices, StandError, osc_library
from fantoccini.stand.axes import Axis, axes_of
from fantoccini.stand.controllers import MAX_FRAME_RATE, ArtNet, Osc
from fantoccini.stand.stand_file import Stand

PACKET_HEADER = struct.Struct("<8sH")
"""First fields of every Art-Net packet: name and kind."""
DMX_HEADER = struct.Struct(">HBBBBH")
"""Further fields of an ArtDmx packet: version, sequence number, physical port, low and high byte of
the universe, length."""
NAME, OUTPUT, VERSION = b"Art-Net\0", 0x5000, 14
"""Name of the protocol, kind of an ArtDmx packet, and version of the protocol."""
CHANNELS = 512
"""Number of channels of a universe."""

_ADDRESS = re.compile(r"(?:/[^\s#*,/?\[\]{}]+)+", re.ASCII)


class Packets(Protocol):
    """Encoder of axis positions as packets."""

    def encode(self, position: Array, due: float) -> bytes:
        """The packet for positions (n,) [m or rad] that are due at a time [s since the epoch]."""

    def describe(self, position: Array) -> str:
        """The packet's contents as text."""


def packets_of(stand: Stand, controller: Any, rate: float) -> Packets:
    """The encoder of packets for a stand's controller.

    Raises:
        StandError: the controller does not accept packets, or not at this rate.
        FileError: a name in the file is not an address or channel.
        MissingLibraryError: python-osc is not installed.
    """
    if isinstance(controller, Osc):
        return OscPackets(addresses(stand, controller))
    if not isinstance(controller, ArtNet):
        raise StandError(
            f"{controller.type} does not accept packets; needed: --controller osc or artnet"
        )
    if rate > MAX_FRAME_RATE:
        raise StandError(
            f"found {rate:g} set points per second; DMX allows at most {MAX_FRAME_RATE:g}"
        )
    return ArtNetPackets(axes_of(stand), channels(stand, controller), controller)


class OscPackets:
    """Encoder of OSC bundles.

    Args:
        addresses: one for each axis.
    """

    def __init__(self, addresses: tuple[str, ...]):
        self.addresses, self._library = addresses, osc_library()

    def encode(self, position: Array, due: float) -> bytes:
        """The bundle for positions, as in :class:`Packets`."""
        bundle = self._library.BundleBuilder(due)
        for address, value in zip(self.addresses, position, strict=True):
            message = self._library.MessageBuilder(address)
            message.add_arg(float(value), "f")
            bundle.add_content(message.build())
        data: bytes = bundle.build().dgram
        return data

    def describe(self, position: Array) -> str:
        """Every address with its position."""
        pairs = zip(self.addresses, position, strict=True)
        return " ".join(f"{address} {np.float32(value)}" for address, value in pairs)


class ArtNetPackets:
    """Encoder of ArtDmx packets, with sequence numbers disabled (0).

    A receiver that checks sequence numbers would drop the first packets of a restarted sender, and
    then jump.

    Args:
        axes: n axes.
        first: (n,) first channel of each, from 1.
        controller: the controller in the stand's file.
    """

    def __init__(self, axes: tuple[Axis, ...], first: tuple[int, ...], controller: ArtNet):
        self.first, self.controller = first, controller
        self.low, self.high = np.array([axis.travel for axis in axes]).T

    @property
    def n_channels(self) -> int:
        """Number of channels per axis."""
        return self.controller.bits // 8

    @property
    def max_value(self) -> int:
        """2^b - 1: the value at the end of the travel."""
        return int(2**self.controller.bits - 1)

    def channel_values(self, position: Array) -> Indices:
        """(..., n) channel values for positions (..., n) [m or rad]."""
        share = np.clip((position - self.low) / (self.high - self.low), 0.0, 1.0)
        return np.asarray(np.rint(self.max_value * share).astype(np.int64))

    def positions(self, values: Indices) -> Array:
        """(..., n) positions [m or rad] for channel values (..., n)."""
        return np.asarray(self.low + values * (self.high - self.low) / self.max_value)

    def encode(self, position: Array, due: float) -> bytes:
        """The packet for positions, as in :class:`Packets`; Art-Net has no time tags."""
        n = max(self.first) + self.n_channels - 1
        data = bytearray(n + n % 2)
        for first, value in zip(self.first, self.channel_values(position), strict=True):
            data[first - 1 : first - 1 + self.n_channels] = int(value).to_bytes(
                self.n_channels, "big"
            )
        high, low = divmod(self.controller.universe, 256)
        rest = DMX_HEADER.pack(VERSION, 0, 0, low, high, len(data))
        return PACKET_HEADER.pack(NAME, OUTPUT) + rest + data

    def describe(self, position: Array) -> str:
        """Every axis' first channel with its value."""
        pairs = zip(self.first, self.channel_values(position), strict=True)
        return " ".join(f"{first}={value}" for first, value in pairs)


def addresses(stand: Stand, controller: Osc) -> tuple[str, ...]:
    """OSC addresses of a stand's axes; ``/NAME`` by default.

    Raises:
        FileError: a name is not an OSC address, or two are the same.
    """
    addresses: list[str] = []
    mistakes = []
    for axis in stand.axes:
        address = str(controller.names.get(axis, f"/{axis}"))
        if not _ADDRESS.fullmatch(address) or not address.isascii():
            text = f"found {address!r}; needed: an OSC address, such as /{axis}"
            mistakes.append((("controller", "names", axis), text))
        elif address in addresses:
            text = f"found {address!r} twice; needed: an address of its own"
            mistakes.append((("controller", "names", axis), text))
        addresses.append(address)
    stand.raise_if_any([*mistakes])
    return tuple(addresses)


def channels(stand: Stand, controller: ArtNet) -> tuple[int, ...]:
    """First DMX channels of a stand's axes, from 1; the first free ones by default.

    Raises:
        FileError: a name is not a channel, or two axes overlap.
        StandError: the universe has too few channels.
    """
    n_channels = controller.bits // 8
    last = CHANNELS + 1 - n_channels
    first: dict[str, int] = {}
    used: set[int] = set()
    mistakes = []
    for axis, name in controller.names.items():
        if not str(name).isdecimal() or not 1 <= int(name) <= last:
            text = f"found {name!r}; needed: a channel, 1 to {last}"
        elif used & set(range(int(name), int(name) + n_channels)):
            text = f"found {name!r}; needed: {n_channels} channels of its own"
        else:
            first[axis] = int(name)
            used |= set(range(int(name), int(name) + n_channels))
            continue
        mistakes.append((("controller", "names", axis), text))
    stand.raise_if_any([*mistakes])
    channel = 1
    for axis in stand.axes:
        if axis in first:
            continue
        while used & set(range(channel, channel + n_channels)):
            channel += 1
        first[axis] = channel
        channel += n_channels
    if max(first.values()) > last:
        raise StandError(
            f"a universe has {CHANNELS} channels, too few for {len(first)} axes of "
            f"{n_channels}; needed: bits: 8, or fewer axes"
        )
    return tuple(first[axis] for axis in stand.axes)
