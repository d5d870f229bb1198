"""Declarations of the commands, with arguments and help; the other modules implement them."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Annotated

import typer

from fantoccini.app.cli.stand_app import stand_app
from fantoccini.app.cli_support import (
    CommandGroup,
    ExportArguments,
    FollowArguments,
    IdentifyArguments,
    OptimiseArguments,
    PerformArguments,
    PlanArguments,
    PlayArguments,
    PuppetFile,
    Quiet,
    SchemaKind,
    ShowArguments,
    SimulateArguments,
    resolve_bundled,
    version_text,
    with_arguments,
)

_ABOUT = """\
Simulate, plan and play marionettes: articulated bodies hung from massless strings.

FILE is a puppet file (YAML) or the name of a bundled puppet; `fantoccini info` lists those.

Exit codes: 0 done. 1 the run stopped early, something cannot be done, or a program or library is
missing. 2 mistakes in files or arguments. 130 stopped with Ctrl-C; results so far are still
written.

Data go to stdout, messages and progress to stderr.
"""

app = typer.Typer(
    cls=CommandGroup,
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
        if isinstance(stream, io.TextIOWrapper):
            # A terminal without Unicode then shows escapes such as \N{...} instead of failing.
            stream.reconfigure(errors="backslashreplace")
    app(prog_name="fantoccini")


def _version(requested: bool) -> None:
    if requested:
        typer.echo(version_text())
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
        list[str],
        typer.Argument(metavar="FILE...", help="Puppet files, plays, stands, or bundled names."),
    ],
    inputs: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            callback=resolve_bundled,
            help="Inputs file, or name of a bundled performance, to check with each puppet; "
            "repeatable.",
        ),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Check puppet files, plays and stands, and list every mistake."""
    from fantoccini.app.cli.check import check_files

    check_files(files, inputs or [], quiet)


@app.command()
def schema(
    of: Annotated[SchemaKind, typer.Argument(help="Kind of file.")] = SchemaKind.PUPPET,
) -> None:
    """Print a JSON Schema, for editors."""
    import json

    from fantoccini.control.tasks import problem_schema, task_schema
    from fantoccini.lab.identification import record_schema
    from fantoccini.model.puppet import json_schema
    from fantoccini.model.scene import json_schema as scene_schema
    from fantoccini.motion import inputs_schema
    from fantoccini.stand import stand_schema
    from fantoccini.theatre.gestures import gesture_schema
    from fantoccini.theatre.retarget import mapping_schema
    from fantoccini.theatre.script import play_schema, score_schema

    schemas = {
        SchemaKind.PUPPET: json_schema,
        SchemaKind.SCENE: scene_schema,
        SchemaKind.INPUTS: inputs_schema,
        SchemaKind.GESTURE: gesture_schema,
        SchemaKind.SCORE: score_schema,
        SchemaKind.PLAY: play_schema,
        SchemaKind.PROBLEM: problem_schema,
        SchemaKind.TASK: task_schema,
        SchemaKind.MAPPING: mapping_schema,
        SchemaKind.STAND: stand_schema,
        SchemaKind.RECORD: record_schema,
    }
    typer.echo(json.dumps(schemas[of](), indent=2))


@app.command()
def info(
    file: Annotated[
        str | None,
        typer.Argument(metavar="[FILE]", help="Puppet; by default, list all bundled files."),
    ] = None,
) -> None:
    """Describe a puppet, or list all bundled files."""
    from fantoccini.app.cli.info import describe_puppet, list_bundled

    if file is None:
        list_bundled()
    else:
        describe_puppet(file)


@app.command()
def rig(
    file: Annotated[str, typer.Argument(metavar="FILE", help="Puppet file.")],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="Picture (.png, .svg, .pdf); by default beside the file, NAME_rig.png.",
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the rig of the file.")] = False,
    quiet: Quiet = False,
) -> None:
    """Write the trunk, head and limbs of a puppet, and their strings, into its file.

    Finds them from the tree, the shapes and the strings, and draws them. Keeps the comments and
    layout of the file. Gestures use the section `rig`; change its entries where the guess is wrong.
    """
    from fantoccini.app.cli.rig import write_rig

    write_rig(file, out, force, quiet)


