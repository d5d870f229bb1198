"""Commands, their arguments and their help; what they do lies in the other modules here."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path
from typing import Annotated

import typer

from fantoccini.cli.guard import GuardedGroup
from fantoccini.cli.look import Focusing, Fps, Look, Size, Theming, View
from fantoccini.cli.options import (
    File,
    Inputs,
    Method,
    Objectives,
    Planners,
    Quiet,
    SchemaOf,
    StringModels,
    Themes,
    positive,
)
from fantoccini.cli.terminal import version

_ABOUT = """\
Marionettes: articulated bodies hung from massless strings, from a file to a moving picture.

FILE is a puppet file (YAML) or the name of a bundled puppet; `fantoccini info` lists those.

Exit codes: 0 done. 1 the run stopped before its end, or this machine lacks something.
2 mistakes in files or arguments. 130 stopped with Ctrl-C; what was reached is still written.

Data go to stdout, messages and progress to stderr.
"""

app = typer.Typer(
    cls=GuardedGroup,
    help=_ABOUT,
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def main() -> None:
    """The entry point of the command ``fantoccini``."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError):
            # A terminal without Unicode shows \N{...} escapes instead of failing.
            stream.reconfigure(errors="backslashreplace")
    app(prog_name="fantoccini")


def _version(asked: bool) -> None:
    if asked:
        typer.echo(version())
        raise typer.Exit


@app.callback()
def _top(
    _: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    pass


@app.command()
def check(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE...", help="Puppet files, or bundled names.")
    ],
    inputs: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="Inputs file to check against every puppet; repeatable."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Find every mistake in puppet files."""
    from fantoccini.cli.check import check_files

    check_files(files, inputs or [], quiet)


@app.command()
def schema(
    of: Annotated[SchemaOf, typer.Argument(help="Kind of file.")] = SchemaOf.PUPPET,
) -> None:
    """Print the JSON Schema of files, for editors."""
    import json

    from fantoccini.motion import inputs_schema
    from fantoccini.planning import problem_schema
    from fantoccini.puppet import json_schema

    schemas = {
        SchemaOf.PUPPET: json_schema,
        SchemaOf.INPUTS: inputs_schema,
        SchemaOf.PROBLEM: problem_schema,
    }
    typer.echo(json.dumps(schemas[of](), indent=2))


@app.command()
def info(
    file: Annotated[
        str | None,
        typer.Argument(metavar="[FILE]", help="Puppet; without it the bundled ones are listed."),
    ] = None,
) -> None:
    """Describe a puppet, or list the bundled ones."""
    from fantoccini.cli.info import describe_puppet, list_bundled

    if file is None:
        list_bundled()
    else:
        describe_puppet(file)


@app.command()
def equations(
    file: File,
    latex: Annotated[bool, typer.Option("--latex", help="As LaTeX.")] = False,
) -> None:
    """Print a small puppet's equations.

    Lagrangian, M, C, g, h, A_D and A_K; exit code 1 for a puppet whose equations are too large.
    """
    from fantoccini.cli.equations import print_equations

    print_equations(file, latex)


@app.command()
def export(
    file: File,
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Made when it is not there.")],
    force: Annotated[
        bool, typer.Option("--force", help="Write into a folder that is not empty.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Write a puppet's equations as C99.

    The files depend on nothing but libm; a header documents every argument.
    """
    from fantoccini.cli.export import export_c99

    export_c99(file, folder, force, quiet)


@app.command()
def simulate(
    file: File,
    inputs: Inputs = None,
    duration: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            callback=positive,
            help="Seconds; by default as long as the inputs, or 5 without inputs.",
        ),
    ] = None,
    method: Annotated[Method, typer.Option(help="How to integrate.")] = Method.EVENT,
    string_model: Annotated[
        StringModels, typer.Option(help="Massless constraints, or masses joined by springs.")
    ] = StringModels.CONSTRAINT,
    dt: Annotated[
        float | None,
        typer.Option(
            metavar="S", callback=positive, help="Step of timestepping and variational [0.002]."
        ),
    ] = None,
    rtol: Annotated[
        float | None,
        typer.Option(callback=positive, help="Relative tolerance of event [1e-11]."),
    ] = None,
    integrator: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Integrator of event, one of SciPy's: RK23, RK45, DOP853, Radau, BDF, LSODA; "
            "by default the compiled one.",
        ),
    ] = None,
    start: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="A coordinate at the start: 0.3, '30 deg', NAME.rotation=w,x,y,z, v:NAME=1.5; "
            "repeatable. The puppet starts hanging at rest, unless this names what swings freely.",
        ),
    ] = None,
    out: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="PATH",
            help="What to write, by its ending: .npz .csv (numbers), .png .svg .pdf (strip of "
            "poses), .mp4 .gif (film); repeatable.",
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="Plots against time: .png, .svg or .pdf."),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(
            metavar="N",
            callback=positive,
            help="Rows a second that are kept; by default every step. Event keeps those at the "
            "start, the end and events, too.",
        ),
    ] = None,
    view: View = None,
    focus: Focusing = None,
    theme: Theming = None,
    size: Size = None,
    fps: Fps = None,
    quiet: Quiet = False,
) -> None:
    """Move a puppet: numbers, pictures, film."""
    from fantoccini.cli.simulate import Request, simulate_file

    simulate_file(
        Request(
            file, inputs, duration, method.value, string_model.value, dt, rtol, integrator,
            tuple(start or ()), tuple(out or ()), plot, quiet, rate,
            Look.of(view, focus, theme, size, fps),
        )
    )  # fmt: skip


