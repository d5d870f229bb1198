"""``fantoccini stand export``, ``stream`` and ``emulate``: runs as motions of motors.

A stand is the machine that moves a puppet by its axes, the motors. A set point is the position of
all axes at one time; slack is the length of string that drums let out and wind in again before the
start.
"""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from fantoccini.app.cli.perform import address_of
from fantoccini.app.cli.stand import load_run
from fantoccini.app.cli.stand_arguments import (
    StandExportArguments,
    StandMotionOptions,
    StandStreamArguments,
)
from fantoccini.app.cli.stand_sending import send_lines, send_packets, serial_ports
from fantoccini.app.cli_support import (
    ProgressDisplay,
    check_output,
    fail,
    output_errors,
    print_message,
    print_output,
)
from fantoccini.base import Array, StandError, Times, replacing
from fantoccini.stand import (
    SET_POINT_SUFFIXES,
    ArtNet,
    Emulator,
    Grbl,
    GrblMachine,
    GrblSettings,
    Marlin,
    Osc,
    Receiver,
    SetPoints,
    Stand,
    grbl_settings,
    load_stand,
    positions_together,
    save_points,
    set_points,
    start_waits,
    with_controller,
)

_DEFAULT_RATE = 50.0
"""Default number of set points per second for which an emulated GRBL is configured."""
_SAMPLE_RATE = 100.0
"""Rate at which the positions of the emulator's motors are written [Hz]."""


def export_points(arguments: StandExportArguments) -> None:
    """Writes the set points of a run to a file."""
    check_output(arguments.out, SET_POINT_SUFFIXES, "OUT")
    with ProgressDisplay(arguments.quiet) as display:
        points = _load_points(arguments, arguments.stand, arguments.run, display)
        points_by_path = {
            _part_path(arguments.out, name): part for name, part in points.parts.items()
        }
        for path, part in points_by_path.items():
            display.stage(f"writing {path}")
            with output_errors(path):
                save_points(part, path)
    if not arguments.quiet:
        for path, part in points_by_path.items():
            seconds = part.motion.t[-1]
            print_output(f"{path}: {len(part)} set points of {len(part.axes)} axes, {seconds:g} s")


def _part_path(out: Path, name: str) -> Path:
    """Path of the file for one of several controllers: OUT with its name before the ending."""
    return out.with_name(f"{out.stem}-{name}{out.suffix}") if name else out


def stream_run(arguments: StandStreamArguments) -> None:
    """Sends the set points of a run: G-code to a serial port, or packets over a network."""
    stand = load_stand(arguments.stand)
    ports = serial_ports(with_controller(stand, arguments.controller), arguments)
    with ProgressDisplay(arguments.quiet) as display:
        points = _load_points(arguments, stand, arguments.run, display)
    controllers = [part.controller for part in points.parts.values()]
    if isinstance(controllers[0], Osc | ArtNet):
        send_packets(points, arguments)
    elif isinstance(controllers[0], Grbl | Marlin):
        send_lines(points, ports, arguments)
    else:
        raise StandError(
            f"{controllers[0].type} cannot be streamed to; needed: grbl, fluidnc, marlin, osc "
            "or artnet (--controller); `stand export` writes files for other controllers"
        )


def emulate_controllers(
    stand: str,
    controller: str | None,
    rate: float | None,
    listen: str | None,
    out: Path | None,
    quiet: bool,
) -> None:
    """Emulates the controllers until their programs end or packets stop."""
    if out is not None:
        check_output(out, (".csv",), "--out")
    loaded_stand = with_controller(load_stand(stand), controller)
    controllers = [part.controller for part in loaded_stand.parts.values()]
    type_names = ", ".join(getattr(part_controller, "type", "") for part_controller in controllers)
    if isinstance(controllers[0], Osc | ArtNet):
        if rate is not None:
            fail(f"applies to G-code, and the controller is {type_names}", "--rate")
        receiver = _receive_packets(loaded_stand, controllers[0], listen, quiet)
        csv_text = ""
        if len(receiver):
            csv_text = _positions_csv(receiver.t[-1], receiver.positions, list(loaded_stand.axes))
    else:
        if listen is not None:
            fail(f"applies to osc and artnet, but this stand has {type_names}", "--listen")
        csv_text = _emulate_lines(loaded_stand, rate or _DEFAULT_RATE, quiet)
    if out is not None and csv_text:
        with output_errors(out), replacing(out) as temporary:
            temporary.write_text(csv_text, encoding="utf-8")