@app.command()
def rest(
    file: PuppetFile,
    start: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="Value of a driven coordinate, or start of the search for a dynamic one: 0.3, "
            "'30 deg', NAME.rotation=w,x,y,z; repeatable.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Write a picture (.png, .svg, .pdf).")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Find the state in which a puppet hangs still: lengths, tensions, slack strings, contacts.

    Exits with 2 if no state of rest exists. The last lines can begin a CSV file of inputs.
    """
    from fantoccini.app.cli.rest import describe_rest

    describe_rest(file, start or [], out, quiet)


@app.command()
def equations(
    file: PuppetFile, latex: Annotated[bool, typer.Option("--latex", help="Print LaTeX.")] = False
) -> None:
    """Print the equations of a small puppet.

    Prints the Lagrangian, M, C, g, h, A_D and A_K. Exits with 1 if the equations are too large.
    """
    from fantoccini.app.cli.equations import print_equations

    print_equations(file, latex)


@app.command("export")
@with_arguments(ExportArguments)
def export(arguments: ExportArguments) -> None:
    """Write a puppet's equations as C99, or a saved motion as animation, film or numbers.

    The C99 files depend only on libm. The header documents every argument.
    """
    from fantoccini.app.cli.export import export_file

    export_file(arguments)


@app.command("import")
def import_(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="File in MJCF or URDF.")],
    puppet: Annotated[Path, typer.Argument(metavar="PUPPET", help="Puppet file to write, .yaml.")],
    keyframe: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Keyframe of MJCF to start in; by default the zero pose."
        ),
    ] = None,
    density: Annotated[
        float | None,
        typer.Option(
            metavar="KG/M3",
            help="Density of solids of links without inertia in URDF; by default 1000 if a joint "
            "would otherwise move no mass, else such links have no mass.",
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite existing files.")] = False,
    quiet: Quiet = False,
) -> None:
    """Convert a model in MJCF or URDF to a puppet file.

    Writes meshes into a folder beside it. Prints the differences between puppet and model, each
    with its line in the model.
    """
    from fantoccini.app.cli.import_file import import_file

    import_file(model, puppet, keyframe, density, force, quiet)


@app.command("simulate")
@with_arguments(SimulateArguments)
def simulate(arguments: SimulateArguments) -> None:
    """Simulate a puppet; write numbers, pictures or a film."""
    from fantoccini.app.cli.simulate import simulate_file

    simulate_file(arguments)


@app.command("plan")
@with_arguments(PlanArguments)
def plan(arguments: PlanArguments) -> None:
    """Plan a motion to a goal that avoids obstacles."""
    from fantoccini.app.cli.plan import plan_file

    plan_file(arguments)


@app.command("optimise")
@with_arguments(OptimiseArguments)
def optimise(arguments: OptimiseArguments) -> None:
    """Find the motion of a task with the smallest cost, within its bounds."""
    from fantoccini.app.cli.optimise import optimise_file

    optimise_file(arguments)


@app.command("identify")
@with_arguments(IdentifyArguments)
def identify(arguments: IdentifyArguments) -> None:
    """Identify lengths, masses, damping and delay of a puppet from a record of its motion.

    Exits with 1 if there are reasons to doubt the result, such as a number that the record does not
    determine, a search that did not converge, or residuals that are not noise.
    """
    from fantoccini.app.cli.identify import identify_record

    identify_record(arguments)


@app.command("follow")
@with_arguments(FollowArguments)
def follow(arguments: FollowArguments) -> None:
    """Make a puppet follow captured motion.

    Reports the smallest error that the strings allow, and the error added by swinging.
    """
    from fantoccini.app.cli.follow import follow_file

    follow_file(arguments)


@app.command()
def mapping(
    clip: Annotated[
        Path, typer.Argument(metavar="CLIP", help="Captured motion (.bvh), or a bundled clip.")
    ],
    puppet: Annotated[
        str | None, typer.Argument(metavar="PUPPET", help="Puppet that will follow it.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the mapping file (.yaml); by default printed."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Write a mapping file for a clip, to check and fill in.

    Joints are found by their names, or by the skeleton's shape; doubtful ones are marked.
    """
    from fantoccini.app.cli.mapping import write_mapping

    write_mapping(clip, puppet, out, quiet)


