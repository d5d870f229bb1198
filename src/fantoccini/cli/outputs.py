"""Files that a run leaves, chosen by their endings. Each appears whole or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fantoccini.cli.files import FILMS, NUMBERS, PICTURES, check_output, fail
from fantoccini.cli.look import Look
from fantoccini.cli.terminal import Steps
from fantoccini.errors import FantocciniError
from fantoccini.marionette import Marionette
from fantoccini.motion import Trajectory


class OutputError(FantocciniError):
    """A file could not be written although its folder takes files."""


def check_outputs(out: Sequence[Path], plot: Path | None) -> None:
    """Ends in a usage error when a file cannot be written, before anything long begins.

    Args:
        out: numbers, strips and films.
        plot: plots against time.
    """
    for path in out:
        check_output(path, (*NUMBERS, *PICTURES, *FILMS), "--out")
    if plot is not None:
        check_output(plot, PICTURES, "--plot")
    paths = [*out, *([plot] if plot else [])]
    for path in paths:
        if [p.absolute() for p in paths].count(path.absolute()) > 1:
            fail(f"{path} is to be written twice", "--out")


def write_outputs(
    marionette: Marionette,
    run: Trajectory,
    out: Sequence[Path],
    plot: Path | None,
    steps: Steps,
    poses: str | Sequence[float] = "poses",
    look: Look | None = None,
) -> None:
    """Writes every file.

    Args:
        marionette: the puppet.
        run: what it did.
        out: numbers, strips and films.
        plot: plots against time.
        steps: shows how far it is.
        poses: times of a strip's poses; see :func:`fantoccini.view.strip`.
        look: of pictures and films.
    """
    look = look or Look()
    for path in out:
        try:
            _write(marionette, run, path, steps, poses, look)
        except OSError as error:
            raise OutputError(f"{path} cannot be written: {error.strerror or error}") from None
    if plot is not None:
        from fantoccini import view

        steps.step(f"drawing {plot}")
        view.plot(run, plot, **look.given("theme"))


def _write(
    marionette: Marionette,
    run: Trajectory,
    path: Path,
    steps: Steps,
    poses: str | Sequence[float],
    look: Look,
) -> None:
    ending = path.suffix.lower()
    if ending == ".npz":
        run.save(path)
    elif ending == ".csv":
        run.to_csv(path)
    elif ending in PICTURES:
        from fantoccini import view

        steps.step(f"drawing {path}")
        seen = look.given("view", "focus", "theme", "size")
        view.strip(marionette, run, path, times=poses, **seen)
    else:
        from fantoccini import view

        done = steps.bar(f"filming {path}", 1.0)
        view.film(
            marionette, run, path, progress=lambda frame, frames: done(frame / frames),
            **look.given("view", "focus", "theme", "size", "fps"),
        )  # fmt: skip
