"""Arguments of the commands that serve a page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from fantoccini.app.cli_support.options import Quiet, Theme


@dataclass(frozen=True, kw_only=True)
class PageOptions:
    """Options of commands that serve a live page."""

    theme: Annotated[Theme, typer.Option(help="Theme of the page.")] = Theme.LIGHT
    host: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Address to listen on; other machines can connect if it is not local.",
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
class PerformArguments(PageOptions):
    """Arguments of ``fantoccini perform``."""

    file: Annotated[Path, typer.Argument(metavar="FILE", help="Play (.yaml).")]
    osc_in: Annotated[
        str | None,
        typer.Option(metavar="HOST:PORT", help="Address that receives OSC messages [none]."),
    ] = None
    osc_out: Annotated[
        str | None,
        typer.Option(metavar="HOST:PORT", help="Address to send OSC messages to [none]."),
    ] = None


@dataclass(frozen=True, kw_only=True)
class ShowArguments(PageOptions):
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
        typer.Option(metavar="PATH", help="Write a run as a page that plays offline: .html."),
    ] = None
    forces: Annotated[
        bool, typer.Option("--forces", help="Draw the forces of contacts in that file.")
    ] = False
    balance: Annotated[
        bool, typer.Option("--balance", help="Balance a live puppet by motions of the hands.")
    ] = False
    score: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Score that a live puppet plays.")
    ] = None
    problem: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Problem file of a plan, if it is not bundled."),
    ] = None
