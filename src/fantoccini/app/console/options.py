"""Arguments and options that commands share, and the choices of options."""

from __future__ import annotations

import enum
import math
from pathlib import Path
from typing import Annotated

import typer

SchemaOf = enum.StrEnum(
    "SchemaOf",
    [
        "PUPPET",
        "SCENE",
        "INPUTS",
        "GESTURE",
        "SCORE",
        "PLAY",
        "PROBLEM",
        "TASK",
        "MAPPING",
        "STAND",
        "RECORD",
    ],
)
Planner = enum.StrEnum("Planner", {"EXPLORE": "explore", "EST2007": "est-2007"})
Objective = enum.StrEnum("Objective", ["GENTLE", "TIME", "ACCELERATION"])
Theme = enum.StrEnum("Theme", ["LIGHT", "DARK"])
UpAxis = enum.StrEnum("UpAxis", ["Y", "Z"])
Focus = enum.StrEnum("Focus", ["ALL", "BODIES"])
Method = enum.StrEnum("Method", ["EVENT", "TIMESTEPPING", "VARIATIONAL"])
StringModel = enum.StrEnum("StringModel", ["CONSTRAINT", "CHAIN"])


def positive(value: float | None) -> float | None:
    """The value; a usage error unless it is None or a positive number."""
    if value is not None and not (math.isfinite(value) and value > 0):
        raise typer.BadParameter(f"{value} is not a positive number")
    return value


def performed(value: Path | list[Path] | None) -> Path | list[Path] | None:
    """The value, with files for the names of bundled performances."""
    if value is None:
        return None
    # Reads puppets, which --help does not need.
    from fantoccini.app.console.files import inputs_path

    return [inputs_path(path) for path in value] if isinstance(value, list) else inputs_path(value)


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
        callback=performed,
        help="Motion of the driven coordinates: .yaml, .csv, .npz, a recording (.npz), or the name "
        "of a bundled performance.",
    ),
]
Out = Annotated[
    list[Path] | None,
    typer.Option(
        metavar="PATH",
        help="Write the motion. The ending selects the format: .npz .csv (numbers), .png .svg .pdf "
        "(strip of poses), .mp4 .gif (film), .glb .usda .usdc .bvh .mcap (animation); repeatable.",
    ),
]
Fps = Annotated[
    float | None,
    typer.Option(
        metavar="N",
        help="Frames per second of films [30], keys per second of animations [.glb: where the "
        "motion needs them; .usda .usdc .bvh .mcap: 60], rows per second of .csv [every step].",
    ),
]
Bodies = Annotated[
    str | None,
    typer.Option(
        metavar="NAME,...",
        help="Bodies of animations [all]; of .csv, whose places are added [none]; or: all.",
    ),
]
SaveInputs = Annotated[
    Path | None,
    typer.Option(
        metavar="PATH", help="Save the inputs as a recording (.npz), which simulate takes."
    ),
]
ShowMotion = Annotated[
    bool, typer.Option("--show", help="Open the motion in the browser, until Ctrl-C.")
]
