"""``fantoccini plan``: finds inputs that reach the goal of a problem file."""

from __future__ import annotations

import typer

from fantoccini.app.cli.show import show_plan
from fantoccini.app.console import (
    FAILED,
    PlanRequest,
    Steps,
    check_extras,
    check_outputs,
    fail,
    say,
    table,
    write,
    write_outputs,
)
from fantoccini.control.planning import Check, PlanResult, solve
from fantoccini.control.problems import load_problem, problem_names
from fantoccini.dynamics.compiled import Event


def plan_file(request: PlanRequest) -> None:
    """Plans, verifies, prints a summary and writes the outputs; exit code 1 without a plan."""
    if request.file is None:
        for name in problem_names():
            write(name)
        return
    out = request.out or []
    check_outputs(out, None)
    request.look.check(out, request.picture)
    check_extras(request.picture, request.save)
    if request.seed < 0:
        fail(f"{request.seed} is negative", "--seed")
    options = {} if request.tolerance is None else {"tolerance": request.tolerance}
    objective = None if request.objective is None else request.objective.value
    with Steps(request.quiet) as steps:
        problem = load_problem(
            request.file, threads=request.threads, progress=steps.named, **options
        )
        steps.step("planning")
        found = solve(
            problem,
            planner=request.planner.value,
            time_limit=request.time_limit,
            improve=request.improve,
            confirm=request.confirm,
            objective=objective,
            seed=request.seed,
        )
        checks = {}
        if found and not request.quiet:
            steps.step("verifying")
            checks = {"step halved": found.verify()}
            if problem.touches.expected:
                checks["step quartered"] = found.verify(0.25)
            else:
                checks["event-driven"] = found.verify(method=Event(rtol=1e-9, atol=1e-9))
        if not found.reason:
            _write(request, found, steps)
    if not request.quiet:
        _report(found, checks)
    if not found:
        say(f"fantoccini: {found.message}")
        if request.show and not found.reason:
            show_plan(found, request.quiet)
        raise typer.Exit(FAILED)
    if request.show:
        show_plan(found, request.quiet)


def _write(request: PlanRequest, found: PlanResult, steps: Steps) -> None:
    if request.save is not None:
        found.save(request.save)
    if request.picture is not None:
        steps.step(f"drawing {request.picture}")
        found.plot(request.picture, **request.look.given("theme"))
    drawn = found.problem.drawn_marionette
    write_outputs(drawn, found.trajectory, request.out or [], None, steps, look=request.look)


def _report(found: PlanResult, checks: dict[str, Check]) -> None:
    table(
        "Plan",
        ("", ">"),
        [
            ("status", found.status.name.lower()),
            ("duration [s]", f"{found.duration:.3f}"),
            ("distance from the goal", f"{found.distance:.4g}"),
            ("tolerance", f"{found.tolerance:g}"),
            ("least clearance [mm]", f"{1e3 * found.least_clearance:.1f}"),
            ("rollouts", found.tried),
            ("nodes", len(found.tree)),
            ("search [s]", f"{found.seconds:.3g}"),
            ("not confirmed by simulation", found.refused),
        ],
    )
    if found.polished is not None:
        write(f"polish: {found.polished}")
    if checks:
        table(
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
        table(
            "Touches",
            ("", "first [s]>", "speed [m/s]>", "force at the end [N]>", "may"),
            [
                (
                    " on ".join(m.parts),
                    f"{m.t:.3f}",
                    f"{m.speed:.3f}",
                    f"{m.force:.3g}",
                    "yes" if m.asked else "no",
                )
                for m in touches
            ],
        )
    if found.goal.share is not None and checks:
        share = next(iter(checks.values())).share
        write(f"the puppet stands with {100.0 * share:.0f} % of its weight")
