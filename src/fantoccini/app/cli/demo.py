"""``fantoccini demo``: the bundled marionette walks, waves and nods."""

from __future__ import annotations

from pathlib import Path

from fantoccini.app.cli.simulate import end_with, timed
from fantoccini.app.cli_support import (
    Steps,
    check_new_folder,
    check_outputs,
    marionette,
    report,
    write,
    write_outputs,
    writing,
)
from fantoccini.dynamics.compiled import TimeStepping
from fantoccini.theatre.perform import WALK_POSES, walk

_STAGE, _NAME = "promenade", "marionette"
_METHOD, _SAVE_EVERY = TimeStepping(dt=1e-3), 5


def show_demo(folder: Path, quiet: bool) -> None:
    """Simulates the bundled performance, prints a summary and writes numbers, picture and film.

    Args:
        folder: folder for the files, created if it does not exist.
        quiet: print no progress and no summary.
    """
    check_new_folder(folder, "--out")
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    out = [folder / f"{_NAME}{ending}" for ending in (".npz", ".png", ".mp4")]
    check_outputs(out, None)
    with Steps(quiet) as steps:
        puppet = marionette(_STAGE, steps.named)
        steps.step("finding the rest pose")
        x0, inputs, duration = walk(puppet)
        run, seconds, reason = timed(
            steps, puppet, x0, inputs, duration, _METHOD, save_every=_SAVE_EVERY
        )
        write_outputs(puppet, run, out, None, steps, WALK_POSES)
    if not quiet:
        report(run, seconds)
        write("wrote " + ", ".join(map(str, out)))
    end_with(run, reason)
