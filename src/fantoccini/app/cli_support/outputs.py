"""Output files of a run; the suffix selects the format. A file appears only when it is complete.

A caption is text that a film shows during a time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from fantoccini.app.cli_support.files import (
    ANIMATION_SUFFIXES,
    CAPTION_SUFFIXES,
    DATA_SUFFIXES,
    FILM_SUFFIXES,
    PICTURE_SUFFIXES,
    OutputError,
    check_output,
    fail,
    output_errors,
)
from fantoccini.app.cli_support.output_options import OutputOptions
from fantoccini.app.cli_support.terminal import ProgressDisplay, print_message
from fantoccini.base import FantocciniError, FileError, StateError, UnknownNameError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Trajectory
from fantoccini.output.animation import SUFFIXES, format_of

if TYPE_CHECKING:
    from fantoccini.output.view import Guides
    from fantoccini.theatre.gestures import Caption


def check_outputs(
    out: Sequence[Path], plot: Path | None, option: str = "--out", captions: bool = False
) -> None:
    """Raises a usage error if a file cannot be written; called before long computations.

    Args:
        out: files of numbers, strips, films and animations.
        plot: file of a plot against time.
        option: name of the option that gave ``out``, for the message.
        captions: whether the command can write captions, too.
    """
    suffixes = (*DATA_SUFFIXES, *PICTURE_SUFFIXES, *FILM_SUFFIXES, *ANIMATION_SUFFIXES)
    for path in out:
        check_output(path, (*suffixes, *CAPTION_SUFFIXES) if captions else suffixes, option)
        if path.suffix.lower() in SUFFIXES:
            format_of(path, None)
    if plot is not None:
        check_output(plot, PICTURE_SUFFIXES, "--plot")
    paths = [*out, *([plot] if plot else [])]
    for path in paths:
        if [p.absolute() for p in paths].count(path.absolute()) > 1:
            fail(f"{path} is given twice", option)


def check_captions(out: Sequence[Path], captions: Sequence[Caption]) -> None:
    """Raises a usage error if a caption file is requested for a run without captions."""
    for path in out:
        if path.suffix.lower() in CAPTION_SUFFIXES and not captions:
            fail(f"{path}: there are no captions; scores and plays can have some", "--out")


def check_extras(picture: Path | None, save: Path | None) -> None:
    """Raises a usage error if the files of ``--picture`` and ``--save`` cannot be written."""
    if picture is not None:
        check_output(picture, PICTURE_SUFFIXES, "--picture")
    if save is not None:
        check_output(save, (".npz",), "--save")


def check_bodies(marionette: Marionette, output_options: OutputOptions) -> None:
    """Raises UnknownNameError if ``--bodies`` names something other than a body."""
    if output_options.bodies is not None:
        from fantoccini.output import animation

        animation.check_bodies(marionette, output_options.bodies)


def write_outputs(
    marionette: Marionette,
    run: Trajectory,
    out: Sequence[Path],
    plot: Path | None,
    display: ProgressDisplay,
    poses: Sequence[float] | None = None,
    output_options: OutputOptions | None = None,
    film_options: Mapping[str, Any] | None = None,
    guides: Guides | None = None,
) -> None:
    """Writes all output files.

    Args:
        marionette: the puppet.
        run: its motion.
        out: files of numbers, strips, films and animations.
        plot: file of a plot of the whole motion against time.
        display: progress display.
        poses: times of a strip's poses [s]; None as for :func:`fantoccini.output.strip`.
        output_options: options of the files.
        film_options: captions, sounds and shots, as arguments of :func:`fantoccini.output.film`. A
            film beside a file with its captions (``bows.mp4``, ``bows.srt``) shows them only if
            asked.
        guides: guides in strips and films, as for :func:`fantoccini.output.film`.

    Raises:
        OutputError: some files could not be written; all others are.
    """
    output_options = output_options or OutputOptions()
    check_bodies(marionette, output_options)
    if output_options.forces and run.contact is None:
        fail(f"{marionette.name} has no contacts, so there are no forces to draw", "--forces")
    whole_run, reasons, mistakes = run, [], []
    try:
        run = output_options.part(run)
    except typer.BadParameter as error:  # a search's duration was not known before
        reasons.append(f"{error.message}; the files contain the whole motion")
    except OutputError as error:
        reasons.append(str(error))
        out = ()
    captioned_stems = {
        path.with_suffix("") for path in out if path.suffix.lower() in CAPTION_SUFFIXES
    }
    for path in (*out, *([] if plot is None else [plot])):
        try:
            with output_errors(path):
                if path is plot:
                    _write_plot(whole_run, path, display, output_options)
                else:
                    film_arguments = dict(film_options or {})
                    # Video players show the captions of an .srt file with the film's name.
                    has_caption_file = (
                        path.suffix.lower() == ".mp4" and path.with_suffix("") in captioned_stems
                    )
                    if path.suffix.lower() in FILM_SUFFIXES and (
                        not output_options.shows_captions
                        or (has_caption_file and output_options.captions is None)
                    ):
                        film_arguments.pop("captions", None)
                    _write_output(
                        marionette,
                        run,
                        path,
                        display,
                        poses,
                        output_options,
                        film_arguments,
                        guides,
                    )
        except (FileError, StateError, UnknownNameError) as error:
            mistakes.append(error)  # in the arguments; the other files are written first
        except FantocciniError as error:
            reasons.append(str(error) if isinstance(error, OutputError) else f"{path}: {error}")
    if mistakes and not reasons:
        raise mistakes[0]
    if reasons:
        raise OutputError("\n".join([*reasons, *map(str, mistakes)]))


def _write_plot(
    run: Trajectory, path: Path, display: ProgressDisplay, output_options: OutputOptions
) -> None:
    from fantoccini.output import view

    display.stage(f"drawing {path}")
    view.plot(run, path, **output_options.nondefault("theme"))


def _write_output(
    marionette: Marionette,
    run: Trajectory,
    path: Path,
    display: ProgressDisplay,
    poses: Sequence[float] | None,
    output_options: OutputOptions,
    film_options: Mapping[str, Any],
    guides: Guides | None,
) -> None:
    suffix = path.suffix.lower()
    if suffix == ".npz":
        run.save(path)
    elif suffix in SUFFIXES:
        from fantoccini.output.animation import export

        display.stage(f"writing {path}")
        export(run, path, marionette=marionette, **output_options.nondefault("fps", "bodies"))
    elif suffix in CAPTION_SUFFIXES:
        from fantoccini.output import view

        view.save_captions(film_options["captions"], path, float(run.t[0]), float(run.t[-1]))
    elif suffix in PICTURE_SUFFIXES:
        from fantoccini.output import view

        display.stage(f"drawing {path}")
        options = output_options.nondefault("view", "focus", "theme", "size", "forces", "look")
        view.strip(marionette, run, path, times=poses, guides=guides, **options)
    else:
        from fantoccini.output import view
        from fantoccini.output.view import MAX_GIF_FPS

        if suffix == ".gif" and (output_options.fps or 0.0) > MAX_GIF_FPS:
            print_message(f"{path}: has {MAX_GIF_FPS:g} frames per second, the limit of browsers")
        view.film(
            marionette,
            run,
            path,
            progress=display.bar(f"rendering {path}"),
            **output_options.nondefault("view", "focus", "theme", "size", "fps", "forces", "look"),
            guides=guides,
            **film_options,
        )
