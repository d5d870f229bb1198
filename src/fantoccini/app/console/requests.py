"""Arguments of the larger commands: a dataclass each, from which its command line is made."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_type_hints

import typer

from fantoccini.app.console.look import Look
from fantoccini.app.console.options import (
    Bodies,
    File,
    Focus,
    Fps,
    Inputs,
    Method,
    Objective,
    Out,
    Planner,
    Quiet,
    SaveInputs,
    ShowMotion,
    StringModel,
    Theme,
    UpAxis,
    positive,
)

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

R = TypeVar("R", bound="DataclassInstance")


def takes(request: type[R]) -> Callable[[Callable[[R], None]], Callable[..., None]]:
    """Makes the fields of a dataclass the arguments of a command; its own come first."""
    hints = get_type_hints(request, include_extras=True)
    defaults = {f.name: f.default for f in fields(request)}
    parameters = [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            annotation=hints[name],
            default=inspect.Parameter.empty if defaults[name] is MISSING else defaults[name],
        )
        for owner in request.__mro__
        for name in vars(owner).get("__annotations__", {})
    ]

    def decorate(run: Callable[[R], None]) -> Callable[..., None]:
        def command(**values: Any) -> None:
            run(request(**values))

        command.__doc__, command.__annotations__ = run.__doc__, hints
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
            help="View of strips and films: auto, front, side, three-quarter, or "
            "AZIMUTH,ELEVATION in degrees [auto].",
        ),
    ] = None
    focus: Annotated[
        Focus | None, typer.Option(help="Frame of strips and films; bodies may crop strings [all].")
    ] = None
    theme: Annotated[
        Theme | None, typer.Option(help="Theme of pictures, plots and films [light].")
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
    def look(self) -> Look:
        """The look of pictures; a usage error if an option has an invalid value."""
        return Look.of(
            self.view, self.focus, self.theme, self.size, self.fps, self.forces, self.bodies
        )


@dataclass(frozen=True, kw_only=True)
class SimulateRequest(PictureOptions):
    """Arguments of ``fantoccini simulate``."""

    file: File
    inputs: Inputs = None
    duration: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            callback=positive,
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
            metavar="S", callback=positive, help="Step of timestepping and variational [0.002]."
        ),
    ] = None
    rtol: Annotated[
        float | None, typer.Option(callback=positive, help="Relative tolerance of event [1e-11].")
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
            help="Rehearse a score until the limbs are on its beats; takes some seconds.",
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
            callback=positive,
            help="Samples kept per second of motion; by default every step. Event also keeps the "
            "start, the end and the events.",
        ),
    ] = None
    time_limit: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            callback=positive,
            help="Computing time after which the run ends with what it has; none by default.",
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class PlanRequest(PictureOptions):
    """Arguments of ``fantoccini plan``."""

    file: Annotated[
        str | None,
        typer.Argument(
            metavar="[PROBLEM]",
            help="Problem file, or name of a bundled problem; without it, list the bundled ones.",
        ),
    ] = None
    planner: Annotated[Planner, typer.Option(help="Planner to use.")] = Planner.EXPLORE
    tolerance: Annotated[
        float | None, typer.Option(callback=positive, help="Goal tolerance; overrides the file.")
    ] = None
    time_limit: Annotated[
        float, typer.Option(metavar="S", callback=positive, help="Time limit for the first plan.")
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
class OptimiseRequest(PictureOptions):
    """Arguments of ``fantoccini optimise``."""

    file: Annotated[
        str | None,
        typer.Argument(
            metavar="[TASK]",
            help="Task file, or name of a bundled task; without it, list the bundled ones.",
        ),
    ] = None
    check: Annotated[
        bool, typer.Option("--check", help="Only check the file and list its mistakes.")
    ] = False
    tolerance: Annotated[
        float, typer.Option(callback=positive, help="Residual of the conditions of optimality.")
    ] = 1e-6
    cost_tolerance: Annotated[
        float,
        typer.Option(min=0.0, help="Share of the cost; it ends after four steps that save less."),
    ] = 0.0
    iterations: Annotated[int, typer.Option(min=1, help="Number of iterations, at most.")] = 100
    time_limit: Annotated[
        float, typer.Option(metavar="S", callback=positive, help="Time limit.")
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
class FollowRequest(PictureOptions):
    """Arguments of ``fantoccini follow``."""

    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="Captured motion (.bvh).")]
    file: File
    mapping: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="Mapping file, or name of a bundled one; found by the joints' names otherwise.",
        ),
    ] = None
    travel: Annotated[
        float, typer.Option(metavar="F", min=0.0, help="Share of the way along the floor; 0 stays.")
    ] = 1.0
    up: Annotated[
        UpAxis | None,
        typer.Option(help="The file's vertical axis; else that of the rest pose, or of the trunk."),
    ] = None
    of: Annotated[
        str,
        typer.Option(metavar="NAME", help="Member of a scene that follows; else its only person."),
    ] = ""
    speed: Annotated[
        float | None,
        typer.Option(metavar="V", callback=positive, help="Largest speed of the hands [m/s] [2]."),
    ] = None
    acceleration: Annotated[
        float | None,
        typer.Option(metavar="A", callback=positive, help="Largest acceleration [m/s^2] [30]."),
    ] = None
    out: Out = None
    guides: Annotated[
        bool, typer.Option("--guides/--no-guides", help="Draw the clip in strips and films.")
    ] = True
    save: SaveInputs = None
    show: ShowMotion = False


@dataclass(frozen=True, kw_only=True)
class PlayRequest(PictureOptions):
    """Arguments of ``fantoccini play``."""

    file: Annotated[Path, typer.Argument(metavar="FILE", help="Play file (YAML).")]
    report: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="Write the report: one page with pictures, .html."),
    ] = None
    within: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            metavar="SECONDS",
            help="Stop compiling and simulating then, with what there is.",
        ),
    ] = None
    out: Out = None


@dataclass(frozen=True, kw_only=True)
class PageOptions:
    """Options of commands that serve a live page."""

    theme: Annotated[Theme, typer.Option(help="Theme of the page.")] = Theme.LIGHT
    host: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Address to listen on; other machines can connect unless it is local.",
        ),
    ] = "127.0.0.1"
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="First port to try; 0 for any free port.")
    ] = 8080
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address without opening a browser.")
    ] = False
    record_to: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder for recordings, gestures and films.")
    ] = Path(".")
    quiet: Quiet = False


@dataclass(frozen=True, kw_only=True)
class PerformRequest(PageOptions):
    """Arguments of ``fantoccini perform``."""

    file: Annotated[Path, typer.Argument(metavar="FILE", help="Play (.yaml).")]
    osc_in: Annotated[
        str | None,
        typer.Option(metavar="HOST:PORT", help="Where OSC messages are heard [nowhere]."),
    ] = None
    osc_out: Annotated[
        str | None, typer.Option(metavar="HOST:PORT", help="Where OSC messages are sent [nowhere].")
    ] = None


@dataclass(frozen=True, kw_only=True)
class ShowRequest(PageOptions):
    """Arguments of ``fantoccini show``."""

    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            help="Puppet file, name of a bundled puppet, or run, recording or plan (.npz).",
        ),
    ]
    html: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="Write a run as one file that plays offline: .html."),
    ] = None
    forces: Annotated[
        bool, typer.Option("--forces", help="Draw the forces of contacts in that file.")
    ] = False
    balance: Annotated[
        bool, typer.Option("--balance", help="Let the hands balance a live puppet.")
    ] = False
    score: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Score that a live puppet plays.")
    ] = None
    problem: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Problem file of a plan, unless it is bundled."),
    ] = None
