"""``fantoccini plan``: finds inputs that reach the goal of a problem.

A problem is a puppet with its start, a goal, obstacles and bounds.
"""

from __future__ import annotations

import typer

from fantoccini.app.cli.show import show_plan
from fantoccini.app.cli_support import (
    FAILED,
    PlanArguments,
    ProgressDisplay,
    check_extras,
    check_outputs,
    fail,
    print_message,
    print_output,
    print_table,
    write_outputs,
)
from fantoccini.control.planning import Check, PlanResult, solve
from fantoccini.control.problems import load_problem
from fantoccini.control.tasks import problem_names
from fantoccini.dynamics.compiled import Event


def plan_file(arguments: PlanArguments) -> None:
    """Plans, verifies, prints a summary and writes the outputs; exits with 1 without a plan."""
    if arguments.file is None:
        for name in problem_names():
            print_output(name)
        return
    out = arguments.out or []
    check_outputs(out, None)
    arguments.output_options.check(out, arguments.picture)
    check_extras(arguments.picture, arguments.save)
    if arguments.seed < 0:
        fail(f"{arguments.seed} is negative", "--seed")
    options = {} if arguments.tolerance is None else {"tolerance": arguments.tolerance}
    objective = None if arguments.objective is None else arguments.objective.value
    with ProgressDisplay(arguments.quiet) as display:
        problem = load_problem(
            arguments.file, threads=arguments.threads, progress=display.update, **options
        )
        display.stage("planning")
        result = solve(
            problem,
            planner=arguments.planner.value,
            time_limit=arguments.time_limit,
            improve=arguments.improve,
            confirm=arguments.confirm,
            objective=objective,
            seed=arguments.seed,
        )
        checks = {}
        if result and not arguments.quiet:
            display.stage("verifying")
            checks = {"step halved": result.verify()}
            if problem.touches.expected:
                checks["step quartered"] = result.verify(0.25)
            else:
                checks["event-driven"] = result.verify(method=Event(rtol=1e-9, atol=1e-9))
        if not result.reason:
            _write_outputs(arguments, result, display)
    if not arguments.quiet:
        _print_report(result, checks)
    if not result:
        print_message(f"fantoccini: {result.message}")
        if arguments.show and not result.reason:
            show_plan(result, arguments.quiet)
        raise typer.Exit(FAILED)
    if arguments.show:
        show_plan(result, arguments.quiet)


def _write_outputs(arguments: PlanArguments, result: PlanResult, display: ProgressDisplay) -> None:
    if arguments.save is not None:
        result.save(arguments.save)
    if arguments.picture is not None:
        display.stage(f"drawing {arguments.picture}")
        result.plot(arguments.picture, **arguments.output_options.nondefault("theme"))
    puppet = result.problem.drawn_marionette
    write_outputs(
        puppet,
        result.trajectory,
        arguments.out or [],
        None,
        display,
        output_options=arguments.output_options,
    )


def _print_report(result: PlanResult, checks: dict[str, Check]) -> None:
    print_table(
        "Plan",
        ("", ">"),
        [
            ("status", result.status.name.lower()),
            ("duration [s]", f"{result.duration:.3f}"),
            ("distance from the goal", f"{result.distance:.4g}"),
            ("tolerance", f"{result.tolerance:g}"),
            ("smallest clearance [mm]", f"{1e3 * result.least_clearance:.1f}"),
            ("rollouts", result.tried),
            ("nodes", len(result.tree)),
            ("search [s]", f"{result.seconds:.3g}"),
            ("not confirmed by simulation", result.refused),
        ],
    )
    if result.polished is not None:
        print_output(f"polish: {result.polished}")
    if checks:
        print_table(
            "Verification",
            ("", "reaches the goal>", "distance>", "clearance [mm]>"),
            [
                (
                    name,
                    "yes" if c.arrives else "no",
                    f"{c.distance:.4g}",
                    f"{1e3 * c.clearance:.1f}",
                )
                for name, c in checks.items()
            ],
        )
    touches = next((c.touches for c in checks.values() if c.touches), ())
    if touches:
        print_table(
            "Touches",
            ("", "first [s]>", "speed [m/s]>", "force at the end [N]>", "allowed"),
            [
                (
                    " on ".join(m.parts),
                    f"{m.t:.3f}",
                    f"{m.speed:.3f}",
                    f"{m.force:.3g}",
                    "yes" if m.allowed else "no",
                )
                for m in touches
            ],
        )
    if result.goal.share is not None and checks:
        share = next(iter(checks.values())).share
        print_output(f"the puppet stands with {100.0 * share:.0f} % of its weight")
