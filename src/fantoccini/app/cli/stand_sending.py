"""``fantoccini stand stream``: sends set points to a controller; Ctrl-C pauses."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType

import numpy as np
import typer

from fantoccini.app.cli.perform import target_address
from fantoccini.app.cli.stand_arguments import StandStreamArguments
from fantoccini.app.cli_support import FAILED, INTERRUPTED, Steps, fail, say, write
from fantoccini.base import PacketError, StreamError
from fantoccini.stand import (
    STOPPED,
    ArtNet,
    Grbl,
    Sending,
    SetPoints,
    Streamed,
    check_first,
    first_lost,
    gcode,
    gentle_feed,
    lines_of,
    packets_of,
    resumed,
    send_points,
    serial_port,
    stream,
    udp_sender,
)

_POLL_INTERVAL = 0.1
"""Interval at which a prompt checks whether it must end [s]."""


def send_lines(points: SetPoints, arguments: StandStreamArguments) -> None:
    """Sends G-code to a serial port, or prints it with ``--dry-run``."""
    kind = points.controller.type
    for option, value in (("--to", arguments.to), ("--from-time", arguments.from_time)):
        if value is not None:
            fail(f"applies to osc and artnet, and the controller is {kind}", option)
    with Steps(arguments.quiet) as steps:
        steps.step("timing the moves")
        text = gcode(points)
    lines = lines_of(text)
    if arguments.from_line is not None:
        lines = resumed(text, arguments.from_line, gentle_feed(points))
    if arguments.dry_run:
        for line in lines:
            write(line.text)
        return
    controller = points.controller
    name = arguments.port or controller.port
    if name is None:
        fail("the stand's controller names no port; needed: --port NAME", "--port")
    counting = isinstance(controller, Grbl)
    buffer = controller.buffer if counting else 4096
    counts = Streamed()
    try:
        with (
            _hold_on_interrupt() as hold,
            serial_port(name, arguments.baud or controller.baud) as port,
        ):
            stream(
                port,
                lines,
                buffer,
                counting,
                counts=counts,
                hold=hold,
                go_on=lambda sent: _ask(f"line {sent.last}"),
            )
    except StreamError as error:
        say(f"fantoccini: {error}")
        if counts.last:
            first = first_lost(text, counts.last, controller.planner)
            say(
                f"the controller accepted all lines up to {counts.last}, and may have dropped "
                "lines in its buffer; if it still knows its position, continue with --from-line "
                f"{first}"
            )
        raise typer.Exit(INTERRUPTED if error.reason == STOPPED else FAILED) from None
    if not arguments.quiet:
        write(f"{counts.done} lines; up to {counts.most} characters in transit")


def send_packets(points: SetPoints, arguments: StandStreamArguments) -> None:
    """Sends packets over a network in real time, or prints their contents."""
    controller = points.controller
    for option, value in (
        ("--port", arguments.port),
        ("--baud", arguments.baud),
        ("--from-line", arguments.from_line),
    ):
        if value is not None:
            fail(f"applies to G-code, and the controller is {controller.type}", option)
    host, port = target_address(arguments.to, "--to") or (controller.host, controller.port)
    first, motion = arguments.from_time or 0.0, points.whole()
    check_first(first, float(motion.t[-1]))
    if arguments.dry_run:
        packets = packets_of(points.map.stand, controller, points.rate)
        for t, position in zip(motion.t, motion.position, strict=True):
            if t >= first:
                write(f"{t:.4f} {packets.described(position)}")
        return
    if first and not arguments.quiet:
        say(
            f"the first packet moves the axes to their positions at t = {first:g} s immediately; "
            "they must already be there"
        )
    broadcast = isinstance(controller, ArtNet) and controller.broadcast
    counts = Sending()
    try:
        with _hold_on_interrupt() as hold, udp_sender(host, port, broadcast) as send:
            send_points(
                points,
                send,
                first=first,
                hold=hold,
                counts=counts,
                go_on=lambda sent: _ask(f"t = {sent.t:.3f} s", sent.lost),
            )
    except PacketError as error:
        say(f"fantoccini: {error}")
        if counts.t > 0.0:
            # Rounded down, so that no set point is skipped.
            say(
                f"if the axes have not moved since, continue with --from-time "
                f"{np.floor(1e3 * error.t) / 1e3:.3f}"
            )
        raise typer.Exit(INTERRUPTED if error.reason == STOPPED else FAILED) from None
    if not arguments.quiet:
        write(
            f"{counts.sent} packets to {host}:{port}, {counts.dropped} set points left out; "
            f"at most {1e3 * counts.latest:.2f} ms late"
        )


@contextlib.contextmanager
def _hold_on_interrupt() -> Iterator[threading.Event]:
    """Context in which Ctrl-C sets an event."""
    hold = threading.Event()
    previous_handler = signal.signal(signal.SIGINT, lambda *_: hold.set())
    try:
        yield hold
    finally:
        signal.signal(signal.SIGINT, previous_handler)


def _ask(where: str, lost: threading.Event | None = None) -> bool:
    """Asks whether to continue a paused motion; no once the event is set."""
    say(f"paused at {where}; Enter continues, Ctrl-C stops")
    previous_handler = signal.signal(signal.SIGINT, _interrupt)
    try:
        return _entered(lost or threading.Event())
    except KeyboardInterrupt:
        return False
    finally:
        signal.signal(signal.SIGINT, previous_handler)


def _entered(ended: threading.Event) -> bool:
    """Waits for a line; returns whether there was one before the event was set.

    On Windows, where a console cannot be polled, only a line ends the wait.
    """
    if sys.platform == "win32":
        return bool(sys.stdin.readline())
    terminal = sys.stdin.fileno()
    while not ended.is_set():
        if select.select([terminal], [], [], _POLL_INTERVAL)[0]:
            read = os.read(terminal, 1)  # only one: the next line may belong to another pause
            if read in (b"", b"\n"):
                return bool(read)
    return False


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
