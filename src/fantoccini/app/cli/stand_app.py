"""The commands of ``fantoccini stand`` with their arguments and help.

A stand is the machine that moves a puppet. A set point is the position of all its motors at one
time.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fantoccini.app.cli.stand_arguments import StandExportArguments, StandStreamArguments
from fantoccini.app.cli_support import Quiet, require_positive, with_arguments

stand_app = typer.Typer(
    help="Check whether a stand can do a run, and send it set points.",
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
        str | None, typer.Option(metavar="FILE", help="Puppet, if the run does not contain it.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Write a page with plots (.html).")
    ] = None,
    slower: Annotated[
        bool, typer.Option(help="If it cannot, simulate the run again at slower tempos.")
    ] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    quiet: Quiet = False,
) -> None:
    """Check whether a stand can do a run: margins of every axis, broken limits, remedies.

    Exits with 1 if it cannot.
    """
    from fantoccini.app.cli.stand import check_run

    check_run(stand, run, puppet, report, slower, as_json, quiet)


@stand_app.command("export")
@with_arguments(StandExportArguments)
def stand_export(arguments: StandExportArguments) -> None:
    """Write a run as set points for the stand's controller.

    The ending of OUT selects the format: .csv, .gcode or .nc, .cfg (a Klipper macro), .json or
    .yaml (a ROS 2 JointTrajectory). Exits with 1 if the stand cannot do the run.
    """
    from fantoccini.app.cli.stand_motion import export_points

    export_points(arguments)


@stand_app.command("stream")
@with_arguments(StandStreamArguments)
def stand_stream(arguments: StandStreamArguments) -> None:
    """Send a run to the stand's controller: G-code over a serial port, packets over a network.

    Ctrl-C pauses all motion; then Enter continues, and another Ctrl-C stops. An error of the
    controller also stops (exit code 1). Both print how to continue later.
    """
    from fantoccini.app.cli.stand_motion import stream_run

    stream_run(arguments)


@stand_app.command("emulate")
def stand_emulate(
    stand: Annotated[
        str, typer.Argument(metavar="STAND", help="Stand file, or name of a bundled stand.")
    ],
    controller: Annotated[
        str | None, typer.Option(metavar="TYPE", help="Kind of controller [the stand's].")
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(
            metavar="N",
            callback=require_positive,
            help="Set points per second for which GRBL is configured [50].",
        ),
    ] = None,
    listen: Annotated[
        str | None,
        typer.Option(
            metavar="HOST:PORT", help="Address that receives OSC or Art-Net packets [the stand's]."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Write the motor positions at 100 Hz: .csv.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Run an emulated controller with the stand's axes: GRBL on a pseudo-terminal, OSC, Art-Net.

    Prints its port or address. Ends at the end of the received program (M2), when packets stop, or
    with Ctrl-C.
    """
    from fantoccini.app.cli.stand_motion import emulate_controllers

    emulate_controllers(stand, controller, rate, listen, out, quiet)
