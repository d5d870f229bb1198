"""Packets of axis positions for controllers on a network: Open Sound Control and Art-Net.

OSC: a bundle with the time at which it is due; in it a message for every axis, with its position
[m or rad] as a 32-bit float. Art-Net: an ArtDmx packet; the travel of an axis with b bits is

    value = rint((2^b - 1) (p - low) / (high - low)),   the coarse channel before the fine one
"""

from __future__ import annotations

import re
import struct
from typing import Any, Protocol

import numpy as np

from fantoccini.base import Array, Indices, MissingLibraryError, StandError
from fantoccini.stand.axes import Axis, axes_of
from fantoccini.stand.controllers import MOST_FRAMES, ArtNet, Osc
from fantoccini.stand.stand_file import Stand

HEADER = struct.Struct("<8sH")
"""Of all packets of Art-Net: name and kind."""
REST = struct.Struct(">HBBBBH")
"""Of an ArtDmx packet: version, sequence, physical port, low and high part of the universe, and
length."""
NAME, OUTPUT, VERSION = b"Art-Net\0", 0x5000, 14
CHANNELS = 512
"""Of a universe."""

_ADDRESS = re.compile(r"(?:/[^\s#*,/?\[\]{}]+)+", re.ASCII)


class Packets(Protocol):
    """How positions become packets."""

    def encode(self, position: Array, when: float) -> bytes:
        """The packet of positions (n,) [m or rad] that are due at a time [s of the epoch]."""

    def told(self, position: Array) -> str:
        """What is in it, in words."""


def packets_of(stand: Stand, controller: Any, rate: float) -> Packets:
    """What makes packets for a stand's controller.

    Raises:
        StandError: the controller takes none, or not so many per second.
        FileError: it has other names.
        MissingLibraryError: python-osc is not installed.
    """
    if isinstance(controller, Osc):
        return OscPackets(addresses(stand, controller))
    if not isinstance(controller, ArtNet):
        raise StandError(f"{controller.type} takes no packets; needed: --controller osc or artnet")
    if rate > MOST_FRAMES:
        raise StandError(f"found {rate:g} set points per second; DMX takes at most {MOST_FRAMES:g}")
    return ArtNetPackets(axes_of(stand), channels(stand, controller), controller)


class OscPackets:
    """Bundles of OSC.

    Args:
        addresses: of the axes.
    """

    def __init__(self, addresses: tuple[str, ...]):
        try:
            from pythonosc.osc_bundle_builder import OscBundleBuilder
            from pythonosc.osc_message_builder import OscMessageBuilder
        except ImportError:
            raise MissingLibraryError("OSC", "python-osc", "osc") from None
        self.addresses, self._bundle, self._message = addresses, OscBundleBuilder, OscMessageBuilder

    def encode(self, position: Array, when: float) -> bytes:
        """As of :class:`Packets`."""
        bundle = self._bundle(when)
        for address, value in zip(self.addresses, position, strict=True):
            message = self._message(address)
            message.add_arg(float(value), "f")
            bundle.add_content(message.build())
        data: bytes = bundle.build().dgram
        return data

    def told(self, position: Array) -> str:
        """Addresses with their positions."""
        pairs = zip(self.addresses, position, strict=True)
        return " ".join(f"{address} {np.float32(value)}" for address, value in pairs)


class ArtNetPackets:
    """ArtDmx packets, without sequence numbers (0).

    Receivers that count would leave out what a sender that begins again sends first, and jump then.

    Args:
        axes: n axes.
        first: (n,) first channel of each, from 1.
        controller: as written.
    """

    def __init__(self, axes: tuple[Axis, ...], first: tuple[int, ...], controller: ArtNet):
        self.first, self.controller = first, controller
        self.low, self.high = np.array([axis.travel for axis in axes]).T

    @property
    def wide(self) -> int:
        """Channels of an axis."""
        return self.controller.bits // 8

    @property
    def largest(self) -> int:
        """2^b - 1: the value at the end of the travel."""
        return int(2**self.controller.bits - 1)

    def values(self, position: Array) -> Indices:
        """(..., n) numbers of positions (..., n) [m or rad]."""
        share = np.clip((position - self.low) / (self.high - self.low), 0.0, 1.0)
        return np.asarray(np.rint(self.largest * share).astype(np.int64))

    def positions(self, values: Indices) -> Array:
        """(..., n) positions [m or rad] of numbers (..., n)."""
        return np.asarray(self.low + values * (self.high - self.low) / self.largest)

    def encode(self, position: Array, when: float) -> bytes:
        """As of :class:`Packets`; Art-Net has no times."""
        n = max(self.first) + self.wide - 1
        data = bytearray(n + n % 2)
        for first, value in zip(self.first, self.values(position), strict=True):
            data[first - 1 : first - 1 + self.wide] = int(value).to_bytes(self.wide, "big")
        high, low = divmod(self.controller.universe, 256)
        rest = REST.pack(VERSION, 0, 0, low, high, len(data))
        return HEADER.pack(NAME, OUTPUT) + rest + data

    def told(self, position: Array) -> str:
        """First channels with their numbers."""
        pairs = zip(self.first, self.values(position), strict=True)
        return " ".join(f"{first}={value}" for first, value in pairs)


def addresses(stand: Stand, controller: Osc) -> tuple[str, ...]:
    """OSC addresses of a stand's axes; ``/NAME`` by default.

    Raises:
        FileError: one is none, or two are the same.
    """
    out: list[str] = []
    found = []
    for axis in stand.axes:
        address = str(controller.names.get(axis, f"/{axis}"))
        if not _ADDRESS.fullmatch(address) or not address.isascii():
            text = f"found {address!r}; needed: an OSC address, such as /{axis}"
            found.append((("controller", "names", axis), text))
        elif address in out:
            text = f"found {address!r} twice; needed: an address of its own"
            found.append((("controller", "names", axis), text))
        out.append(address)
    stand.refuse([*found])
    return tuple(out)


def channels(stand: Stand, controller: ArtNet) -> tuple[int, ...]:
    """First DMX channels of a stand's axes, from 1; the first free ones by default.

    Raises:
        FileError: one is none, or two overlap.
        StandError: the universe has too few.
    """
    wide = controller.bits // 8
    last = CHANNELS + 1 - wide
    own: dict[str, int] = {}
    taken: set[int] = set()
    found = []
    for axis, name in controller.names.items():
        if not str(name).isdecimal() or not 1 <= int(name) <= last:
            text = f"found {name!r}; needed: a channel, 1 to {last}"
        elif taken & set(range(int(name), int(name) + wide)):
            text = f"found {name!r}; needed: {wide} channels of its own"
        else:
            own[axis] = int(name)
            taken |= set(range(int(name), int(name) + wide))
            continue
        found.append((("controller", "names", axis), text))
    stand.refuse([*found])
    at = 1
    for axis in stand.axes:
        if axis in own:
            continue
        while taken & set(range(at, at + wide)):
            at += 1
        own[axis] = at
        at += wide
    if max(own.values()) > last:
        raise StandError(
            f"a universe has {CHANNELS} channels, and {len(own)} axes of {wide} do not fit beside "
            "each other; needed: bits: 8, or fewer axes"
        )
    return tuple(own[axis] for axis in stand.axes)