@app.command("play")
@with_arguments(PlayArguments)
def play(arguments: PlayArguments) -> None:
    """Compile a play, simulate it and verify it; write a report or a film.

    Exits with 1 if a cue cannot be done as written or the run breaks a requirement.
    """
    from fantoccini.app.cli.play import play_file

    play_file(arguments)


@app.command("show")
@with_arguments(ShowArguments)
def show(arguments: ShowArguments) -> None:
    """Show a live puppet, or replay a run, in the browser.

    Serves the page on this machine only, until Ctrl-C.
    """
    from fantoccini.app.cli.show import show_file

    show_file(arguments)


@app.command("perform")
@with_arguments(PerformArguments)
def perform(arguments: PerformArguments) -> None:
    """Perform a play live in the browser: GO, hold, skip, repeat.

    Serves the page on this machine only, until Ctrl-C. With --osc-in and --osc-out, OSC messages
    control the play and report its cues.
    """
    from fantoccini.app.cli.perform import perform_play

    perform_play(arguments)


@app.command()
def take(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Recording (.npz).")],
    out: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Write the edited recording (.npz).")
    ] = None,
    trim: Annotated[
        str | None, typer.Option(metavar="A:B", help="Keep the part from A to B [s].")
    ] = None,
    smooth: Annotated[
        float | None, typer.Option(metavar="S", help="Average the hands' paths over S [s].")
    ] = None,
    stretch: Annotated[
        float | None, typer.Option(metavar="F", help="Make it F times as long.")
    ] = None,
    loop: Annotated[
        int | None,
        typer.Option(metavar="N", help="Repeat it N times, without jumps of position or velocity."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Describe a recording of hands, or cut, smooth, stretch and repeat it.

    The puppet is simulated again with the edited motion of the hands.
    """
    from fantoccini.app.cli.take import edit_take

    edit_take(file, out, trim, smooth, stretch, loop, quiet)


@app.command("validate-reduction")
def validate_reduction(file: PuppetFile, quiet: Quiet = False) -> None:
    """Check the mixed-model reduction of the paper's Section VI on a puppet.

    Tests at random configurations whether driven coordinates can serve as inputs: blocks of the
    kinetic energy, symmetric products with slack and taut strings, and strings that couple drives.
    Every driven coordinate gets a drive as heavy as the puppet; the drives of FILE are ignored.
    """
    from fantoccini.app.cli.reduction import validate_file

    validate_file(file, quiet)


app.add_typer(stand_app, name="stand")


@app.command()
def demo(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the files.")] = Path("out"),
    quiet: Quiet = False,
) -> None:
    """Simulate the bundled marionette: it walks, waves and nods.

    Writes marionette.npz, marionette.png (poses) and marionette.mp4 to DIR.
    """
    from fantoccini.app.cli.demo import show_demo

    show_demo(out, quiet)


@app.command()
def cache(
    clear: Annotated[
        bool, typer.Option("--clear", help="Remove all; they are created again when needed.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """List cached files: compiled puppets, convex pieces of meshes, runs of plays."""
    from fantoccini.app.cli.cache import describe_cache

    describe_cache(clear, quiet)


@app.command()
def doctor() -> None:
    """Check that this machine has everything that fantoccini needs."""
    from fantoccini.app.cli.doctor import print_diagnosis

    print_diagnosis()


if __name__ == "__main__":
    main()
