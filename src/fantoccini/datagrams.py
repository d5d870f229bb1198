"""Sockets for datagrams to one machine, unless all of a network are meant."""

from __future__ import annotations

import ipaddress
import socket
from typing import Any


class ManyHearersError(ValueError):
    """All machines of a network, or of a group, would hear what is sent."""


def socket_to(host: str, port: int, many: bool = False) -> tuple[socket.socket, Any]:
    """A socket for datagrams to a port of a host, and the address as it takes it.

    Args:
        host, port: where they go.
        many: whether the host may be a broadcast or multicast address.

    Raises:
        ManyHearersError: it is such an address.
        OSError: there is no such host.
    """
    family, _, _, _, there = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    found = socket.socket(family, socket.SOCK_DGRAM)
    try:
        if many:
            found.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        elif _is_group(str(there[0])) or _is_broadcast(family, there):
            raise ManyHearersError(f"all machines of a network would hear what goes to {host}")
    except BaseException:
        found.close()
        raise
    return found, there


def _is_group(address: str) -> bool:
    found = ipaddress.ip_address(address)
    inner = getattr(found, "ipv4_mapped", None)
    return (found if inner is None else inner).is_multicast


def _is_broadcast(family: int, address: Any) -> bool:
    """Whether the system refuses an address to a socket that may not broadcast."""
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(address)
        except PermissionError:
            return True
        except OSError:
            return False  # no way there: told by who sends
    return False
