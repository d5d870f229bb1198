"""``fantoccini stand export``, ``stream`` and ``emulate``: runs as motions of real motors."""

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
from fantoccini.app.cli.stand_requests import (
    StandExportRequest,
    StandMotionOptions,
    StandStreamRequest,
)
from fantoccini.app.cli.stand_sending import send_lines, send_packets
from fantoccini.app.console import Steps, check_output, fail, say, write, writing
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
"""Set points per second that an emulated GRBL is set up for."""
_SAMPLED = 100.0
"""Times per second at which the emulator's motors are written."""


def export(request: StandExportRequest) -> None:
    """Writes set points."""
    check_output(request.out, ENDINGS, "OUT")
    with Steps(request.quiet) as steps:
        points = _points(request, request.stand, request.run, steps)
        steps.step(f"writing {request.out}")
        with writing(request.out):
            save_points(points, request.out)
    if not request.quiet:
        seconds = points.motion.t[-1]
        write(f"{request.out}: {len(points)} set points of {len(points.axes)} axes, {seconds:g} s")


def stream_run(request: StandStreamRequest) -> None:
    """Sends set points to a controller: G-code to a serial port, or packets over a network."""
    with Steps(request.quiet) as steps:
        points = _points(request, request.stand, request.run, steps)
    if isinstance(points.controller, Osc | ArtNet):
        send_packets(points, request)
    elif isinstance(points.controller, Grbl | Marlin):
        send_lines(points, request)
    else:
        raise StandError(
            f"{points.controller.type} takes neither G-code over a serial port nor packets from "
            "here; needed: grbl, fluidnc, marlin, osc or artnet (--controller); `stand export` "
            "writes files for the others"
        )


def emulate(
    stand: str,
    controller: str | None,
    rate: float | None,
    listen: str | None,
    out: Path | None,
    quiet: bool,
) -> None:
    """Serves until a program ends, or packets come no more."""
    if out is not None:
        check_output(out, (".csv",), "--out")
    read = load_stand(stand)
    kind = controller_of(read, controller)
    names = list(read.axes)
    if isinstance(kind, Osc | ArtNet):
        if rate is not None:
            fail(f"applies to G-code, and the controller is {kind.type}", "--rate")
        heard = _listen(read, kind, listen, quiet)
        where = _table(heard.t[-1], heard.positions, names) if len(heard) else ""
    else:
        if listen is not None:
            fail(f"applies to osc and artnet, and the controller is {kind.type}", "--listen")
        machine = _serve(grbl_settings(read, kind, rate or _RATE), quiet)
        where = _table(machine.time, machine.positions, names)
    if out is not None and where:
        with writing(out), replacing(out) as temporary:
            temporary.write_text(where, encoding="utf-8")


def _serve(settings: GrblSettings, quiet: bool) -> GrblMachine:
    """GRBL on a pseudo-terminal."""
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
            f"{len(emulator.lines)} lines, {machine.time:.3f} s of motion, buffer at most "
            f"{emulator.fullest} characters, {emulator.overrun} lost"
        )
    return machine


def _listen(stand: Stand, controller: Osc | ArtNet, listen: str | None, quiet: bool) -> Receiver:
    """Motors that packets send."""
    with Receiver(stand, controller, *(address_of(listen, "--listen") or ())) as heard:
        write("{}:{}".format(*heard.address))
        sys.stdout.flush()
        with contextlib.suppress(KeyboardInterrupt):
            while not heard.silent:
                time.sleep(0.1)
    if not quiet:
        seconds = heard.t[-1] if len(heard) else 0.0
        say(f"{len(heard)} packets in {seconds:.3f} s, {heard.wrong} wrong")
    return heard


def _table(end: float, positions: Callable[[Times], Array], names: list[str]) -> str:
    t = np.arange(int(end * _SAMPLED) + 2) / _SAMPLED
    lines = [",".join(["t [s]", *names])]
    for at, row in zip(t, positions(t), strict=True):
        lines.append(",".join([f"{at:.3f}", *(f"{x:.4f}" for x in row)]))
    return "\n".join([*lines, ""])


def _points(options: StandMotionOptions, stand: str, run: Path, steps: Steps) -> SetPoints:
    read = load_stand(stand)
    made, moved = motion_of(run, options.puppet, steps)
    if not options.anyway:
        steps.step("checking")
        found = check_stand(read, moved, made)
        if not found.ok:
            raise StandError(
                f"{found.summary()}; `fantoccini stand check` says what would help, and --anyway "
                "exports it all the same"
            )
    steps.step("making set points")
    return set_points(
        read,
        moved,
        made,
        rate=options.rate,
        controller=options.controller,
        home=options.home,
        slack=1e-3 * options.slack,
        park=options.park,
        anyway=True,
    )
