"""``fantoccini stand stream``: set points to a controller, until Ctrl-C holds them."""

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

from fantoccini.app.cli.perform import address_to
from fantoccini.app.cli.stand_requests import StandStreamRequest
from fantoccini.app.console import FAILED, INTERRUPTED, Steps, fail, say, write
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

_LOOK = 0.1
"""Interval at which a prompt looks whether it is to end [s]."""


def send_lines(points: SetPoints, request: StandStreamRequest) -> None:
    """Sends G-code to a serial port, or prints it."""
    kind = points.controller.type
    for option, given in (("--to", request.to), ("--from-time", request.from_time)):
        if given is not None:
            fail(f"applies to osc and artnet, and the controller is {kind}", option)
    with Steps(request.quiet) as steps:
        steps.step("timing the moves")
        text = gcode(points)
    lines = lines_of(text)
    if request.from_line is not None:
        lines = resumed(text, request.from_line, gentle_feed(points))
    if request.dry_run:
        for line in lines:
            write(line.text)
        return
    controller = points.controller
    name = request.port or controller.port
    if name is None:
        fail("the stand's controller names no port; needed: --port NAME", "--port")
    counting = isinstance(controller, Grbl)
    buffer = controller.buffer if counting else 4096
    counts = Streamed()
    try:
        with _holding() as hold, serial_port(name, request.baud or controller.baud) as port:
            stream(
                port,
                lines,
                buffer,
                counting,
                counts=counts,
                hold=hold,
                go_on=lambda done: _ask(f"line {done.last}"),
            )
    except StreamError as error:
        say(f"fantoccini: {error}")
        if counts.last:
            first = first_lost(text, counts.last, controller.planner)
            say(
                f"the controller took all lines up to {counts.last}, and may have dropped what "
                f"waited; when it still knows where it is, go on with --from-line {first}"
            )
        raise typer.Exit(INTERRUPTED if error.reason == STOPPED else FAILED) from None
    if not request.quiet:
        write(f"{counts.done} lines; up to {counts.most} characters were under way")


def send_packets(points: SetPoints, request: StandStreamRequest) -> None:
    """Sends packets over a network in real time, or prints what would be in them."""
    controller = points.controller
    for option, given in (
        ("--port", request.port),
        ("--baud", request.baud),
        ("--from-line", request.from_line),
    ):
        if given is not None:
            fail(f"applies to G-code, and the controller is {controller.type}", option)
    host, port = address_to(request.to, "--to") or (controller.host, controller.port)
    first, motion = request.from_time or 0.0, points.whole()
    check_first(first, float(motion.t[-1]))
    if request.dry_run:
        packets = packets_of(points.map.stand, controller, points.rate)
        for t, position in zip(motion.t, motion.position, strict=True):
            if t >= first:
                write(f"{t:.4f} {packets.told(position)}")
        return
    if first and not request.quiet:
        say(
            f"the first packet sends the axes to where they are at t = {first:g} s, at once; they "
            "must stand there"
        )
    broadcast = isinstance(controller, ArtNet) and controller.broadcast
    counts = Sending()
    try:
        with _holding() as hold, udp_sender(host, port, broadcast) as send:
            send_points(
                points,
                send,
                first=first,
                hold=hold,
                counts=counts,
                go_on=lambda done: _ask(f"t = {done.t:.3f} s", done.lost),
            )
    except PacketError as error:
        say(f"fantoccini: {error}")
        if counts.t > 0.0:
            # Rounded down, so that no set point is left out.
            say(
                f"when the axes are where they were, go on with --from-time "
                f"{np.floor(1e3 * error.t) / 1e3:.3f}"
            )
        raise typer.Exit(INTERRUPTED if error.reason == STOPPED else FAILED) from None
    if not request.quiet:
        write(
            f"{counts.sent} packets to {host}:{port}, {counts.dropped} set points left out; "
            f"at most {1e3 * counts.latest:.2f} ms late"
        )


@contextlib.contextmanager
def _holding() -> Iterator[threading.Event]:
    """Ctrl-C sets an event meanwhile."""
    hold = threading.Event()
    before = signal.signal(signal.SIGINT, lambda *_: hold.set())
    try:
        yield hold
    finally:
        signal.signal(signal.SIGINT, before)


def _ask(where: str, lost: threading.Event | None = None) -> bool:
    """Whether a held motion is to go on; not once the event is set."""
    say(f"held at {where}; Enter goes on, Ctrl-C stops")
    before = signal.signal(signal.SIGINT, _interrupt)
    try:
        return _entered(lost or threading.Event())
    except KeyboardInterrupt:
        return False
    finally:
        signal.signal(signal.SIGINT, before)


def _entered(ended: threading.Event) -> bool:
    """Waits for a line, and says whether there was one; ends with the event.

    On Windows, where a console cannot be waited for like this, it ends with the line.
    """
    if sys.platform == "win32":
        return bool(sys.stdin.readline())
    terminal = sys.stdin.fileno()
    while not ended.is_set():
        if select.select([terminal], [], [], _LOOK)[0]:
            read = os.read(terminal, 1)  # no more, as the next line may be another hold's
            if read in (b"", b"\n"):
                return bool(read)
    return False


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