def _emulate_lines(stand: Stand, rate: float, quiet: bool) -> str:
    """Emulates the GRBLs of a stand until their programs end; returns the motors' positions."""
    parts = stand.parts
    settings = {name: grbl_settings(part, part.controller, rate) for name, part in parts.items()}
    machines = _serve(settings, quiet)
    axis_order = [axis for part in parts.values() for axis in part.axes]
    columns = [axis_order.index(name) for name in stand.axes]
    waits = start_waits(machines)
    return _positions_csv(
        max(machine.time + wait for machine, wait in zip(machines, waits, strict=True)),
        lambda t: positions_together(machines, t)[:, columns],
        list(stand.axes),
    )


def _serve(settings: Mapping[str, GrblSettings], quiet: bool) -> list[GrblMachine]:
    """Emulates GRBLs on pseudo-terminals, whose names it prints; returns them after their ends."""
    emulators = [
        _emulator(name, controller_settings, quiet)
        for name, controller_settings in settings.items()
    ]
    with contextlib.ExitStack() as stack:
        for name, (emulator, _) in zip(settings, emulators, strict=True):
            stack.enter_context(emulator)
            print_output(f"{name}={emulator.port}" if name else emulator.port)
        sys.stdout.flush()
        with contextlib.suppress(KeyboardInterrupt):
            while not all(ended.wait(0.1) for _, ended in emulators):
                pass
        for emulator, _ in emulators:
            emulator.wait_until_read()
    for name, (emulator, _) in zip(settings, emulators, strict=True):
        emulator.machine.finish()
        if not quiet:
            prefix = f"{name}: " if name else ""
            print_message(
                f"{prefix}{len(emulator.lines)} lines, {emulator.machine.time:.3f} s of motion, at "
                f"most {emulator.max_buffered} characters in the buffer, {emulator.overrun} lost"
            )
    return [emulator.machine for emulator, _ in emulators]


def _emulator(name: str, settings: GrblSettings, quiet: bool) -> tuple[Emulator, threading.Event]:
    """An emulated GRBL, and an event that is set at the end of its program."""
    ended = threading.Event()

    def log_line(text: str, answer: str) -> None:
        if not quiet and answer != "ok":
            print_message(f"{name}: {text}: {answer}" if name else f"{text}: {answer}")
        if text in ("M2", "M400"):
            ended.set()

    return Emulator(GrblMachine(settings), on_line=log_line), ended


def _receive_packets(
    stand: Stand, controller: Osc | ArtNet, listen: str | None, quiet: bool
) -> Receiver:
    """Emulates motors that packets control."""
    with Receiver(stand, controller, *(address_of(listen, "--listen") or ())) as receiver:
        print_output("{}:{}".format(*receiver.address))
        sys.stdout.flush()
        with contextlib.suppress(KeyboardInterrupt):
            while not receiver.silent:
                time.sleep(0.1)
    if not quiet:
        seconds = receiver.t[-1] if len(receiver) else 0.0
        print_message(f"{len(receiver)} packets in {seconds:.3f} s, {receiver.n_unreadable} wrong")
    return receiver


def _positions_csv(end: float, positions: Callable[[Times], Array], names: list[str]) -> str:
    t = np.arange(int(end * _SAMPLE_RATE) + 2) / _SAMPLE_RATE
    lines = [",".join(["t [s]", *names])]
    for t_sample, row in zip(t, positions(t), strict=True):
        lines.append(",".join([f"{t_sample:.3f}", *(f"{x:.4f}" for x in row)]))
    return "\n".join([*lines, ""])


def _load_points(
    options: StandMotionOptions, stand: Stand | str, run: Path, display: ProgressDisplay
) -> SetPoints:
    marionette, trajectory = load_run(run, options.puppet, display)
    display.stage("checking, and computing set points")
    points = set_points(
        stand,
        trajectory,
        marionette,
        rate=options.rate,
        controller=options.controller,
        home=options.home,
        slack=1e-3 * options.slack,
        park=options.park,
        force=options.force or options.anyway,
    )
    if points.warning:
        print_message(points.warning)
    return points
