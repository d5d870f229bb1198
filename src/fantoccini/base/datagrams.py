"""Sockets for datagrams of one machine, unless all of a network are meant."""

from __future__ import annotations

import ipaddress
import socket
from typing import Any


class AddressError(ValueError):
    """An address that cannot be used. The message says what is needed."""


class ManyHearersError(AddressError):
    """A broadcast or multicast address: more than one machine would hear."""


def socket_to(host: str, port: int, many: bool = False) -> tuple[socket.socket, Any]:
    """A socket for datagrams to a port of a host, and the address as it takes it.

    Args:
        host, port: where they go.
        many: whether the host may be a broadcast or multicast address.

    Raises:
        ManyHearersError: it is such an address.
        AddressError: there is no such host, or nothing is sent to the port.
    """
    told = f"cannot send to {host}:{port}"
    if port == 0:
        raise AddressError(f"{told}; needed: a port from 1 on")
    found, there = _socket(host, port)
    try:
        if many:
            found.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        elif _are_many(found.family, there):
            text = f"{told}: all machines of a network would hear it; needed: the address of one"
            raise ManyHearersError(text)
    except BaseException:
        found.close()
        raise
    return found, there


def socket_at(host: str, port: int, many: bool = False) -> socket.socket:
    """A socket that hears datagrams at a port of this machine.

    Args:
        host, port: where it hears them; 0 for any free port.
        many: whether the host may be a broadcast or multicast address.

    Raises:
        AddressError: it cannot hear them there.
    """
    told = f"cannot listen at {host}:{port}"
    found, here = _socket(host, port)
    try:
        if not many and _are_many(found.family, here):
            text = f"{told}: it is of all machines of a network; needed: an address of this one"
            raise AddressError(text)
        found.bind(here)
    except OSError as error:
        found.close()
        text = f"{told}: {error.strerror or error}; needed: a free port of this machine"
        raise AddressError(text) from None
    except BaseException:
        found.close()
        raise
    return found


def _socket(host: str, port: int) -> tuple[socket.socket, Any]:
    try:
        family, _, _, _, there = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        return socket.socket(family, socket.SOCK_DGRAM), there
    except OSError as error:
        why = error.strerror or str(error)
    except ValueError:  # of labels that no name has
        why = "no host has such a name"
    raise AddressError(f"{host!r} is no address: {why}; needed: such as 127.0.0.1")


def _are_many(family: int, address: Any) -> bool:
    """Whether an address is of a group, or the system refuses it where broadcast is off."""
    found = ipaddress.ip_address(str(address[0]))
    inner = getattr(found, "ipv4_mapped", None)
    if (found if inner is None else inner).is_multicast:
        return True
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(address)
        except PermissionError:
            return True
        except OSError:
            return False  # no way there: told by who sends
    return False
