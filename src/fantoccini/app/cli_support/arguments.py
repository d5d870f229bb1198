"""Arguments of the larger commands: dataclasses from which the command line is built."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_type_hints

import typer

from fantoccini.app.cli_support.options import (
    Begin,
    Bodies,
    End,
    Focus,
    Fps,
    Inputs,
    Look,
    Method,
    Objective,
    Out,
    Planner,
    PuppetFile,
    Quiet,
    SaveInputs,
    ShowMotion,
    StringModel,
    Theme,
    UpAxis,
    require_positive,
)
from fantoccini.app.cli_support.output_options import OutputOptions

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Arguments = TypeVar("Arguments", bound="DataclassInstance")


def with_arguments(
    arguments: type[Arguments],
) -> Callable[[Callable[[Arguments], None]], Callable[..., None]]:
    """Decorator: the fields of a dataclass become the arguments of a command, own fields first."""
    hints = get_type_hints(arguments, include_extras=True)
    defaults = {f.name: f.default for f in fields(arguments)}
    parameters = [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            annotation=hints[name],
            default=inspect.Parameter.empty if defaults[name] is MISSING else defaults[name],
        )
        for base in arguments.__mro__
        for name in vars(base).get("__annotations__", {})
    ]

    def decorate(implementation: Callable[[Arguments], None]) -> Callable[..., None]:
        def command(**values: Any) -> None:
            implementation(arguments(**values))

        command.__doc__, command.__annotations__ = implementation.__doc__, hints
        command.__dict__["__signature__"] = inspect.Signature(parameters)
        return command

    return decorate


@dataclass(frozen=True, kw_only=True)
class PictureOptions:
    """Options of commands that draw."""

    view: Annotated[
        str | None,
        typer.Option(
            metavar="VIEW",
            help="Point of view of strips and films: auto, front, side, three-quarter, or "
            "AZIMUTH,ELEVATION in degrees [auto].",
        ),
    ] = None
    focus: Annotated[
        Focus | None,
        typer.Option(
            help="Content to fit into strips and films; bodies may crop strings [all; bodies on a "
            "stage]."
        ),
    ] = None
    theme: Annotated[
        Theme | None, typer.Option(help="Theme of pictures, plots and films [light].")
    ] = None
    look: Annotated[
        Look | None,
        typer.Option(
            help="Look of strips and films: with title, time and tensions, or a theatre [diagram]."
        ),
    ] = None
    captions: Annotated[
        bool | None,
        typer.Option(
            "--captions/--no-captions",
            help="Show captions of scores and plays in films [yes; not on a stage].",
        ),
    ] = None
    size: Annotated[
        str | None,
        typer.Option(metavar="WxH", help="Size of strips and films [px] [960x720 for films]."),
    ] = None
    fps: Fps = None
    bodies: Bodies = None
    forces: Annotated[
        bool, typer.Option("--forces", help="Draw the forces of contacts in strips and films.")
    ] = False
    quiet: Quiet = False

    @property
    def output_options(self) -> OutputOptions:
        """Parsed options; raises a usage error if an option has an invalid value."""
        return OutputOptions.parse(
            self.view,
            self.focus,
            self.theme,
            self.size,
            self.fps,
            self.forces,
            self.bodies,
            self.look,
            self.captions,
        )


@dataclass(frozen=True, kw_only=True)
class MotionOptions(PictureOptions):
    """Options of commands that write a motion, or part of it."""

    begin: Begin = None
    end: End = None

    @property
    def output_options(self) -> OutputOptions:
        """Parsed options; raises a usage error if an option has an invalid value."""
        return super().output_options.for_part(self.begin, self.end)


@dataclass(frozen=True, kw_only=True)
class ExportArguments:
    """Arguments of ``fantoccini export``."""

    file: Annotated[
        str, typer.Argument(metavar="FILE", help="Puppet, or run, recording or plan (.npz).")
    ]
    out: Annotated[
        Path,
        typer.Argument(
            metavar="OUT",
            help="For a puppet, a folder, created if missing. For a motion, a file, whose ending "
            "selects the format, as for --out of simulate.",
        ),
    ]
    force: Annotated[
        bool, typer.Option("--force", help="Write into a folder that is not empty.")
    ] = False
    begin: Begin = None
    end: End = None
    fps: Fps = None
    bodies: Bodies = None
    problem: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Problem file of a plan, if it is not bundled."),
    ] = None
    quiet: Quiet = False


@dataclass(frozen=True, kw_only=True)
class SimulateArguments(MotionOptions):
    """Arguments of ``fantoccini simulate``."""

    file: PuppetFile
    inputs: Inputs = None
    duration: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            callback=require_positive,
            help="Simulated time; by default that of the inputs, or 5 without inputs.",
        ),
    ] = None
    method: Annotated[Method, typer.Option(help="Integration method.")] = Method.EVENT
    string_model: Annotated[
        StringModel, typer.Option(help="Massless constraints, or chains of masses and springs.")
    ] = StringModel.CONSTRAINT
    dt: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            callback=require_positive,
            help="Step of timestepping and variational [0.002].",
        ),
    ] = None
    rtol: Annotated[
        float | None,
        typer.Option(callback=require_positive, help="Relative tolerance of event [1e-11]."),
    ] = None
    start: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="Start value of a coordinate: 0.3, '30 deg', NAME.rotation=w,x,y,z, v:NAME=1.5; "
            "repeatable. The puppet starts at rest unless a dynamic coordinate is given.",
        ),
    ] = None
    on_beat: Annotated[
        bool,
        typer.Option(
            "--on-beat",
            help="Rehearse a score until the limbs are on the beat; takes some seconds.",
        ),
    ] = False
    out: Out = None
    plot: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Plot against time: .png, .svg or .pdf.")
    ] = None
    rate: Annotated[
        float | None,
        typer.Option(
            metavar="N",
            callback=require_positive,
            help="Saved samples per second of motion; by default every step. Event also saves the "
            "start, the end and the events.",
        ),
    ] = None
    time_limit: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            callback=require_positive,
            help="Computing time after which the run stops, with the motion so far [none].",
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class PlanArguments(MotionOptions):
    """Arguments of ``fantoccini plan``."""

    file: Annotated[
        str | None,
        typer.Argument(
            metavar="[PROBLEM]",
            help="Problem file, task file with an end, or name of a bundled problem; by default, "
            "list bundled problems.",
        ),
    ] = None
    planner: Annotated[Planner, typer.Option(help="Planner to use.")] = Planner.EXPLORE
    tolerance: Annotated[
        float | None,
        typer.Option(callback=require_positive, help="Goal tolerance; overrides the file."),
    ] = None
    time_limit: Annotated[
        float,
        typer.Option(metavar="S", callback=require_positive, help="Time limit for the first plan."),
    ] = 10.0
    improve: Annotated[
        float, typer.Option(metavar="S", min=0.0, help="Time spent on improving the plan.")
    ] = 0.0
    confirm: Annotated[
        bool,
        typer.Option(
            "--confirm/--no-confirm", help="Accept only plans that event-driven runs confirm."
        ),
    ] = True
    objective: Annotated[
        Objective | None, typer.Option(help="Cost that --improve reduces; overrides the file.")
    ] = None
    seed: Annotated[int, typer.Option(help="Seed of all random choices.")] = 0
    threads: Annotated[
        int | None, typer.Option(min=1, help="Number of threads; one per processor by default.")
    ] = None
    out: Out = None
    picture: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="Draw tree, poses and obstacles: .png, .svg or .pdf."),
    ] = None
    save: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Save the plan with its tree: .npz.")
    ] = None
    show: Annotated[
        bool, typer.Option("--show", help="Open the plan in the browser, until Ctrl-C.")
    ] = False


@dataclass(frozen=True, kw_only=True)
class OptimiseArguments(MotionOptions):
    """Arguments of ``fantoccini optimise``."""

    file: Annotated[
        str | None,
        typer.Argument(
            metavar="[TASK]",
            help="Task file, problem file with a duration, or name of a bundled task; by default, "
            "list bundled tasks.",
        ),
    ] = None
    check: Annotated[
        bool, typer.Option("--check", help="Only check the file and list its mistakes.")
    ] = False
    tolerance: Annotated[
        float,
        typer.Option(
            callback=require_positive, help="Largest residual of the optimality conditions."
        ),
    ] = 1e-6
    cost_tolerance: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="Relative decrease of the cost; four smaller ones in a row end the search.",
        ),
    ] = 0.0
    iterations: Annotated[int, typer.Option(min=1, help="Largest number of iterations.")] = 100
    time_limit: Annotated[
        float, typer.Option(metavar="S", callback=require_positive, help="Time limit.")
    ] = 180.0
    threads: Annotated[
        int | None, typer.Option(min=1, help="Number of threads; one per processor by default.")
    ] = None
    seed: Annotated[int, typer.Option(min=0, help="Seed of explorations.")] = 0
    out: Out = None
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH", help="Draw paths, poses, errors and inputs: .png, .svg or .pdf."
        ),
    ] = None
    save: SaveInputs = None
    show: ShowMotion = False


@dataclass(frozen=True, kw_only=True)
class FollowArguments(PictureOptions):
    """Arguments of ``fantoccini follow``."""

    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="Captured motion (.bvh).")]
    file: PuppetFile
    mapping: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="Mapping file, or name of a bundled one; by default found by names or shape.",
        ),
    ] = None
    travel: Annotated[
        float, typer.Option(metavar="F", min=0.0, help="Factor on travel along the floor.")
    ] = 1.0
    up: Annotated[
        UpAxis | None,
        typer.Option(
            help="Vertical axis of the file; by default that of the rest pose or the trunk."
        ),
    ] = None
    of: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="Member of a scene that follows; by default its only person."
        ),
    ] = ""
    begin: Annotated[
        float | None,
        typer.Option("--from", metavar="S", help="Begin of the part of the clip to follow [s]."),
    ] = None
    end: Annotated[
        float | None,
        typer.Option("--to", metavar="S", help="End of the part of the clip to follow [s]."),
    ] = None
    speed: Annotated[
        float | None,
        typer.Option(
            metavar="V", callback=require_positive, help="Largest speed of the hands [m/s] [2]."
        ),
    ] = None
    acceleration: Annotated[
        float | None,
        typer.Option(
            metavar="A", callback=require_positive, help="Largest acceleration [m/s^2] [30]."
        ),
    ] = None
    out: Out = None
    guides: Annotated[
        bool, typer.Option("--guides/--no-guides", help="Draw the clip in strips and films.")
    ] = True
    save: SaveInputs = None
    show: ShowMotion = False


@dataclass(frozen=True, kw_only=True)
class PlayArguments(MotionOptions):
    """Arguments of ``fantoccini play``."""

    file: Annotated[Path, typer.Argument(metavar="FILE", help="Play file (YAML).")]
    report: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="Write the report, a page with pictures: .html."),
    ] = None
    within: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            metavar="SECONDS",
            help="Time after which compiling and simulating stop, with the results so far.",
        ),
    ] = None
    out: Out = None
