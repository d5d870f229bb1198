"""``fantoccini simulate``: simulates a puppet and writes numbers, pictures and films.

A method of integration is event-driven, time-stepping or variational. A score times gestures; a cue
is one of its lines.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import typer

from fantoccini.app.cli_support import (
    FAILED,
    INTERRUPTED,
    FileMotion,
    OutputError,
    ProgressDisplay,
    SimulateArguments,
    StringModel,
    check_bodies,
    check_captions,
    check_outputs,
    check_time_range,
    fail,
    load_marionette,
    load_motion,
    load_recording,
    print_message,
    read_values,
    recorded_start,
    report_lateness,
    report_run,
    report_score,
    start_state,
    warn_implausible,
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
    """Bounds on runs from the command line; the Python functions have none.

    Attributes:
        duration: longest run [s].
        n_steps: largest number of time steps of a method with a fixed step.
        n_samples: largest number of saved samples; longer runs with a fixed step save fewer per
            second.
        rtol: smallest and largest relative tolerance.
    """

    duration: float = 3600.0
    n_steps: int = 10_000_000
    n_samples: int = 500_000
    rtol: tuple[float, float] = (1e-13, 0.1)


_BOUNDS = _Bounds()
_DURATION_WITHOUT_INPUTS = 5.0
"""Duration of a run without inputs [s]."""
_DT = 0.002
"""Default time step [s]."""


def simulate_file(arguments: SimulateArguments) -> None:
    """Simulates, prints a summary and writes the outputs.

    If the run stops early, the outputs contain the motion so far and the exit code is 1.
    """
    _check_options(arguments)
    out, output_options = arguments.out or [], arguments.output_options
    check_outputs(out, arguments.plot, captions=True)
    output_options.check(out, arguments.plot)
    start_values = read_values(arguments.start or [])
    with ProgressDisplay(arguments.quiet) as display:
        chain = arguments.string_model is StringModel.CHAIN
        puppet = load_marionette(arguments.file, display.update, "chain" if chain else "constraint")
        check_bodies(puppet, output_options)
        file_motion = _input_motion(puppet, arguments, display)
        inputs = None if file_motion is None else file_motion.inputs
        film_options = {} if file_motion is None else file_motion.film_options
        check_captions(out, film_options.get("captions", ()))
        recording = load_recording(arguments.inputs)
        if recording is not None:
            puppet = with_recorded_winches(puppet, recording, arguments.quiet)
        if not arguments.quiet:
            warn_implausible(puppet, arguments.file, inputs, arguments.inputs)
        duration = _duration(arguments, inputs)
        if inputs is None and puppet.coordinates.n_vK and not arguments.quiet:
            print_message(
                f"nothing moves the driven coordinates in these {duration:g} s; --inputs takes a "
                "file, a score of gestures or a bundled performance (`fantoccini info` lists them)"
            )
        x0 = None if recording is None or start_values else recorded_start(puppet, recording)
        if x0 is None:
            x0 = start_state(puppet, inputs, start_values, arguments.quiet)
        check_time_range(arguments.begin, arguments.end, x0.t, x0.t + duration)
        method, options = _method_and_sampling(arguments, x0.t, duration)
        options["time_limit"] = arguments.time_limit
        run, seconds, reason = simulate_with_progress(
            display, puppet, x0, inputs, duration, method, **options
        )
        output_error = None
        try:
            write_outputs(
                puppet,
                run,
                out,
                arguments.plot,
                display,
                output_options=output_options,
                film_options=film_options,
            )
        except OutputError as error:
            output_error = error  # the summary of the run comes first
    if not arguments.quiet:
        if file_motion is not None:
            if file_motion.score is not None:
                report_score(file_motion.score, out)
            if file_motion.rehearsal is not None:
                report_lateness(file_motion.rehearsal)
        report_run(run, seconds)
        suggest_faster(arguments, run, seconds)
    if output_error is not None:
        raise output_error
    exit_if_stopped(run, reason)


def _input_motion(
    puppet: Marionette, arguments: SimulateArguments, display: ProgressDisplay
) -> FileMotion | None:
    """Motion of ``--inputs``; ``--on-beat`` shifts its cues so that limbs arrive on time."""
    if arguments.inputs is None:
        if arguments.on_beat:
            fail("applies to a score, but no --inputs are given", "--on-beat")
        return None
    file_motion = load_motion(puppet, arguments.inputs)
    for change in file_motion.changes:
        print_message(str(change))
    if not arguments.on_beat:
        return file_motion
    if file_motion.score is None:
        fail(f"applies to a score, and {arguments.inputs} is not a score", "--on-beat")
    if arguments.start:
        fail("applies to a puppet that starts at rest, but --start is given", "--on-beat")
    display.stage("rehearsing")
    return file_motion.rehearsed()


def simulate_with_progress(
    display: ProgressDisplay,
    marionette: Marionette,
    x0: State,
    inputs: Input | None,
    duration: float,
    method: Method | MethodName = "event",
    **options: Any,
) -> tuple[Trajectory, float, str]:
    """Simulates with a progress bar.

    Returns:
        The run, its computing time [s], and the reason why it stopped early (else empty).
    """
    start_time, reason = time.perf_counter(), ""
    try:
        run = simulate(
            marionette,
            x0,
            inputs,
            x0.t + duration,
            method=method,
            progress=display.bar(f"simulating {duration:g} s"),
            **options,
        )
    except SimulationError as error:
        if error.trajectory is None:
            raise
        run, reason = error.trajectory, str(error)
    return run, time.perf_counter() - start_time, reason


def exit_if_stopped(run: Trajectory, reason: str) -> None:
    """Prints the reason and exits with the code of the status, if a run stopped early."""
    if reason:
        print_message(f"fantoccini: {reason}")
        raise typer.Exit(INTERRUPTED if run.status is Status.STOPPED else FAILED)


def suggest_faster(arguments: SimulateArguments, run: Trajectory, seconds: float) -> None:
    """Suggests faster options after a run slower than real time."""
    if run.method == "event" and seconds > run.duration > 0.0:
        rate_hint = "" if arguments.rate else "; --rate 60 saves fewer samples"
        print_message(
            f"slower than real time: {seconds / run.duration:.3g} s per second of motion; "
            f"--method timestepping is faster and less accurate{rate_hint}"
        )


def _method_and_sampling(
    arguments: SimulateArguments, start: float, duration: float
) -> tuple[Method, dict[str, Any]]:
    """Method, and the arguments of :func:`simulate` that select the samples to save."""
    rate = arguments.rate
    if rate is not None and rate * duration > _BOUNDS.n_samples:
        fail(f"{rate * duration:.3g} samples exceed the limit of {_BOUNDS.n_samples:g}", "--rate")
    if arguments.method == "event":
        tolerances = (
            {} if arguments.rtol is None else {"rtol": arguments.rtol, "atol": arguments.rtol}
        )
        method = Event(**tolerances)
        if rate is None:
            return method, {}
        times = start + np.arange(1, int(rate * duration) + 1) / rate
        return method, {"save_at": times[times <= start + duration]}
    dt = arguments.dt or _DT
    n_steps = duration / dt
    if n_steps > _BOUNDS.n_steps:
        fail(
            f"{n_steps:.3g} steps exceed the limit of {_BOUNDS.n_steps:g}; increase the step",
            "--dt",
        )
    if rate is not None and rate * dt > 1.0 + 1e-9:
        fail(f"steps of {dt:g} s give at most {1.0 / dt:g} samples per second", "--rate")
    # Rounded down, to save at least as many samples as requested.
    save_every = 1 if rate is None else int(1.0 / (rate * dt) + 1e-9)
    save_every = max(save_every, math.ceil(n_steps / _BOUNDS.n_samples))
    fixed_step = TimeStepping(dt=dt) if arguments.method == "timestepping" else Variational(dt=dt)
    return fixed_step, {"save_every": save_every}


def _check_options(arguments: SimulateArguments) -> None:
    """Raises a usage error for an option that does not apply to the method."""
    if arguments.method == "event":
        if arguments.dt is not None:
            fail("applies to --method timestepping or variational only", "--dt")
        low, high = _BOUNDS.rtol
        if arguments.rtol is not None and not low <= arguments.rtol <= high:
            fail(f"{arguments.rtol:g} is not between {low:g} and {high:g}", "--rtol")
    elif arguments.rtol is not None:
        fail(f"applies to --method event only; {arguments.method} has --dt", "--rtol")


def _duration(arguments: SimulateArguments, inputs: Input | None) -> float:
    if arguments.duration is not None:
        duration = arguments.duration
    else:
        duration = _DURATION_WITHOUT_INPUTS if inputs is None else inputs.duration
    if duration > _BOUNDS.duration:
        fail(
            f"{duration:g} s is longer than {_BOUNDS.duration:g} s; use Python for longer runs",
            "--duration",
        )
    return duration