@app.command()
def plan(
    file: Annotated[
        str | None,
        typer.Argument(
            metavar="[PROBLEM]",
            help="Problem file, or name of a bundled problem; without it those are listed.",
        ),
    ] = None,
    planner: Annotated[Planners, typer.Option(help="Which planner.")] = Planners.EXPLORE,
    tolerance: Annotated[
        float | None,
        typer.Option(callback=positive, help="Of the goal's distance, in place of the file's."),
    ] = None,
    time_limit: Annotated[
        float, typer.Option(metavar="S", callback=positive, help="For a first plan.")
    ] = 10.0,
    improve: Annotated[
        float, typer.Option(metavar="S", min=0.0, help="Time to make the plan shorter and better.")
    ] = 0.0,
    confirm: Annotated[
        bool,
        typer.Option(
            "--confirm/--no-confirm", help="Whether only a plan that holds by method event counts."
        ),
    ] = True,
    objective: Annotated[
        Objectives | None,
        typer.Option(help="What better plans have less of, in place of the file's."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Of all random choices.")] = 0,
    threads: Annotated[
        int | None, typer.Option(min=1, help="That share the work; all processors by default.")
    ] = None,
    out: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="PATH",
            help="The plan's motion, by its ending: .npz .csv (numbers), .png .svg .pdf (strip of "
            "poses), .mp4 .gif (film); repeatable.",
        ),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="Tree, way, poses and obstacles: .png, .svg or .pdf."),
    ] = None,
    save: Annotated[
        Path | None, typer.Option(metavar="PATH", help="The plan with its tree: .npz.")
    ] = None,
    show: Annotated[
        bool, typer.Option("--show", help="Then show the plan in the browser, until Ctrl-C.")
    ] = False,
    view: View = None,
    focus: Focusing = None,
    theme: Theming = None,
    size: Size = None,
    fps: Fps = None,
    quiet: Quiet = False,
) -> None:
    """Plan a puppet's way to a goal, clear of obstacles."""
    from fantoccini.cli.plan import Request, plan_file

    plan_file(
        Request(
            file, planner.value, tolerance, time_limit, improve, confirm,
            None if objective is None else objective.value, seed, threads, tuple(out or ()),
            picture, save, show, quiet, Look.of(view, focus, theme, size, fps),
        )
    )  # fmt: skip


@app.command("show")
def show_(
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            help="Puppet file, name of a bundled puppet, run (.npz), recording (.npz) or plan "
            "(.npz).",
        ),
    ],
    html: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="Write a run as one file that plays from disk: .html."),
    ] = None,
    theme: Annotated[Themes, typer.Option(help="Look of the page.")] = Themes.LIGHT,
    host: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Address to listen on; any but this machine's own lets others in.",
        ),
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="First port to try; 0 takes any that is free.")
    ] = 8080,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address, open nothing.")
    ] = False,
    record_to: Annotated[Path, typer.Option(metavar="DIR", help="Folder for recordings.")] = Path(
        "."
    ),
    problem: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Problem file of a plan, where it is no bundled one."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Take a puppet's strings in hand, or watch a run, in the browser.

    The page is on this machine only, until Ctrl-C.
    """
    from fantoccini.cli.show import Request, show_file

    show_file(
        Request(file, html, theme.value, host, port, not no_browser, record_to, problem, quiet)
    )


@app.command("validate-reduction")
def validate_reduction(
    file: File,
    inputs: Inputs = None,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Where the report goes; made when it is not there.")
    ] = Path("out"),
    quiet: Quiet = False,
) -> None:
    """Check the paper's Section VI on a puppet.

    Is the mixed model, with the driven coordinates as inputs, what the puppet does on drives? Looks
    at the structure the paper claims, compares both models with exact and with real tracking, and
    with a string that has mass; on the drives that FILE has, too. The motion is that of the
    inputs, or small moves of every driven coordinate. Leaves reduction.md and its plots in DIR.
    """
    from fantoccini.cli.reduction import validate_file

    validate_file(file, inputs, out, quiet)


@app.command()
def demo(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where the files go.")] = Path("out"),
    quiet: Quiet = False,
) -> None:
    """Let the bundled marionette greet, step and bow.

    Leaves marionette.npz, marionette.png (poses) and marionette.mp4 in DIR.
    """
    from fantoccini.cli.demo import show_demo

    show_demo(out, quiet)


@app.command()
def doctor() -> None:
    """Say what this machine has, and what it lacks."""
    from fantoccini.cli.doctor import examine

    examine()


if __name__ == "__main__":
    main()
