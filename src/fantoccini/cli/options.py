"""Arguments and options that commands share, and the choices of options."""

from __future__ import annotations

import enum
import math
from pathlib import Path
from typing import Annotated

import typer

SchemaOf = enum.StrEnum("SchemaOf", ["PUPPET", "INPUTS", "PROBLEM"])
Planner = enum.StrEnum("Planner", {"EXPLORE": "explore", "EST2007": "est-2007"})
Objective = enum.StrEnum("Objective", ["GENTLE", "TIME", "EFFORT"])
Theme = enum.StrEnum("Theme", ["LIGHT", "DARK"])
Focus = enum.StrEnum("Focus", ["ALL", "BODIES"])
Method = enum.StrEnum("Method", ["EVENT", "TIMESTEPPING", "VARIATIONAL"])
StringModel = enum.StrEnum("StringModel", ["CONSTRAINT", "CHAIN"])


def positive(value: float | None) -> float | None:
    """The value; a usage error unless it is None or a positive number."""
    if value is not None and not (math.isfinite(value) and value > 0):
        raise typer.BadParameter(f"{value} is not a positive number")
    return value


File = Annotated[
    str, typer.Argument(metavar="FILE", help="Puppet file, or name of a bundled puppet.")
]
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print only errors and requested output.")
]
Inputs = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Motion of the driven coordinates: .yaml, .csv, .npz, or a recording (.npz).",
    ),
]
Out = Annotated[
    list[Path] | None,
    typer.Option(
        metavar="PATH",
        help="Write the motion. The ending selects the format: .npz .csv (numbers), .png .svg .pdf "
        "(strip of poses), .mp4 .gif (film); repeatable.",
    ),
]
View = Annotated[
    str | None,
    typer.Option(
        metavar="VIEW",
        help="View of strips and films: auto, front, side, three-quarter, or AZIMUTH,ELEVATION in "
        "degrees [auto].",
    ),
]
FocusOn = Annotated[
    Focus | None,
    typer.Option("--focus", help="Frame of strips and films; bodies may crop strings [all]."),
]
ThemeOf = Annotated[
    Theme | None, typer.Option("--theme", help="Theme of pictures, plots and films [light].")
]
Size = Annotated[
    str | None,
    typer.Option(metavar="WxH", help="Size of strips and films [px] [960x720 for films]."),
]
Fps = Annotated[float | None, typer.Option(metavar="N", help="Frames per second of films [30].")]
