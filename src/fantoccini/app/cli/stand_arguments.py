"""Arguments of the commands that move stands.

A stand is the machine that moves a puppet by its axes, the motors; slack is the length of string
that drums let out and wind in again before the start.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from fantoccini.app.cli_support import Quiet, require_positive

StandFile = Annotated[
    str, typer.Argument(metavar="STAND", help="Stand file, or name of a bundled stand.")
]
RunFile = Annotated[Path, typer.Argument(metavar="RUN", help="Run or recording (.npz).")]


@dataclass(frozen=True, kw_only=True)
class StandMotionOptions:
    """Options of set points."""

    puppet: Annotated[
        str | None, typer.Option(metavar="FILE", help="Puppet, if the run does not contain it.")
    ] = None
    controller: Annotated[
        str | None, typer.Option(metavar="TYPE", help="Kind of controller [the stand's].")
    ] = None
    rate: Annotated[
        float | None,
        typer.Option(
            metavar="N",
            callback=require_positive,
            help="Set points per second [the controller's; 50 for G-code].",
        ),
    ] = None
    home: Annotated[bool, typer.Option("--home", help="Home the axes first.")] = False
    slack: Annotated[
        float,
        typer.Option(
            metavar="MM",
            min=0.0,
            max=1000.0,
            help="Length of string that drums pay out and wind in again before the start.",
        ),
    ] = 0.0
    park: Annotated[bool, typer.Option("--park", help="Move to the home positions at the end.")] = (
        False
    )
    force: Annotated[
        bool, typer.Option("--force", help="Continue even if the stand cannot do the run.")
    ] = False
    # The former name of --force.
    anyway: Annotated[bool, typer.Option("--anyway", hidden=True)] = False
    quiet: Quiet = False


@dataclass(frozen=True, kw_only=True)
class StandExportArguments(StandMotionOptions):
    """Arguments of ``fantoccini stand export``."""

    stand: StandFile
    run: RunFile
    out: Annotated[Path, typer.Argument(metavar="OUT", help="File to write.")]


@dataclass(frozen=True, kw_only=True)
class StandStreamArguments(StandMotionOptions):
    """Arguments of ``fantoccini stand stream``."""

    stand: StandFile
    run: RunFile
    port: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PORT",
            help="Serial port; CONTROLLER=PORT for each of several controllers [the stand's].",
        ),
    ] = None
    baud: Annotated[
        int | None, typer.Option(metavar="N", min=300, help="Bits per second [the stand's].")
    ] = None
    from_line: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Continue from this line of the G-code.")
    ] = None
    to: Annotated[
        str | None,
        typer.Option(metavar="HOST:PORT", help="Address for OSC or Art-Net packets [the stand's]."),
    ] = None
    from_time: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            min=0.0,
            help="Continue from this time of the set points: several controllers, or OSC and "
            "Art-Net with axes that are there.",
        ),
    ] = None
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Print the data instead of sending them.")
    ] = False
