"""UDP sockets. Addresses that reach several machines must be allowed explicitly.

A datagram is a packet of UDP; a multicast address reaches several machines.
"""

from __future__ import annotations

import ipaddress
import socket
from typing import Any


class AddressError(ValueError):
    """An address that cannot be used. The message says what is needed."""


class ManyHearersError(AddressError):
    """A broadcast or multicast address: several machines would receive the datagrams."""


def socket_to(host: str, port: int, many: bool = False) -> tuple[socket.socket, Any]:
    """A socket that sends datagrams, and the address to pass to ``sendto``.

    Args:
        host, port: destination.
        many: whether the host may be a broadcast or multicast address.

    Raises:
        ManyHearersError: the host is such an address, without ``many``.
        AddressError: the host does not exist, or the port is 0.
    """
    prefix = f"cannot send to {host}:{port}"
    if port == 0:
        raise AddressError(f"{prefix}; needed: a port from 1 on")
    sender, address = _socket(host, port)
    try:
        if many:
            sender.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        elif _is_multicast(sender.family, address):
            message = (
                f"{prefix}: all machines of a network would hear it; needed: the address of one"
            )
            raise ManyHearersError(message)
    except BaseException:
        sender.close()
        raise
    return sender, address


def socket_at(host: str, port: int, many: bool = False) -> socket.socket:
    """A socket that receives datagrams at a port of this machine.

    Args:
        host, port: address to listen at; port 0 for any free port.
        many: whether the host may be a broadcast or multicast address.

    Raises:
        AddressError: the address is not of this machine, or the port is not free.
    """
    prefix = f"cannot listen at {host}:{port}"
    receiver, address = _socket(host, port)
    try:
        if not many and _is_multicast(receiver.family, address):
            message = (
                f"{prefix}: it is of all machines of a network; needed: an address of this one"
            )
            raise AddressError(message)
        receiver.bind(address)
    except OSError as error:
        receiver.close()
        message = f"{prefix}: {error.strerror or error}; needed: a free port of this machine"
        raise AddressError(message) from None
    except BaseException:
        receiver.close()
        raise
    return receiver


def _socket(host: str, port: int) -> tuple[socket.socket, Any]:
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        return socket.socket(family, socket.SOCK_DGRAM), address
    except OSError as error:
        reason = error.strerror or str(error)
    except ValueError:  # labels that no host name may contain
        reason = "no host has such a name"
    raise AddressError(f"{host!r} is no address: {reason}; needed: an address such as 127.0.0.1")


def _is_multicast(family: int, address: Any) -> bool:
    """Whether an address is multicast, or the system requires SO_BROADCAST for it."""
    ip = ipaddress.ip_address(str(address[0]))
    mapped_ip = getattr(ip, "ipv4_mapped", None)
    if (ip if mapped_ip is None else mapped_ip).is_multicast:
        return True
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(address)
        except PermissionError:
            return True
        except OSError:
            return False  # unreachable: reported when a datagram is sent
    return False
