"""The commands of ``fantoccini stand`` with their arguments and help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fantoccini.app.cli.stand_requests import StandExportRequest, StandStreamRequest
from fantoccini.app.console import Quiet, positive, takes

stand_app = typer.Typer(
    help="Stands: whether they can do a run, and set points for it.",
    no_args_is_help=True,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


@stand_app.command("check")
def stand_check(
    stand: Annotated[
        str, typer.Argument(metavar="STAND", help="Stand file, or name of a bundled stand.")
    ],
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Run or recording (.npz).")],
    puppet: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="The run's puppet, where the run does not say."),
    ] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Write a page with plots (.html).")
    ] = None,
    slower: Annotated[
        bool, typer.Option(help="Where it cannot, simulate the run again at slower tempos.")
    ] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    quiet: Quiet = False,
) -> None:
    """Tell whether a stand can do a run: margins of every axis, what breaks, what would help.

    Exits with 1 if it cannot.
    """
    from fantoccini.app.cli.stand import check_run

    check_run(stand, run, puppet, report, slower, as_json, quiet)


@stand_app.command("export")
@takes(StandExportRequest)
def stand_export(request: StandExportRequest) -> None:
    """Write a run as set points for the stand's controller.

    The ending of OUT selects the format: .csv, .gcode or .nc, .cfg (a Klipper macro), .json or
    .yaml (a ROS 2 JointTrajectory). Exits with 1 if the stand cannot do the run.
    """
    from fantoccini.app.cli.stand_motion import export

    export(request)


@stand_app.command("stream")
@takes(StandStreamRequest)
def stand_stream(request: StandStreamRequest) -> None:
    """Send a run to the stand's controller: G-code over a serial port, packets over a network.

    Ctrl-C holds all motion; then Enter goes on, and another Ctrl-C stops. An error of the
    controller stops too (exit code 1). Both say how to go on.
    """
    from fantoccini.app.cli.stand_motion import stream_run

    stream_run(request)


@stand_app.command("emulate")
def stand_emulate(
    stand: Annotated[
        str, typer.Argument(metavar="STAND", help="Stand file, or name of a bundled stand.")
    ],
    controller: Annotated[
        str | None, typer.Option(metavar="TYPE", help="Kind of controller, instead of the stand's.")
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(
            metavar="N",
            callback=positive,
            help="Set points per second that GRBL is set up for [50].",
        ),
    ] = None,
    listen: Annotated[
        str | None,
        typer.Option(
            metavar="HOST:PORT", help="Where packets of OSC or Art-Net are heard [the stand's]."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="Write where its motors were, 100 times a second: .csv."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Run an emulated controller with the stand's axes: GRBL on a pseudo-terminal, OSC, Art-Net.

    Prints its port or address. Ends with the program that it is sent (M2), when packets come no
    more, or with Ctrl-C.
    """
    from fantoccini.app.cli.stand_motion import emulate

    emulate(stand, controller, rate, listen, out, quiet)
