"""``fantoccini stand export``, ``stream`` and ``emulate``: runs as motions of motors."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from fantoccini.app.cli.perform import address_of
from fantoccini.app.cli.stand import motion_of
from fantoccini.app.cli.stand_arguments import (
    StandExportArguments,
    StandMotionOptions,
    StandStreamArguments,
)
from fantoccini.app.cli.stand_sending import send_lines, send_packets
from fantoccini.app.cli_support import Steps, check_output, fail, say, write, writing
from fantoccini.base import Array, StandError, Times, replacing
from fantoccini.stand import (
    ENDINGS,
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
    check_stand,
    controller_of,
    grbl_settings,
    load_stand,
    save_points,
    set_points,
)

_RATE = 50.0
"""Default number of set points per second for which an emulated GRBL is configured."""
_SAMPLE_RATE = 100.0
"""Rate at which the positions of the emulator's motors are written [Hz]."""


def export(arguments: StandExportArguments) -> None:
    """Writes the set points of a run to a file."""
    check_output(arguments.out, ENDINGS, "OUT")
    with Steps(arguments.quiet) as steps:
        points = _points(arguments, arguments.stand, arguments.run, steps)
        steps.step(f"writing {arguments.out}")
        with writing(arguments.out):
            save_points(points, arguments.out)
    if not arguments.quiet:
        seconds = points.motion.t[-1]
        write(
            f"{arguments.out}: {len(points)} set points of {len(points.axes)} axes, {seconds:g} s"
        )


def stream_run(arguments: StandStreamArguments) -> None:
    """Sends the set points of a run: G-code to a serial port, or packets over a network."""
    with Steps(arguments.quiet) as steps:
        points = _points(arguments, arguments.stand, arguments.run, steps)
    if isinstance(points.controller, Osc | ArtNet):
        send_packets(points, arguments)
    elif isinstance(points.controller, Grbl | Marlin):
        send_lines(points, arguments)
    else:
        raise StandError(
            f"{points.controller.type} cannot be streamed to; needed: grbl, fluidnc, marlin, osc "
            "or artnet (--controller); `stand export` writes files for other controllers"
        )


def emulate(
    stand: str,
    controller: str | None,
    rate: float | None,
    listen: str | None,
    out: Path | None,
    quiet: bool,
) -> None:
    """Emulates a controller until a program ends or packets stop."""
    if out is not None:
        check_output(out, (".csv",), "--out")
    loaded_stand = load_stand(stand)
    kind = controller_of(loaded_stand, controller)
    names = list(loaded_stand.axes)
    if isinstance(kind, Osc | ArtNet):
        if rate is not None:
            fail(f"applies to G-code, and the controller is {kind.type}", "--rate")
        receiver = _listen(loaded_stand, kind, listen, quiet)
        csv_text = (
            _positions_csv(receiver.t[-1], receiver.positions, names) if len(receiver) else ""
        )
    else:
        if listen is not None:
            fail(f"applies to osc and artnet, and the controller is {kind.type}", "--listen")
        machine = _serve(grbl_settings(loaded_stand, kind, rate or _RATE), quiet)
        csv_text = _positions_csv(machine.time, machine.positions, names)
    if out is not None and csv_text:
        with writing(out), replacing(out) as temporary:
            temporary.write_text(csv_text, encoding="utf-8")


def _serve(settings: GrblSettings, quiet: bool) -> GrblMachine:
    """Emulates GRBL on a pseudo-terminal."""
    machine, ended = GrblMachine(settings), threading.Event()

    def heard(text: str, answer: str) -> None:
        if not quiet and answer != "ok":
            say(f"{text}: {answer}")
        if text == "M2":
            ended.set()

    with Emulator(machine, heard=heard) as emulator:
        write(emulator.port)
        sys.stdout.flush()
        with contextlib.suppress(KeyboardInterrupt):
            while not ended.wait(0.1):
                pass
        emulator.wait_until_read()
    machine.finish()
    if not quiet:
        say(
            f"{len(emulator.lines)} lines, {machine.time:.3f} s of motion, at most "
            f"{emulator.fullest} characters in the buffer, {emulator.overrun} lost"
        )
    return machine


def _listen(stand: Stand, controller: Osc | ArtNet, listen: str | None, quiet: bool) -> Receiver:
    """Emulates motors that packets control."""
    with Receiver(stand, controller, *(address_of(listen, "--listen") or ())) as receiver:
        write("{}:{}".format(*receiver.address))
        sys.stdout.flush()
        with contextlib.suppress(KeyboardInterrupt):
            while not receiver.silent:
                time.sleep(0.1)
    if not quiet:
        seconds = receiver.t[-1] if len(receiver) else 0.0
        say(f"{len(receiver)} packets in {seconds:.3f} s, {receiver.wrong} wrong")
    return receiver


def _positions_csv(end: float, positions: Callable[[Times], Array], names: list[str]) -> str:
    t = np.arange(int(end * _SAMPLE_RATE) + 2) / _SAMPLE_RATE
    lines = [",".join(["t [s]", *names])]
    for at, row in zip(t, positions(t), strict=True):
        lines.append(",".join([f"{at:.3f}", *(f"{x:.4f}" for x in row)]))
    return "\n".join([*lines, ""])


def _points(options: StandMotionOptions, stand: str, run: Path, steps: Steps) -> SetPoints:
    loaded_stand = load_stand(stand)
    marionette, trajectory = motion_of(run, options.puppet, steps)
    if not (options.force or options.anyway):
        steps.step("checking")
        check = check_stand(loaded_stand, trajectory, marionette)
        if not check.ok:
            raise StandError(
                f"{check.summary()}; `fantoccini stand check` lists remedies; --force exports the "
                "run nevertheless"
            )
    steps.step("computing set points")
    return set_points(
        loaded_stand,
        trajectory,
        marionette,
        rate=options.rate,
        controller=options.controller,
        home=options.home,
        slack=1e-3 * options.slack,
        park=options.park,
        force=True,
    )
