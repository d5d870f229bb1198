"""``fantoccini simulate``: puppet, inputs and start -> numbers, pictures and film."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import typer

from fantoccini.app.console import (
    FAILED,
    INTERRUPTED,
    Motion,
    SimulateRequest,
    Steps,
    StringModel,
    check_bodies,
    check_outputs,
    fail,
    load_recording,
    marionette,
    motion,
    read_values,
    recorded_start,
    report,
    report_lateness,
    report_score,
    say,
    start_state,
    warn,
    with_recorded_winches,
    write_outputs,
)
from fantoccini.base import SimulationError, Status
from fantoccini.dynamics.compiled import Event, Method, MethodName, TimeStepping, Variational
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate
from fantoccini.motion import Input, State, Trajectory


@dataclass(frozen=True)
class _Bounds:
    """Bounds on runs from the command line; Python has none.

    Attributes:
        duration: of a run [s].
        steps: of a run with a fixed step.
        samples: that are saved; a longer run with a fixed step saves every second one, or fewer.
        rtol: smallest and largest relative tolerance.
    """

    duration: float = 3600.0
    steps: int = 10_000_000
    samples: int = 500_000
    rtol: tuple[float, float] = (1e-13, 0.1)


_BOUNDS = _Bounds()
_DURATION_WITHOUT_INPUTS = 5.0
"""[s]"""
_DT = 0.002
"""Default time step [s]."""


def simulate_file(request: SimulateRequest) -> None:
    """Simulates, prints a summary and writes the outputs.

    If the run stops early, the outputs hold the motion so far and the exit code is 1.
    """
    _check_options(request)
    out, look = request.out or [], request.look
    check_outputs(out, request.plot)
    look.check(out, request.plot)
    given = read_values(request.start or [])
    with Steps(request.quiet) as steps:
        chain = request.string_model is StringModel.CHAIN
        puppet = marionette(request.file, steps.named, "chain" if chain else "constraint")
        check_bodies(puppet, look)
        given_motion = _given(puppet, request, steps)
        inputs = None if given_motion is None else given_motion.inputs
        recording = load_recording(request.inputs)
        if recording is not None:
            puppet = with_recorded_winches(puppet, recording, request.quiet)
        if not request.quiet:
            warn(puppet, request.file, inputs, request.inputs)
        duration = _duration(request, inputs)
        x0 = None if recording is None or given else recorded_start(puppet, recording)
        if x0 is None:
            x0 = start_state(puppet, inputs, given, request.quiet)
        method, saved = _method(request, x0.t, duration)
        saved["time_limit"] = request.time_limit
        run, seconds, trouble = timed(steps, puppet, x0, inputs, duration, method, **saved)
        films = {} if given_motion is None else given_motion.of_films
        write_outputs(puppet, run, out, request.plot, steps, look=look, films=films)
    if not request.quiet:
        if given_motion is not None:
            if given_motion.score is not None:
                report_score(given_motion.score, out)
            if given_motion.rehearsal is not None:
                report_lateness(given_motion.rehearsal)
        report(run, seconds)
        suggest_faster(request, run, seconds)
    end_with(run, trouble)


def _given(puppet: Marionette, request: SimulateRequest, steps: Steps) -> Motion | None:
    """The motion of ``--inputs``, rehearsed if that is asked for."""
    if request.inputs is None:
        if request.on_beat:
            fail("applies to a score, but no --inputs are given", "--on-beat")
        return None
    found = motion(puppet, request.inputs)
    for change in found.changes:
        say(str(change))
    if not request.on_beat:
        return found
    if found.score is None:
        fail(f"applies to a score, and {request.inputs} is none", "--on-beat")
    if request.start:
        fail("applies to a puppet that hangs at rest, and --start is given", "--on-beat")
    steps.step("rehearsing")
    return found.rehearsed()


def timed(
    steps: Steps,
    marionette: Marionette,
    x0: State,
    inputs: Input | None,
    duration: float,
    method: Method | MethodName = "event",
    **saved: Any,
) -> tuple[Trajectory, float, str]:
    """Simulates with a progress bar.

    Returns:
        The run, its computing time [s], and why it stopped early, or "".
    """
    began, trouble = time.perf_counter(), ""
    try:
        run = simulate(
            marionette,
            x0,
            inputs,
            x0.t + duration,
            method=method,
            progress=steps.bar(f"simulating {duration:g} s"),
            **saved,
        )
    except SimulationError as error:
        if error.trajectory is None:
            raise
        run, trouble = error.trajectory, str(error)
    return run, time.perf_counter() - began, trouble


def end_with(run: Trajectory, trouble: str) -> None:
    """If a run stopped early, prints why and exits with the code of its status."""
    if trouble:
        say(f"fantoccini: {trouble}")
        raise typer.Exit(INTERRUPTED if run.status is Status.STOPPED else FAILED)


def suggest_faster(request: SimulateRequest, run: Trajectory, seconds: float) -> None:
    """Suggests faster options after a run slower than real time."""
    if run.method == "event" and seconds > run.duration > 0.0:
        fewer = "" if request.rate else "; --rate 60 saves fewer samples"
        say(
            f"slower than real time: {seconds / run.duration:.3g} s per second of motion; "
            f"--method timestepping is faster and less accurate{fewer}"
        )


def _method(
    request: SimulateRequest, start: float, duration: float
) -> tuple[Method, dict[str, Any]]:
    """The method, and the arguments of ``simulate`` that select the samples to save."""
    rate = request.rate
    if rate is not None and rate * duration > _BOUNDS.samples:
        fail(f"{rate * duration:.3g} samples exceed the limit of {_BOUNDS.samples:g}", "--rate")
    if request.method == "event":
        tolerances = {} if request.rtol is None else {"rtol": request.rtol, "atol": request.rtol}
        method = Event(**tolerances)
        if rate is None:
            return method, {}
        times = start + np.arange(1, int(rate * duration) + 1) / rate
        return method, {"save_at": times[times <= start + duration]}
    dt = request.dt or _DT
    n = duration / dt
    if n > _BOUNDS.steps:
        fail(f"{n:.3g} steps exceed the limit of {_BOUNDS.steps:g}; increase the step", "--dt")
    if rate is not None and rate * dt > 1.0 + 1e-9:
        fail(f"steps of {dt:g} s give at most {1.0 / dt:g} samples per second", "--rate")
    # Rounded down, so that there are at least as many samples as requested.
    every = 1 if rate is None else int(1.0 / (rate * dt) + 1e-9)
    every = max(every, math.ceil(n / _BOUNDS.samples))
    fixed = TimeStepping(dt=dt) if request.method == "timestepping" else Variational(dt=dt)
    return fixed, {"save_every": every}


def _check_options(request: SimulateRequest) -> None:
    """Raises a usage error for an option that the method does not have."""
    if request.method == "event":
        if request.dt is not None:
            fail("applies to --method timestepping or variational only", "--dt")
        low, high = _BOUNDS.rtol
        if request.rtol is not None and not low <= request.rtol <= high:
            fail(f"{request.rtol:g} is not between {low:g} and {high:g}", "--rtol")
    elif request.rtol is not None:
        fail(f"applies to --method event only; {request.method} has --dt", "--rtol")


def _duration(request: SimulateRequest, inputs: Input | None) -> float:
    if request.duration is not None:
        duration = request.duration
    else:
        duration = _DURATION_WITHOUT_INPUTS if inputs is None else inputs.duration
    if duration > _BOUNDS.duration:
        fail(
            f"{duration:g} s is longer than {_BOUNDS.duration:g} s; use Python for longer runs",
            "--duration",
        )
    return duration
