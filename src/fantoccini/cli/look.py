"""How pictures and films look, as asked for on the command line."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from fantoccini.cli.files import FILMS, PICTURES, fail
from fantoccini.cli.options import Focus, Themes

_VIEWS = ("auto", "front", "side", "three-quarter")
_SMALLEST, _LARGEST = 16, 8192
_MOST_FPS = 240.0


@dataclass(frozen=True)
class Look:
    """What was asked for; None leaves it to the picture.

    Attributes:
        view: preset, or azimuth and elevation [deg].
        focus: ``all`` or ``bodies``.
        theme: ``light`` or ``dark``.
        size: width and height [px].
        fps: frames a second of a film.
    """

    view: str | tuple[float, float] | None = None
    focus: str | None = None
    theme: str | None = None
    size: tuple[int, int] | None = None
    fps: float | None = None

    @classmethod
    def of(
        cls, view: str | None, focus: Focus | None, theme: Themes | None, size: str | None,
        fps: float | None,
    ) -> Look:  # fmt: skip
        """The look that options ask for.

        Raises:
            BadParameter: an option has a value that it cannot have.
        """
        if fps is not None and not 0.0 < fps <= _MOST_FPS:
            fail(f"{fps:g} is not above 0 and at most {_MOST_FPS:g}", "--fps")
        return cls(
            None if view is None else _view(view), None if focus is None else focus.value,
            None if theme is None else theme.value, None if size is None else _size(size), fps,
        )  # fmt: skip

    def check(self, out: Sequence[Path], plot: Path | None = None) -> None:
        """An option that no file to be written takes is a mistake."""
        endings = {path.suffix.lower() for path in out}
        film, strip = bool(endings & {*FILMS}), bool(endings & {*PICTURES})
        for option, value, taken, what in (
            ("--view", self.view, film or strip, "a strip or a film"),
            ("--focus", self.focus, film or strip, "a strip or a film"),
            ("--theme", self.theme, film or strip or plot is not None, "a picture or a film"),
            ("--size", self.size, film or strip, "a strip or a film"),
            ("--fps", self.fps, film, "a film"),
        ):
            if value is not None and not taken:
                fail(f"it goes with {what}; none is to be written", option)

    def given(self, *names: str) -> dict[str, Any]:
        """Those of these attributes that were asked for."""
        values = {name: getattr(self, name) for name in names}
        return {name: value for name, value in values.items() if value is not None}


def _view(text: str) -> str | tuple[float, float]:
    if text in _VIEWS:
        return text
    try:
        azimuth, elevation = (float(part) for part in text.split(","))
    except ValueError:
        azimuth = elevation = math.nan
    if not (math.isfinite(azimuth) and abs(elevation) <= 90.0):
        fail(
            f"{text!r} is none of {', '.join(_VIEWS)}, nor AZIMUTH,ELEVATION in degrees, the "
            "elevation from -90 to 90",
            "--view",
        )
    return azimuth, elevation


def _size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    size = (int(found[1]), int(found[2])) if found else (0, 0)
    if not all(_SMALLEST <= n <= _LARGEST for n in size):
        fail(
            f"{text!r} is not WIDTHxHEIGHT in pixels, each from {_SMALLEST} to {_LARGEST}", "--size"
        )
    return size


View = Annotated[
    str | None,
    typer.Option(
        metavar="VIEW",
        help="Of strips and films: auto, front, side, three-quarter, or AZIMUTH,ELEVATION in "
        "degrees [auto].",
    ),
]
Focusing = Annotated[
    Focus | None,
    typer.Option("--focus", help="Of strips and films: bodies lets strings leave it [all]."),
]
Theming = Annotated[
    Themes | None, typer.Option("--theme", help="Of pictures, plots and films [light].")
]
Size = Annotated[
    str | None,
    typer.Option(metavar="WxH", help="Of strips and films [px]; a film's is 960x720 without it."),
]
Fps = Annotated[float | None, typer.Option(metavar="N", help="Frames a second of films [30].")]
