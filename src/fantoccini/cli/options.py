"""Arguments and options that commands share, and the names that they may choose among."""

from __future__ import annotations

import enum
import math
from pathlib import Path
from typing import Annotated

import typer


class SchemaOf(enum.StrEnum):
    """Kinds of files that have a schema."""

    PUPPET = "puppet"
    INPUTS = "inputs"
    PROBLEM = "problem"


class Planners(enum.StrEnum):
    """Planners by name."""

    EXPLORE = "explore"
    EST2007 = "est-2007"


class Objectives(enum.StrEnum):
    """What plans may cost, by name."""

    GENTLE = "gentle"
    TIME = "time"
    EFFORT = "effort"


class Themes(enum.StrEnum):
    """Looks of pages and pictures by name."""

    LIGHT = "light"
    DARK = "dark"


class Focus(enum.StrEnum):
    """What a picture frames, by name."""

    ALL = "all"
    BODIES = "bodies"


class Method(enum.StrEnum):
    """Ways to integrate."""

    EVENT = "event"
    TIMESTEPPING = "timestepping"
    VARIATIONAL = "variational"


class StringModels(enum.StrEnum):
    """What strings are."""

    CONSTRAINT = "constraint"
    CHAIN = "chain"


def positive(value: float | None) -> float | None:
    """The value; a usage error unless it is a positive number or not given."""
    if value is not None and not (math.isfinite(value) and value > 0):
        raise typer.BadParameter(f"{value} is not a positive number")
    return value


File = Annotated[
    str, typer.Argument(metavar="FILE", help="Puppet file, or name of a bundled puppet.")
]
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="Nothing but errors and what was asked for.")
]
Inputs = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="What the driven coordinates do: .yaml, .csv, .npz, or a recording (.npz).",
    ),
]
