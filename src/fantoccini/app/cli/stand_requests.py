"""Arguments of the commands that move a stand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from fantoccini.app.console import Quiet, positive

OfStand = Annotated[
    str, typer.Argument(metavar="STAND", help="Stand file, or name of a bundled stand.")
]
OfRun = Annotated[Path, typer.Argument(metavar="RUN", help="Run or recording (.npz).")]


@dataclass(frozen=True, kw_only=True)
class StandMotionOptions:
    """Options of set points."""

    puppet: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="The run's puppet, where the run does not say."),
    ] = None
    controller: Annotated[
        str | None, typer.Option(metavar="TYPE", help="Kind of controller, instead of the stand's.")
    ] = None
    rate: Annotated[
        float | None,
        typer.Option(
            metavar="N",
            callback=positive,
            help="Set points per second [the controller's; 50 for G-code].",
        ),
    ] = None
    home: Annotated[bool, typer.Option("--home", help="Let the axes find their places first.")] = (
        False
    )
    slack: Annotated[
        float,
        typer.Option(
            metavar="MM",
            min=0.0,
            max=1000.0,
            help="Drums pay out so much and wind it in again before the start.",
        ),
    ] = 0.0
    park: Annotated[bool, typer.Option("--park", help="Go home in the end.")] = False
    anyway: Annotated[bool, typer.Option("--anyway", help="Also what the stand cannot do.")] = False
    quiet: Quiet = False


@dataclass(frozen=True, kw_only=True)
class StandExportRequest(StandMotionOptions):
    """Arguments of ``fantoccini stand export``."""

    stand: OfStand
    run: OfRun
    out: Annotated[Path, typer.Argument(metavar="OUT", help="File to write.")]


@dataclass(frozen=True, kw_only=True)
class StandStreamRequest(StandMotionOptions):
    """Arguments of ``fantoccini stand stream``."""

    stand: OfStand
    run: OfRun
    port: Annotated[str | None, typer.Option(metavar="NAME", help="Serial port [the stand's].")] = (
        None
    )
    baud: Annotated[
        int | None, typer.Option(metavar="N", min=300, help="Bits per second [the stand's].")
    ] = None
    from_line: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Go on from this line of the G-code.")
    ] = None
    to: Annotated[
        str | None,
        typer.Option(metavar="HOST:PORT", help="Where packets of OSC or Art-Net go [the stand's]."),
    ] = None
    from_time: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            min=0.0,
            help="Go on from this time of the set points, where the axes stand (OSC, Art-Net).",
        ),
    ] = None
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Print what would be sent; open no port.")
    ] = False
