"""``fantoccini simulate``: puppet, inputs and start -> numbers, pictures and film."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import typer

from fantoccini.cli.files import fail, marionette
from fantoccini.cli.guard import FAILED, INTERRUPTED
from fantoccini.cli.look import Look
from fantoccini.cli.outputs import check_outputs, write_outputs
from fantoccini.cli.report import report
from fantoccini.cli.start import read_values, start_state
from fantoccini.cli.take import on_winches, start_of, take_of
from fantoccini.cli.terminal import Steps, say
from fantoccini.cli.warn import warn
from fantoccini.errors import SimulationError, Status
from fantoccini.marionette import Event, Marionette, Method, MethodName, as_method
from fantoccini.motion import Input, State, Trajectory
from fantoccini.simulation import INTEGRATORS, simulate

LONGEST = 3600.0
"""Longest run on the command line [s]."""
MOST_STEPS = 10_000_000
"""Most steps of a run with a fixed step."""
_MOST_ROWS = 500_000
"""Steps from which only some are written."""
_STILL = 5.0
"""Duration of a run without inputs [s]."""
_DT = 0.002


@dataclass(frozen=True)
class Request:
    """What was asked for on the command line; see ``fantoccini simulate --help``."""

    file: str
    inputs: Path | None
    duration: float | None
    method: str
    string_model: str
    dt: float | None
    rtol: float | None
    integrator: str | None
    start: tuple[str, ...]
    out: tuple[Path, ...]
    plot: Path | None
    quiet: bool
    rate: float | None
    look: Look


def simulate_file(request: Request) -> None:
    """Simulates, prints a summary and writes the outputs.

    A run that stops before its end still leaves what it has, and ends with exit code 1.
    """
    _check_options(request)
    check_outputs(request.out, request.plot)
    request.look.check(request.out, request.plot)
    given = read_values(request.start)
    with Steps(request.quiet) as steps:
        made = marionette(request.file, steps.step, request.string_model)
        inputs = None if request.inputs is None else Input.load(made, request.inputs)
        take = take_of(request.inputs)
        if take is not None:
            made = on_winches(made, take, request.quiet)
        if not request.quiet:
            warn(made, request.file, inputs, request.inputs)
        duration = _duration(request, inputs)
        x0 = None if take is None or given else start_of(made, take)
        if x0 is None:
            x0 = start_state(made, inputs, given, request.quiet)
        method, saved = _method(request, x0.t, duration)
        run, seconds, trouble = timed(steps, made, x0, inputs, duration, method, **saved)
        write_outputs(made, run, request.out, request.plot, steps, look=request.look)
    if not request.quiet:
        report(run, seconds)
        _hint(request, run, seconds)
    end_with(run, trouble)


def timed(
    steps: Steps,
    marionette: Marionette,
    x0: State,
    inputs: Input | None,
    duration: float,
    method: Method | MethodName = "event",
    **saved: Any,
) -> tuple[Trajectory, float, str]:
    """Runs with a progress bar; a run that stops before its end gives what it has.

    Returns:
        The run, the time it took [s], and why it stopped before its end (or nothing).
    """
    done = steps.bar(f"simulating {duration:g} s", duration)
    began, trouble = time.perf_counter(), ""
    try:
        run = simulate(
            marionette,
            x0,
            inputs,
            x0.t + duration,
            method=method,
            progress=lambda t: done(t - x0.t),
            **saved,
        )
    except SimulationError as error:
        if error.trajectory is None:
            raise
        run, trouble = error.trajectory, str(error)
    return run, time.perf_counter() - began, trouble


def end_with(run: Trajectory, trouble: str) -> None:
    """Ends the command with the exit code of a run's status, and says why it stopped."""
    if trouble:
        say(f"fantoccini: {trouble}")
        raise typer.Exit(INTERRUPTED if run.status is Status.STOPPED else FAILED)


def _hint(request: Request, run: Trajectory, seconds: float) -> None:
    """Says what makes a run faster that was slower than the motion it made."""
    if run.method == "event" and seconds > run.duration > 0.0:
        fewer = "" if request.rate else "; --rate 60 writes fewer rows"
        say(
            f"slower than real time: {seconds / run.duration:.3g} s for a second of motion; "
            f"--method timestepping is faster, at the accuracy of its step{fewer}"
        )


def _method(request: Request, start: float, duration: float) -> tuple[Method, dict[str, Any]]:
    """The method, and which rows are written: of a very long run with a fixed step, some."""
    rate = request.rate
    if rate is not None and rate * duration > _MOST_ROWS:
        fail(f"{rate * duration:.3g} rows are more than {_MOST_ROWS:g}; make it smaller", "--rate")
    if request.method == "event":
        tolerances = {} if request.rtol is None else {"rtol": request.rtol, "atol": request.rtol}
        method = Event(integrator=request.integrator, **tolerances)
        if rate is None:
            return method, {}
        times = start + np.arange(1, int(rate * duration) + 1) / rate
        return method, {"save_at": times[times <= start + duration]}
    dt = request.dt or _DT
    n = duration / dt
    if n > MOST_STEPS:
        fail(f"{n:.3g} steps are more than {MOST_STEPS:g}; make it larger", "--dt")
    if rate is not None and rate * dt > 1.0 + 1e-9:
        fail(f"steps of {dt:g} s give {1.0 / dt:g} rows a second at most", "--rate")
    # Between two numbers of steps the smaller one: as many rows as were asked for, or more.
    every = 1 if rate is None else int(1.0 / (rate * dt) + 1e-9)
    every = max(every, math.ceil(n / _MOST_ROWS))
    return as_method(request.method, dt=dt), {"save_every": every}


def _check_options(request: Request) -> None:
    """An option of the other method is a mistake."""
    if request.method == "event":
        if request.dt is not None:
            fail(
                "it goes with --method timestepping or variational; event chooses its steps", "--dt"
            )
        if request.rtol is not None and not 1e-13 <= request.rtol <= 0.1:
            fail(f"{request.rtol:g} is not between 1e-13 and 0.1", "--rtol")
        if request.integrator is not None and request.integrator not in INTEGRATORS:
            fail(f"{request.integrator} is none of {', '.join(INTEGRATORS)}", "--integrator")
    elif request.rtol is not None:
        fail(f"it goes with --method event; {request.method} has --dt", "--rtol")
    elif request.integrator is not None:
        fail(f"it goes with --method event; {request.method} has its own", "--integrator")


def _duration(request: Request, inputs: Input | None) -> float:
    if request.duration is not None:
        duration = request.duration
    else:
        duration = _STILL if inputs is None else inputs.duration
    if duration > LONGEST:
        fail(
            f"{duration:g} s is longer than {LONGEST:g} s; in Python there is no bound",
            "--duration",
        )
    return duration
