"""Arguments of ``fantoccini identify``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from fantoccini.app.cli_support.options import Quiet


@dataclass(frozen=True, kw_only=True)
class IdentifyArguments:
    """Arguments of ``fantoccini identify``."""

    file: Annotated[Path, typer.Argument(metavar="FILE", help="Record file (YAML).")]
    out: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="Write the puppet with the identified numbers (.yaml)."),
    ] = None
    report: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="Write all results (.json), or a page (.html)."),
    ] = None
    suggest: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Write the most informative motion (.csv).")
    ] = None
    duration: Annotated[
        float | None,
        typer.Option(
            min=1.0, metavar="S", help="Duration of the motions that --suggest tries [s]."
        ),
    ] = None
    reach: Annotated[
        float | None,
        typer.Option(
            min=1e-4, metavar="M", help="Amplitude of the motions that --suggest tries [m]."
        ),
    ] = None
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the random motions.")] = None
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing puppet file.")] = (
        False
    )
    threads: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Number of threads; default: all processors."),
    ] = None
    quiet: Quiet = False
