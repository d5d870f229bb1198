"""``fantoccini optimise``: the motion of least cost of a task file."""

from __future__ import annotations

from pathlib import Path

import typer

from fantoccini.app.cli.show import show_run
from fantoccini.app.console import (
    FAILED,
    INTERRUPTED,
    OptimiseRequest,
    Steps,
    check_extras,
    check_outputs,
    fail,
    say,
    table,
    write,
    write_outputs,
    writing,
)
from fantoccini.control.optimal import Optimum, optimise, out_of_reach
from fantoccini.control.tasks import AnswerStatus, load_task, task_names
from fantoccini.theatre.perform import Recording


def optimise_file(request: OptimiseRequest) -> None:
    """Optimises, prints a summary and writes the outputs.

    Exit code 1 where the motion leaves its bounds or does not reach its end; 130 after Ctrl-C, with
    the best motion so far.
    """
    if request.file is None:
        for name in task_names():
            write(name)
        return
    _check_options(request)
    with Steps(request.quiet) as steps:
        task = load_task(request.file, progress=steps.named)
        if request.check:
            if not request.quiet:
                write(f"{request.file}: no mistakes")
            return
        steps.step("looking for poses that reach the paths")
        for text in out_of_reach(task):
            say(f"fantoccini: {text}")
        found = optimise(
            task,
            tolerance=request.tolerance,
            cost_tolerance=request.cost_tolerance,
            iterations=request.iterations,
            time_limit=request.time_limit,
            threads=request.threads,
            seed=request.seed,
            progress=steps.bar("optimising"),
        )
        _write(request, found, steps)
    if not request.quiet:
        _report(found)
    if request.show:
        show_run(task.marionette, found.run, request.quiet)
    if not found.holds:
        say(f"fantoccini: {found.message}")
        raise typer.Exit(FAILED)
    if found.status is AnswerStatus.STOPPED:
        raise typer.Exit(INTERRUPTED)


def _check_options(request: OptimiseRequest) -> None:
    """Raises a usage error for outputs that cannot be written."""
    out = request.out or []
    check_outputs(out, None)
    request.look.check(out, request.picture)
    check_extras(request.picture, request.save)
    given = {"--out": out, "--picture": request.picture, "--save": request.save}
    if request.check and any(given.values()):
        fail("writes nothing; it goes without --out, --picture and --save", "--check")


def _write(request: OptimiseRequest, found: Optimum, steps: Steps) -> None:
    marionette = found.task.marionette
    if request.save is not None:
        _save(request.save, found, steps)
    if request.picture is not None:
        steps.step(f"drawing {request.picture}")
        with writing(request.picture):
            found.plot(request.picture, **request.look.given("theme"))
    write_outputs(marionette, found.run, request.out or [], None, steps, look=request.look)


def _save(path: Path, found: Optimum, steps: Steps) -> None:
    """Writes the inputs as a recording: accelerations that hold over every interval."""
    steps.step(f"writing {path}")
    task, nodes = found.task, found.nodes
    n = max(1, round(nodes.interval / task.dt))
    with writing(path):
        start = found.run.state(0)
        Recording(found.marionette, start, nodes.acc_K, nodes.interval, n).save(path)


def _report(found: Optimum) -> None:
    low, high = found.task.durations
    lines: list[tuple[str, object]] = [
        ("status", found.status.name.lower()),
        ("duration [s]", f"{found.t[-1] - found.t[0]:.4g}"),
        ("cost", found.cost),
        ("KKT residual", f"{found.kkt:.2g}"),
        ("iterations", found.iterations),
        ("time [s]", f"{found.seconds:.3g}"),
        ("beyond its bounds", f"{found.violation:.2g}"),
    ]
    if low < high:
        lines[1] = (f"duration, of {low:g} to {high:g} [s]", lines[1][1])
    if found.task.goal is not None:
        lines.append(("from its end", f"{found.end_gap:.2g}"))
    lines += list(found.parameters.items())
    table("Optimum", ("", ">"), lines)
    table(
        "Distance from the paths (m, rad or their rates)",
        ("", "root mean square>", "largest>"),
        [(name, found.rms()[name], float(e.max())) for name, e in found.errors().items()],
    )
    table(
        "Touches",
        ("", "place", "time [s]>", "distance [m]>"),
        [
            (
                one.touch.body,
                ", ".join(f"{x:.4g}" for x in one.touch.place),
                f"{one.t:.4f}",
                f"{one.distance:.2g}",
            )
            for one in found.touched
        ],
    )
    table(
        "Strings",
        ("name", "min [N]>", "max [N]>"),
        [(name, float(T.min()), float(T.max())) for name, T in found.run.tension.items()],
    )
    write(found.message)
    for text in found.reservations:
        write(text)
