"""Arguments and options that commands share, and the choices of options."""

from __future__ import annotations

import enum
import math
from pathlib import Path
from typing import Annotated

import typer

SchemaKind = enum.StrEnum(
    "SchemaKind",
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
Look = enum.StrEnum("Look", ["DIAGRAM", "STAGE"])
UpAxis = enum.StrEnum("UpAxis", ["Y", "Z"])
Focus = enum.StrEnum("Focus", ["ALL", "BODIES"])
Method = enum.StrEnum("Method", ["EVENT", "TIMESTEPPING", "VARIATIONAL"])
StringModel = enum.StrEnum("StringModel", ["CONSTRAINT", "CHAIN"])


def require_positive(value: float | None) -> float | None:
    """The value, if it is None or a positive number; otherwise a usage error."""
    if value is not None and not (math.isfinite(value) and value > 0):
        raise typer.BadParameter(f"{value} is not a positive number")
    return value


def resolve_bundled(value: Path | list[Path] | None) -> Path | list[Path] | None:
    """The value, with names of bundled performances replaced by their files."""
    if value is None:
        return None
    # Imported here, because --help must not import the reader of puppets.
    from fantoccini.app.cli_support.files import inputs_path

    return [inputs_path(path) for path in value] if isinstance(value, list) else inputs_path(value)


PuppetFile = Annotated[
    str, typer.Argument(metavar="FILE", help="Puppet file, or name of a bundled puppet.")
]
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print only errors and requested output.")
]
Inputs = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        callback=resolve_bundled,
        help="Motion of the driven coordinates: .yaml, .csv, .npz, a recording (.npz), or the name "
        "of a bundled performance.",
    ),
]
Out = Annotated[
    list[Path] | None,
    typer.Option(
        metavar="PATH",
        help="Write the motion. The ending selects the format: .npz .csv (numbers), .png .svg .pdf "
        "(strip of poses), .mp4 .gif (film), .glb .usda .usdc .bvh .mcap (animation), .srt "
        "(captions of scores and plays); repeatable.",
    ),
]
Fps = Annotated[
    float | None,
    typer.Option(
        metavar="N",
        help="Frames per second of films [30], keys per second of animations [.glb: as the motion "
        "requires; .usda .usdc .bvh .mcap: 60], rows per second of .csv [every step].",
    ),
]
Bodies = Annotated[
    str | None,
    typer.Option(
        metavar="NAME,...",
        help="Bodies in animations [all], or with poses in .csv [none]; or: all.",
    ),
]
Begin = Annotated[
    float | None,
    typer.Option(
        "--from", metavar="S", help="Begin of the part to write [s] [start of the motion]."
    ),
]
End = Annotated[
    float | None,
    typer.Option("--to", metavar="S", help="End of the part to write [s] [end of the motion]."),
]
SaveInputs = Annotated[
    Path | None,
    typer.Option(
        metavar="PATH", help="Save the inputs as a recording (.npz), which simulate reads."
    ),
]
ShowMotion = Annotated[
    bool, typer.Option("--show", help="Open the motion in the browser, until Ctrl-C.")
]
