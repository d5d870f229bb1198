"""``fantoccini stand stream``: sends set points to a controller; Ctrl-C pauses.

A set point is the position of all axes, the motors of the stand, at one time.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from types import FrameType

import numpy as np
import typer

from fantoccini.app.cli.perform import target_address
from fantoccini.app.cli.stand_arguments import StandStreamArguments
from fantoccini.app.cli_support import (
    FAILED,
    INTERRUPTED,
    ProgressDisplay,
    fail,
    print_message,
    print_output,
)
from fantoccini.base import PacketError, StandError, StreamError
from fantoccini.stand import (
    MAX_SILENCE,
    STOPPED,
    ArtNet,
    Channel,
    Grbl,
    Marlin,
    Program,
    SendCounts,
    SetPoints,
    Stand,
    StreamCounts,
    check_start_time,
    first_lost_line,
    gcode_lines,
    gcode_program,
    packet_encoder,
    resume_lines,
    resume_points,
    send_points,
    serial_port,
    slow_feed,
    stream_together,
    udp_sender,
)

_POLL_INTERVAL = 0.1
"""Interval at which a prompt checks whether it must end [s]."""


def send_lines(
    points: SetPoints, ports: Mapping[str, str], arguments: StandStreamArguments
) -> None:
    """Sends G-code to the serial port of every controller, or prints it with ``--dry-run``.

    Args:
        points: set points of all axes.
        ports: name of a controller -> its serial port; not used in a dry run.
        arguments: arguments of the command.
    """
    with ProgressDisplay(arguments.quiet) as display:
        display.stage("timing the moves")
        if arguments.from_time is not None:
            points = resume_points(points, arguments.from_time)
        by_controller = points.parts
        programs = {name: gcode_program(part) for name, part in by_controller.items()}
    lines = {name: gcode_lines(program.text) for name, program in programs.items()}
    if arguments.from_line is not None:
        (text,) = (program.text for program in programs.values())
        lines = {"": resume_lines(text, arguments.from_line, slow_feed(points))}
    if arguments.dry_run:
        for name, program_lines in lines.items():
            for line in program_lines:
                print_output(f"{name}: {line.text}" if name else line.text)
        return
    if not arguments.quiet:
        print_message("sending; Ctrl-C holds")
    started = time.monotonic()
    counts = {name: StreamCounts() for name in by_controller}
    try:
        with contextlib.ExitStack() as stack:
            hold = stack.enter_context(_hold_on_interrupt())
            channels = []
            for name, part in by_controller.items():
                controller = part.controller
                port = serial_port(ports[name], arguments.baud or controller.baud)
                counts_characters = isinstance(controller, Grbl)
                channels.append(
                    Channel(
                        stack.enter_context(port),
                        lines[name],
                        controller.buffer if counts_characters else 4096,
                        counts_characters,
                        name=name,
                        start=programs[name].first_line if name else None,
                        counts=counts[name],
                    )
                )
            stream_together(
                channels,
                silence=MAX_SILENCE + max(program.max_wait for program in programs.values()),
                hold=hold,
                should_resume=lambda: _ask_to_continue(_lines_text(counts)),
            )
    except StreamError as error:
        print_message(f"fantoccini: {error}")
        _print_how_to_continue(by_controller, programs, counts)
        raise typer.Exit(INTERRUPTED if error.reason == STOPPED else FAILED) from None
    if not arguments.quiet:
        for name, count in counts.items():
            prefix = f"{name}: " if name else ""
            print_output(
                f"{prefix}{count.acknowledged} lines; "
                f"up to {count.max_unanswered} characters in transit"
            )
        print_message(f"all lines acknowledged after {time.monotonic() - started:.1f} s")


def _check_line_options(kinds: str, has_several: bool, arguments: StandStreamArguments) -> None:
    """Raises a usage error for options that do not apply to the controllers."""
    if arguments.to is not None:
        fail(f"applies to osc and artnet, but this stand has {kinds}", "--to")
    if arguments.from_time is not None and not has_several:
        text = f"applies to osc, artnet or several controllers, but this stand has one, {kinds}"
        fail(f"{text}; needed: --from-line N", "--from-time")
    if arguments.from_line is not None and has_several:
        text = "applies to stands with one controller; several continue at a common time"
        fail(f"{text}; needed: --from-time S", "--from-line")


def serial_ports(stand: Stand, arguments: StandStreamArguments) -> dict[str, str]:
    """Name of a controller -> its serial port: as given, otherwise that of the stand's file.

    Empty for a dry run and for controllers without serial ports. Options that do not apply to the
    controllers are usage errors.

    Raises:
        StandError: a port does not exist.
    """
    controllers = {name: part.controller for name, part in stand.parts.items()}
    serial = {name: c for name, c in controllers.items() if isinstance(c, Grbl | Marlin)}
    if len(serial) < len(controllers):
        return {}
    has_several = "" not in serial
    kinds = ", ".join(controller.type for controller in serial.values())
    _check_line_options(kinds, has_several, arguments)
    if arguments.dry_run:
        return {}
    ports: dict[str, str | None] = {name: c.port for name, c in serial.items()}
    for text in arguments.port or []:
        name, _, port = text.partition("=") if has_several else ("", "", text)
        if name not in ports or not port:
            names = ", ".join(ports)
            fail(f"found {text!r}; needed: NAME=PORT, NAME one of {names}", "--port")
        ports[name] = port
    for name, named_port in ports.items():
        if named_port is None:
            text = f"the controller {name}" if name else "the stand's controller"
            fail(f"{text} names no port; needed: --port {f'{name}=' if name else ''}PORT", "--port")
    devices = {name: port for name, port in ports.items() if port is not None}
    for device in devices.values():
        if list(devices.values()).count(device) > 1:
            fail(f"found {device!r} for several controllers; needed: one port each", "--port")
    for name, device in devices.items():
        if os.path.isabs(device) and not os.path.exists(device):
            owner = f"the controller {name}" if name else "the controller"
            raise StandError(f"there is no serial port {device}, which is that of {owner}")
    return devices


def _lines_text(counts: Mapping[str, StreamCounts]) -> str:
    """The last acknowledged line of every controller, in words."""
    texts = [
        f"line {count.last_line}" + (f" of {name}" if name else "")
        for name, count in counts.items()
    ]
    return " and ".join(texts)


def _print_how_to_continue(
    parts: Mapping[str, SetPoints],
    programs: Mapping[str, Program],
    counts: Mapping[str, StreamCounts],
) -> None:
    """Prints the line, or with several controllers the time, from which a stream can continue."""
    if not any(count.last_line for count in counts.values()):
        return
    first_lost_lines = {
        name: first_lost_line(programs[name].text, count.last_line, parts[name].controller.planner)
        for name, count in counts.items()
    }
    if "" in first_lost_lines:
        print_message(
            f"the controller accepted all lines up to {counts[''].last_line}, and may have dropped "
            "lines in its buffer; if it still knows its position, continue with --from-line "
            f"{first_lost_lines['']}"
        )
        return
    t = min(programs[name].time_of(line) for name, line in first_lost_lines.items())
    if t > 0.0:
        # Rounded down, so that no move is skipped.
        print_message(
            f"the controllers accepted all lines up to {_lines_text(counts)}, and may have dropped "
            "lines in their buffers; if they still know their positions, continue with "
            f"--from-time {np.floor(1e3 * t) / 1e3:.3f}"
        )


def send_packets(points: SetPoints, arguments: StandStreamArguments) -> None:
    """Sends packets over a network in real time, or prints their contents."""
    controller = points.controller
    for option, value in (
        ("--port", arguments.port or None),
        ("--baud", arguments.baud),
        ("--from-line", arguments.from_line),
    ):
        if value is not None:
            fail(f"applies to G-code, and the controller is {controller.type}", option)
    host, port = target_address(arguments.to, "--to") or (controller.host, controller.port)
    start, motion = arguments.from_time or 0.0, points.complete_motion()
    check_start_time(start, float(motion.t[-1]))
    if arguments.dry_run:
        packets = packet_encoder(points.map.stand, controller, points.rate)
        for t, position in zip(motion.t, motion.position, strict=True):
            if t >= start:
                print_output(f"{t:.4f} {packets.describe(position)}")
        return
    if start and not arguments.quiet:
        print_message(
            f"the first packet moves the axes to their positions at t = {start:g} s immediately; "
            "they must already be there"
        )
    broadcast = isinstance(controller, ArtNet) and controller.broadcast
    counts = SendCounts()
    try:
        with _hold_on_interrupt() as hold, udp_sender(host, port, broadcast) as send:
            send_points(
                points,
                send,
                first=start,
                hold=hold,
                counts=counts,
                should_resume=lambda sent: _ask_to_continue(
                    f"t = {sent.t:.3f} s", sent.connection_lost
                ),
            )
    except PacketError as error:
        print_message(f"fantoccini: {error}")
        if counts.t > 0.0:
            # Rounded down, so that no set point is skipped.
            print_message(
                f"if the axes have not moved since, continue with --from-time "
                f"{np.floor(1e3 * error.t) / 1e3:.3f}"
            )
        raise typer.Exit(INTERRUPTED if error.reason == STOPPED else FAILED) from None
    if not arguments.quiet:
        print_output(
            f"{counts.sent} packets to {host}:{port}, {counts.dropped} set points left out; "
            f"at most {1e3 * counts.max_delay:.2f} ms late"
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


def _ask_to_continue(position_text: str, connection_lost: threading.Event | None = None) -> bool:
    """Asks whether to continue a paused motion; no as soon as ``connection_lost`` is set."""
    print_message(f"paused at {position_text}; Enter continues, Ctrl-C stops")
    previous_handler = signal.signal(signal.SIGINT, _raise_interrupt)
    try:
        return _wait_for_enter(connection_lost or threading.Event())
    except KeyboardInterrupt:
        return False
    finally:
        signal.signal(signal.SIGINT, previous_handler)


def _wait_for_enter(ended: threading.Event) -> bool:
    """Waits for a line; returns whether there was one before the event was set.

    On Windows, where a console cannot be polled, only a line ends the wait.
    """
    if sys.platform == "win32":
        return bool(sys.stdin.readline())
    terminal = sys.stdin.fileno()
    while not ended.is_set():
        if select.select([terminal], [], [], _POLL_INTERVAL)[0]:
            character = os.read(terminal, 1)  # only one: the next line may belong to another pause
            if character in (b"", b"\n"):
                return bool(character)
    return False


def _raise_interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
