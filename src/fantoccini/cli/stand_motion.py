"""``fantoccini stand export``, ``stream`` and ``emulate``: runs as motions of real motors."""

from __future__ import annotations

import signal
import sys
import threading
from pathlib import Path
from types import FrameType

import numpy as np
import typer

from fantoccini.cli.files import check_output, fail, writing
from fantoccini.cli.guard import INTERRUPTED
from fantoccini.cli.stand import motion_of
from fantoccini.cli.stand_requests import (
    StandExportRequest,
    StandMotionOptions,
    StandStreamRequest,
)
from fantoccini.cli.terminal import Steps, say, write
from fantoccini.errors import StandError, StreamError
from fantoccini.files import replacing
from fantoccini.stand import (
    Emulator,
    GrblMachine,
    SetPoints,
    check_stand,
    controller_of,
    gcode,
    grbl_settings,
    lines_of,
    load_stand,
    resumed,
    save_points,
    serial_port,
    set_points,
    stream,
)
from fantoccini.stand.controllers import Grbl, Marlin
from fantoccini.stand.point_files import ENDINGS
from fantoccini.stand.streaming import Line, Progress

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
    """Sends G-code to a port."""
    with Steps(request.quiet) as steps:
        points = _points(request, request.stand, request.run, steps)
        controller = points.controller
        if not isinstance(controller, Grbl | Marlin):
            raise StandError(
                f"{controller.type} takes no G-code over a serial port from here; needed: grbl, "
                "fluidnc or marlin (--controller); `stand export` writes files for the others"
            )
        steps.step("timing the moves")
        text = gcode(points)
    lines = lines_of(text) if request.from_line is None else resumed(text, request.from_line)
    if request.dry_run:
        for line in lines:
            write(line.text)
        return
    name = request.port or controller.port
    if name is None:
        fail("the stand's controller names no port; needed: --port NAME", "--port")
    _send(name, request.baud or controller.baud, lines, controller, request.quiet)


def _send(name: str, baud: int, lines: list[Line], controller: Grbl | Marlin, quiet: bool) -> None:
    hold, progress = threading.Event(), Progress()
    before = signal.signal(signal.SIGINT, lambda *_: hold.set())
    counting = isinstance(controller, Grbl)
    buffer = controller.buffer if isinstance(controller, Grbl) else 4096
    try:
        with serial_port(name, baud) as port:
            stream(port, lines, buffer, counting, progress=progress, hold=hold, go_on=_ask)
    except StreamError as error:
        say(f"fantoccini: {error}")
        if progress.last:
            say(f"the controller took all lines up to {progress.last}; when it is where it was, "
                f"go on with --from-line {error.line}")  # fmt: skip
        raise typer.Exit(INTERRUPTED if error.reason == "stopped here" else 1) from None
    finally:
        signal.signal(signal.SIGINT, before)
    if not quiet:
        write(f"{progress.done} lines; up to {progress.most} characters were under way")


def _ask(progress: Progress) -> bool:
    """Whether a held motion is to go on."""
    say(f"held after line {progress.last}; Enter goes on, Ctrl-C stops")
    before = signal.signal(signal.SIGINT, _interrupt)
    try:
        return bool(sys.stdin.readline())
    except KeyboardInterrupt:
        return False
    finally:
        signal.signal(signal.SIGINT, before)


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def emulate(
    stand: str, controller: str | None, rate: float, out: Path | None, quiet: bool
) -> None:
    """Serves until a program ends."""
    if out is not None:
        check_output(out, (".csv",), "--out")
    read = load_stand(stand)
    settings = grbl_settings(read, controller_of(read, controller), rate)
    machine, ended = GrblMachine(settings), threading.Event()

    def heard(text: str, answer: str) -> None:
        if not quiet and answer != "ok":
            say(f"{text}: {answer}")
        if text in ("M2", "M30"):
            ended.set()

    with Emulator(machine, heard=heard) as emulator:
        write(emulator.port)
        sys.stdout.flush()
        try:
            while not ended.wait(0.1):
                pass
        except KeyboardInterrupt:
            pass
        ended.wait(0.1)  # for the last answer to be read
    machine.planner.finish()
    if not quiet:
        say(
            f"{len(emulator.lines)} lines, {machine.planner.time:.3f} s of motion, buffer at most "
            f"{emulator.fullest} characters, {emulator.overrun} lost"
        )
    if out is not None:
        with writing(out), replacing(out) as temporary:
            temporary.write_text(_table(machine, list(read.file.axes)), encoding="utf-8")


def _table(machine: GrblMachine, names: list[str]) -> str:
    t = np.arange(int(machine.planner.time * _SAMPLED) + 2) / _SAMPLED
    lines = [",".join(["t [s]", *names])]
    for time, row in zip(t, machine.positions(t), strict=True):
        lines.append(",".join([f"{time:.3f}", *(f"{x:.4f}" for x in row)]))
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
        read, moved, made, rate=options.rate, controller=options.controller, home=options.home,
        slack=1e-3 * options.slack, park=options.park, anyway=True,
    )  # fmt: skip
