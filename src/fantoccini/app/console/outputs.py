"""Output files of a run, by ending. Each appears complete or not at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fantoccini.app.console.files import (
    ANIMATIONS,
    FILMS,
    NUMBERS,
    PICTURES,
    check_output,
    fail,
    writing,
)
from fantoccini.app.console.look import Look
from fantoccini.app.console.terminal import Steps, say
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Trajectory
from fantoccini.output.animation import ENDINGS, format_of

if TYPE_CHECKING:
    from fantoccini.output.view import Guides


def check_outputs(out: Sequence[Path], plot: Path | None, option: str = "--out") -> None:
    """Raises a usage error if a file cannot be written, before any long computation.

    Args:
        out: numbers, strips, films and animations.
        plot: plot against time.
        option: that ``out`` was given for.
    """
    for path in out:
        check_output(path, (*NUMBERS, *PICTURES, *FILMS, *ANIMATIONS), option)
        if path.suffix.lower() in ENDINGS:
            format_of(path, None)
    if plot is not None:
        check_output(plot, PICTURES, "--plot")
    paths = [*out, *([plot] if plot else [])]
    for path in paths:
        if [p.absolute() for p in paths].count(path.absolute()) > 1:
            fail(f"{path} is given twice", option)


def check_extras(picture: Path | None, save: Path | None) -> None:
    """Raises a usage error if what ``--picture`` and ``--save`` name cannot be written."""
    if picture is not None:
        check_output(picture, PICTURES, "--picture")
    if save is not None:
        check_output(save, (".npz",), "--save")


def check_bodies(marionette: Marionette, look: Look) -> None:
    """Raises UnknownNameError where ``--bodies`` names something else than a body."""
    if look.bodies is not None:
        from fantoccini.output import animation

        animation.check_bodies(marionette, look.bodies)


def write_outputs(
    marionette: Marionette,
    run: Trajectory,
    out: Sequence[Path],
    plot: Path | None,
    steps: Steps,
    poses: str | Sequence[float] = "poses",
    look: Look | None = None,
    films: Mapping[str, Any] | None = None,
    guides: Guides | None = None,
) -> None:
    """Writes every file.

    Args:
        marionette: the puppet.
        run: its motion.
        out: numbers, strips, films and animations.
        plot: plot against time.
        steps: reports progress.
        poses: times of a strip's poses; see :func:`fantoccini.output.strip`.
        look: of pictures, films and animations.
        films: captions and sounds, as :func:`fantoccini.output.film` takes them.
        guides: lines in strips and films, likewise.
    """
    look = look or Look()
    check_bodies(marionette, look)
    if look.forces and run.contact is None:
        fail(f"{marionette.name} has no contact, so that there are no forces to draw", "--forces")
    for path in out:
        with writing(path):
            _write(marionette, run, path, steps, poses, look, films or {}, guides)
    if plot is not None:
        from fantoccini.output import view

        steps.step(f"drawing {plot}")
        view.plot(run, plot, **look.given("theme"))


def _write(
    marionette: Marionette,
    run: Trajectory,
    path: Path,
    steps: Steps,
    poses: str | Sequence[float],
    look: Look,
    films: Mapping[str, Any],
    guides: Guides | None,
) -> None:
    ending = path.suffix.lower()
    if ending == ".npz":
        run.save(path)
    elif ending in ENDINGS:
        from fantoccini.output.animation import export

        steps.step(f"writing {path}")
        export(run, path, marionette=marionette, **look.given("fps", "bodies"))
    elif ending in PICTURES:
        from fantoccini.output import view

        steps.step(f"drawing {path}")
        options = look.given("view", "focus", "theme", "size", "forces")
        view.strip(marionette, run, path, times=poses, guides=guides, **options)
    else:
        from fantoccini.output import view
        from fantoccini.output.view import MAX_GIF_FPS

        if ending == ".gif" and (look.fps or 0.0) > MAX_GIF_FPS:
            say(f"{path}: has {MAX_GIF_FPS:g} frames a second, the most that browsers play")
        view.film(
            marionette,
            run,
            path,
            progress=steps.bar(f"rendering {path}"),
            **look.given("view", "focus", "theme", "size", "fps", "forces"),
            guides=guides,
            **films,
        )
