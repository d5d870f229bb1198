"""Packets of axis positions for controllers on a network: Open Sound Control and Art-Net.

OSC: a bundle, tagged with the time at which it is due, with one message for every axis: its
position [m or rad] as a 32-bit float. Art-Net: an ArtDmx packet; an axis with b bits has the value

    value = rint((2^b - 1) (p - low) / (high - low)),   the coarse channel before the fine one

p is the position of an axis, a motor of the stand, and low and high are the ends of its travel.
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
PROTOCOL_ID, DMX_OPCODE, PROTOCOL_VERSION = b"Art-Net\0", 0x5000, 14
"""Name of the protocol, kind of an ArtDmx packet, and version of the protocol."""
CHANNELS_PER_UNIVERSE = 512
"""Number of channels of a universe."""

_ADDRESS = re.compile(r"(?:/[^\s#*,/?\[\]{}]+)+", re.ASCII)


class PacketEncoder(Protocol):
    """Encoder of axis positions as packets."""

    def encode(self, position: Array, due: float) -> bytes:
        """The packet for positions (n,) [m or rad] that are due at a time [s since the epoch]."""

    def describe(self, position: Array) -> str:
        """The packet's contents as text."""


def packet_encoder(stand: Stand, controller: Any, rate: float) -> PacketEncoder:
    """The encoder of packets for a stand's controller.

    Raises:
        StandError: the controller does not accept packets, or not at this rate.
        FileError: a name in the file is not an address or channel.
        MissingLibraryError: python-osc is not installed.
    """
    if isinstance(controller, Osc):
        return OscEncoder(osc_addresses(stand, controller))
    if not isinstance(controller, ArtNet):
        raise StandError(
            f"{controller.type} does not accept packets; needed: --controller osc or artnet"
        )
    if rate > MAX_FRAME_RATE:
        raise StandError(
            f"found {rate:g} set points per second; DMX allows at most {MAX_FRAME_RATE:g}"
        )
    return ArtNetEncoder(axes_of(stand), dmx_channels(stand, controller), controller)


class OscEncoder:
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


class ArtNetEncoder:
    """Encoder of ArtDmx packets, with sequence numbers disabled (0).

    A receiver that checks sequence numbers would drop the first packets of a restarted sender, and
    then jump.

    Args:
        axes: n axes.
        first_channels: (n,) first channel of each, from 1.
        controller: the controller in the stand's file.
    """

    def __init__(self, axes: tuple[Axis, ...], first_channels: tuple[int, ...], controller: ArtNet):
        self.first_channels, self.controller = first_channels, controller
        self.low, self.high = np.array([axis.travel for axis in axes]).T

    @property
    def channels_per_axis(self) -> int:
        """Number of channels per axis."""
        return self.controller.bits // 8

    @property
    def max_value(self) -> int:
        """2^b - 1: the value at the end of the travel."""
        return int(2**self.controller.bits - 1)

    def axis_values(self, position: Array) -> Indices:
        """(..., n) channel values for positions (..., n) [m or rad]."""
        share = np.clip((position - self.low) / (self.high - self.low), 0.0, 1.0)
        return np.asarray(np.rint(self.max_value * share).astype(np.int64))

    def positions(self, values: Indices) -> Array:
        """(..., n) positions [m or rad] for channel values (..., n)."""
        return np.asarray(self.low + values * (self.high - self.low) / self.max_value)

    def encode(self, position: Array, due: float) -> bytes:
        """The packet for positions, as in :class:`Packets`; Art-Net has no time tags."""
        n_channels = max(self.first_channels) + self.channels_per_axis - 1
        data = bytearray(n_channels + n_channels % 2)
        for first, value in zip(self.first_channels, self.axis_values(position), strict=True):
            data[first - 1 : first - 1 + self.channels_per_axis] = int(value).to_bytes(
                self.channels_per_axis, "big"
            )
        high_byte, low_byte = divmod(self.controller.universe, 256)
        dmx_header = DMX_HEADER.pack(PROTOCOL_VERSION, 0, 0, low_byte, high_byte, len(data))
        return PACKET_HEADER.pack(PROTOCOL_ID, DMX_OPCODE) + dmx_header + data

    def describe(self, position: Array) -> str:
        """Every axis' first channel with its value."""
        pairs = zip(self.first_channels, self.axis_values(position), strict=True)
        return " ".join(f"{first}={value}" for first, value in pairs)


def osc_addresses(stand: Stand, controller: Osc) -> tuple[str, ...]:
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


def dmx_channels(stand: Stand, controller: ArtNet) -> tuple[int, ...]:
    """First DMX channels of a stand's axes, from 1; the first free ones by default.

    Raises:
        FileError: a name is not a channel, or two axes overlap.
        StandError: the universe has too few channels.
    """
    channels_per_axis = controller.bits // 8
    last_first_channel = CHANNELS_PER_UNIVERSE + 1 - channels_per_axis
    first_channels: dict[str, int] = {}
    used_channels: set[int] = set()
    mistakes = []
    for axis, name in controller.names.items():
        if not str(name).isdecimal() or not 1 <= int(name) <= last_first_channel:
            text = f"found {name!r}; needed: a channel, 1 to {last_first_channel}"
        elif used_channels & set(range(int(name), int(name) + channels_per_axis)):
            text = f"found {name!r}; needed: {channels_per_axis} channels of its own"
        else:
            first_channels[axis] = int(name)
            used_channels |= set(range(int(name), int(name) + channels_per_axis))
            continue
        mistakes.append((("controller", "names", axis), text))
    stand.raise_if_any([*mistakes])
    channel = 1
    for axis in stand.axes:
        if axis in first_channels:
            continue
        while used_channels & set(range(channel, channel + channels_per_axis)):
            channel += 1
        first_channels[axis] = channel
        channel += channels_per_axis
    if max(first_channels.values()) > last_first_channel:
        raise StandError(
            f"a universe has {CHANNELS_PER_UNIVERSE} channels, too few for {len(first_channels)} "
            f"axes of {channels_per_axis}; needed: bits: 8, or fewer axes"
        )
    return tuple(first_channels[axis] for axis in stand.axes)
