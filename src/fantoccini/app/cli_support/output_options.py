"""Options of pictures, films, animations and tables."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fantoccini.app.cli_support.files import FILM_SUFFIXES, PICTURE_SUFFIXES, OutputError, fail
from fantoccini.app.cli_support.options import Focus, Look, Theme
from fantoccini.base import ARRIVED
from fantoccini.output.animation import SUFFIXES

if TYPE_CHECKING:
    from fantoccini.motion import Trajectory
    from fantoccini.output.animation import Bodies

_VIEWS = ("auto", "front", "side", "three-quarter")
_MIN_SIZE, _MAX_SIZE = 16, 8192
"""Width and height of a picture [px]."""
_MAX_FPS = 240.0
_TIME_TOLERANCE = 1e-3
"""Largest time outside of the motion that counts as its start or end [s]: messages round times."""


@dataclass(frozen=True)
class OutputOptions:
    """Options of output files; None for the default.

    Attributes:
        view: preset, or azimuth and elevation [deg].
        focus: ``all`` or ``bodies``.
        theme: ``light`` or ``dark``.
        look: ``diagram`` or ``stage``.
        captions: whether films show captions.
        size: width and height [px].
        fps: frames per second of a film, keys of an animation or rows of a table.
        forces: draw the forces of contacts.
        bodies: bodies in an animation or a table: names or ``all``.
        begin, end: part of the motion that is written [s].
    """

    view: str | tuple[float, float] | None = None
    focus: str | None = None
    theme: str | None = None
    look: str | None = None
    captions: bool | None = None
    size: tuple[int, int] | None = None
    fps: float | None = None
    forces: bool | None = None
    bodies: Bodies | None = None
    begin: float | None = None
    end: float | None = None

    @classmethod
    def parse(
        cls,
        view: str | None,
        focus: Focus | None,
        theme: Theme | None,
        size: str | None,
        fps: float | None,
        forces: bool = False,
        bodies: str | None = None,
        look: Look | None = None,
        captions: bool | None = None,
    ) -> OutputOptions:
        """Parses the values of options.

        Raises:
            BadParameter: a value is invalid.
        """
        if fps is not None and not 0.0 < fps <= _MAX_FPS:
            fail(f"{fps:g} must be positive and at most {_MAX_FPS:g}", "--fps")
        return cls(
            None if view is None else _parse_view(view),
            None if focus is None else focus.value,
            None if theme is None else theme.value,
            None if look is None else look.value,
            captions,
            None if size is None else _parse_size(size),
            fps,
            forces or None,
            None if bodies is None else _parse_names(bodies),
        )

    def for_part(self, begin: float | None, end: float | None) -> OutputOptions:
        """The options for a part of the motion.

        Raises:
            BadParameter: the times are not numbers, or not in order.
        """
        check_time_range(begin, end)
        return replace(self, begin=begin, end=end)

    def part(self, run: Trajectory) -> Trajectory:
        """The part of a run that is written; of a run that stopped early, up to where it stopped.

        Raises:
            BadParameter: a time is outside of the run.
            OutputError: the run stopped before the part begins.
        """
        if self.begin is None and self.end is None:
            return run
        run_start, run_end = float(run.t[0]), float(run.t[-1])
        begin, end = self.begin, self.end
        if run.status not in ARRIVED:
            end = None if end is None else min(end, run_end)
            if begin is not None and begin >= run_end:
                raise OutputError(
                    f"nothing is written from {begin:g} s on: the run stopped at {run_end:g} s"
                )
        check_time_range(begin, end, run_start, run_end)
        begin, end = (run_start if begin is None else begin), (run_end if end is None else end)
        return run.between(max(begin, run_start), min(end, run_end))

    def check(self, out: Sequence[Path], plot: Path | None = None) -> None:
        """Raises a usage error if an option applies to none of the output files."""
        suffixes = {path.suffix.lower() for path in out}
        has_film, has_strip = (
            bool(suffixes & {*FILM_SUFFIXES}),
            bool(suffixes & {*PICTURE_SUFFIXES}),
        )
        has_animation = bool(suffixes & {*SUFFIXES})
        for option, value, applies, outputs in (
            ("--view", self.view, has_film or has_strip, "a strip or a film"),
            ("--focus", self.focus, has_film or has_strip, "a strip or a film"),
            (
                "--theme",
                self.theme,
                has_film or has_strip or plot is not None,
                "a picture or a film",
            ),
            ("--look", self.look, has_film or has_strip, "a strip or a film"),
            ("--captions", self.captions, has_film, "a film"),
            ("--size", self.size, has_film or has_strip, "a strip or a film"),
            (
                "--fps",
                self.fps,
                has_film or has_animation,
                "a film, an animation or a table (.csv)",
            ),
            ("--forces", self.forces, has_film or has_strip, "a strip or a film"),
            ("--bodies", self.bodies, has_animation, "an animation or a table (.csv)"),
            ("--from", self.begin, bool(out), "the files of --out"),
            ("--to", self.end, bool(out), "the files of --out"),
        ):
            if value is not None and not applies:
                fail(f"applies to {outputs}, but none is written", option)
        if self.theme is not None and self.look == Look.STAGE and plot is None:
            fail("found it with `--look stage`, which has its own colours", "--theme")

    @property
    def shows_captions(self) -> bool:
        """Whether films show captions; on a stage only if requested."""
        return self.look != Look.STAGE if self.captions is None else self.captions

    def nondefault(self, *names: str) -> dict[str, Any]:
        """The named attributes that are not None."""
        values = {name: getattr(self, name) for name in names}
        return {name: value for name, value in values.items() if value is not None}


def check_time_range(
    begin: float | None,
    end: float | None,
    motion_start: float = -math.inf,
    motion_end: float = math.inf,
) -> None:
    """Raises a usage error if ``--from`` and ``--to`` are not times of a motion, in order.

    Args:
        begin, end: values of the options [s]; None for the start and the end of the motion.
        motion_start, motion_end: times of the motion [s].
    """
    for option, t in (("--from", begin), ("--to", end)):
        if t is not None and not math.isfinite(t):
            fail(f"found {t}; needed: a time in seconds", option)
        if (
            t is not None
            and not motion_start - _TIME_TOLERANCE <= t <= motion_end + _TIME_TOLERANCE
        ):
            fail(
                f"found {t:g} s; the motion lasts from {motion_start:g} s to {motion_end:g} s",
                option,
            )
    part_begin, part_end = (
        (motion_start if begin is None else begin),
        (motion_end if end is None else end),
    )
    if not part_begin < part_end:
        option = "--from" if end is None else "--to"
        fail(f"found {part_begin:g} s to {part_end:g} s; needed: an end after the begin", option)


def _parse_view(text: str) -> str | tuple[float, float]:
    if text in _VIEWS:
        return text
    try:
        azimuth, elevation = (float(part) for part in text.split(","))
    except ValueError:
        azimuth = elevation = math.nan
    if not (math.isfinite(azimuth) and abs(elevation) <= 90.0):
        fail(
            f"{text!r} is neither one of {', '.join(_VIEWS)} nor AZIMUTH,ELEVATION in degrees "
            "(elevation from -90 to 90)",
            "--view",
        )
    return azimuth, elevation


def _parse_names(text: str) -> Bodies:
    if text.strip() == "all":
        return "all"
    names = tuple(name.strip() for name in text.split(","))
    if not all(names):
        fail(f"{text!r} is not NAME,NAME,...", "--bodies")
    return names


def _parse_size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    size = (int(match[1]), int(match[2])) if match else (0, 0)
    if not all(_MIN_SIZE <= n <= _MAX_SIZE for n in size):
        fail(f"{text!r} is not WIDTHxHEIGHT in pixels, {_MIN_SIZE} to {_MAX_SIZE} each", "--size")
    return size
