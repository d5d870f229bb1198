"""Open Sound Control: the classes of python-osc, which is loaded when it is first needed."""

from __future__ import annotations

import logging
from typing import Any, NamedTuple

from fantoccini.base.errors import MissingLibraryError

_PARSER_MODULES = ("osc_message", "osc_bundle")
"""Modules of python-osc that log a line for each datagram that they read in part."""


class OscLibrary(NamedTuple):
    """Classes of python-osc.

    Attributes:
        Packet: reader of a datagram.
        MessageBuilder, BundleBuilder: builders of messages, and of several with a time.
    """

    Packet: Any
    MessageBuilder: Any
    BundleBuilder: Any


def osc_library() -> OscLibrary:
    """The classes; datagrams that they read in part are not logged, as anybody can send them.

    Raises:
        MissingLibraryError: python-osc is not installed.
    """
    try:
        from pythonosc.osc_bundle_builder import OscBundleBuilder
        from pythonosc.osc_message_builder import OscMessageBuilder
        from pythonosc.osc_packet import OscPacket
    except ImportError:
        raise MissingLibraryError("OSC", "python-osc", "osc") from None
    # The parsers use the root logger, which has no switch of their own.
    logging.getLogger().addFilter(_is_not_from_parsers)
    return OscLibrary(OscPacket, OscMessageBuilder, OscBundleBuilder)


def _is_not_from_parsers(record: logging.LogRecord) -> bool:
    """Whether a record is not one of python-osc's parsers."""
    return record.module not in _PARSER_MODULES
