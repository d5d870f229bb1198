"""``fantoccini demo``: the bundled marionette greets, steps and bows."""

from __future__ import annotations

from pathlib import Path

from fantoccini.cli.files import check_folder, fail, marionette
from fantoccini.cli.outputs import check_outputs, write_outputs
from fantoccini.cli.report import report
from fantoccini.cli.simulate import end_with, timed
from fantoccini.cli.terminal import Steps, write
from fantoccini.demo import POSES, performance

_NAME = "marionette"


def show_demo(folder: Path, quiet: bool) -> None:
    """Simulates the bundled performance, prints a summary and writes numbers, picture and film.

    Args:
        folder: where the files go; made when it is not there.
        quiet: no progress and no summary.
    """
    _make(folder)
    out = [folder / f"{_NAME}{ending}" for ending in (".npz", ".png", ".mp4")]
    check_outputs(out, None)
    with Steps(quiet) as steps:
        made = marionette(_NAME, steps.step)
        steps.step("finding where the puppet hangs at rest")
        x0, inputs, duration = performance(made)
        run, seconds, trouble = timed(steps, made, x0, inputs, duration)
        write_outputs(made, run, out, None, steps, POSES)
    if not quiet:
        report(run, seconds)
        write("left " + ", ".join(map(str, out)))
    end_with(run, trouble)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        fail(f"{folder} is a file; a folder is needed", "--out")
    except OSError as error:
        fail(f"{folder} cannot be made: {error.strerror}", "--out")
    check_folder(folder, "--out")
