"""``fantoccini optimise``: finds the motion of a task with the smallest cost.

A task is a file with a puppet, costs and bounds. acc_K are the accelerations of the driven
coordinates, the ends and lengths of strings.
"""

from __future__ import annotations

from pathlib import Path

import typer

from fantoccini.app.cli.show import show_run
from fantoccini.app.cli_support import (
    FAILED,
    INTERRUPTED,
    OptimiseArguments,
    ProgressDisplay,
    check_extras,
    check_outputs,
    check_time_range,
    fail,
    output_errors,
    print_message,
    print_output,
    print_table,
    write_outputs,
)
from fantoccini.control.optimal import Optimum, check_task, optimise, reach_notes
from fantoccini.control.tasks import AnswerStatus, load_task, task_names
from fantoccini.theatre.perform import Recording


def optimise_file(arguments: OptimiseArguments) -> None:
    """Optimises, prints a summary and writes the outputs.

    Exits with 1 if the motion leaves its bounds or does not reach its end, and with 130 after
    Ctrl-C, with the best motion so far.
    """
    if arguments.file is None:
        for name in task_names():
            print_output(name)
        return
    _check_options(arguments)
    with ProgressDisplay(arguments.quiet) as display:
        task = load_task(arguments.file, progress=display.update)
        if arguments.check:
            check_task(task)
            if not arguments.quiet:
                print_output(f"{arguments.file}: no mistakes")
            return
        start = task.x0.t
        check_time_range(arguments.begin, arguments.end, start, start + task.max_duration)
        display.stage("checking whether poses reach the paths")
        for text in reach_notes(task):
            print_message(f"fantoccini: {text}")
        optimum = optimise(
            task,
            tolerance=arguments.tolerance,
            cost_tolerance=arguments.cost_tolerance,
            iterations=arguments.iterations,
            time_limit=arguments.time_limit,
            threads=arguments.threads,
            seed=arguments.seed,
            progress=display.bar("optimising"),
        )
        _write_files(arguments, optimum, display)
    if not arguments.quiet:
        _print_optimum(optimum)
    if arguments.show:
        show_run(task.marionette, optimum.run, arguments.quiet)
    if not optimum.holds:
        print_message(f"fantoccini: {optimum.message}")
        raise typer.Exit(FAILED)
    if optimum.status is AnswerStatus.STOPPED:
        raise typer.Exit(INTERRUPTED)


def _check_options(arguments: OptimiseArguments) -> None:
    """Raises a usage error if an output cannot be written."""
    out = arguments.out or []
    check_outputs(out, None)
    arguments.output_options.check(out, arguments.picture)
    check_extras(arguments.picture, arguments.save)
    outputs = {"--out": out, "--picture": arguments.picture, "--save": arguments.save}
    if arguments.check and any(outputs.values()):
        fail("writes nothing; omit --out, --picture and --save", "--check")


def _write_files(arguments: OptimiseArguments, optimum: Optimum, display: ProgressDisplay) -> None:
    marionette = optimum.task.marionette
    if arguments.save is not None:
        _save(arguments.save, optimum, display)
    if arguments.picture is not None:
        display.stage(f"drawing {arguments.picture}")
        with output_errors(arguments.picture):
            optimum.plot(arguments.picture, **arguments.output_options.nondefault("theme"))
    write_outputs(
        marionette,
        optimum.run,
        arguments.out or [],
        None,
        display,
        output_options=arguments.output_options,
    )


def _save(path: Path, optimum: Optimum, display: ProgressDisplay) -> None:
    """Writes the inputs as a recording: constant accelerations in every interval."""
    display.stage(f"writing {path}")
    task, nodes = optimum.task, optimum.nodes
    n = max(1, round(nodes.interval / task.dt))
    with output_errors(path):
        start = optimum.run.state(0)
        Recording(optimum.marionette, start, nodes.acc_K, nodes.interval, n).save(path)


def _print_optimum(optimum: Optimum) -> None:
    shortest, longest = optimum.task.durations
    table_lines: list[tuple[str, object]] = [
        ("status", optimum.status.name.lower()),
        ("duration [s]", f"{optimum.duration:.4g}"),
        ("cost", optimum.cost),
        ("KKT residual", f"{optimum.kkt:.2g}"),
        ("iterations", optimum.iterations),
        ("time [s]", f"{optimum.seconds:.3g}"),
        ("violation of bounds", f"{optimum.violation:.2g}"),
    ]
    if shortest < longest:
        table_lines[1] = (f"duration [s], allowed {shortest:g} to {longest:g}", table_lines[1][1])
    if optimum.task.required_end is not None:
        table_lines.append(("distance from its end", f"{optimum.end_gap:.2g}"))
    table_lines += list(optimum.parameters.items())
    print_table("Optimum", ("", ">"), table_lines)
    print_table(
        "Distance from the paths (m, rad or their rates)",
        ("", "root mean square>", "largest>"),
        [(name, optimum.rms()[name], float(e.max())) for name, e in optimum.errors().items()],
    )
    print_table(
        "Touches",
        ("", "place", "time [s]>", "distance [m]>"),
        [
            (
                touched.touch.body,
                ", ".join(f"{x:.4g}" for x in touched.touch.place),
                f"{touched.t:.4f}",
                f"{touched.distance:.2g}",
            )
            for touched in optimum.closest_approaches
        ],
    )
    print_table(
        "Strings",
        ("name", "min [N]>", "max [N]>"),
        [(name, float(T.min()), float(T.max())) for name, T in optimum.run.tension.items()],
    )
    print_output(optimum.message)
    for text in optimum.reservations:
        print_output(text)
