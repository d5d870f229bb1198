"""``fantoccini demo``: the bundled marionette walks, waves and nods."""

from __future__ import annotations

from pathlib import Path

from fantoccini.app.cli.simulate import exit_if_stopped, simulate_with_progress
from fantoccini.app.cli_support import (
    ProgressDisplay,
    check_new_folder,
    check_outputs,
    load_marionette,
    output_errors,
    print_output,
    report_run,
    write_outputs,
)
from fantoccini.dynamics.compiled import TimeStepping
from fantoccini.theatre.perform import WALK_PICTURE_TIMES, walk

_SCENE, _FILE_STEM = "promenade", "marionette"
_METHOD, _SAVE_EVERY = TimeStepping(dt=1e-3), 5


def show_demo(folder: Path, quiet: bool) -> None:
    """Simulates the bundled performance, prints a summary and writes numbers, picture and film.

    Args:
        folder: folder for the files, created if it does not exist.
        quiet: print no progress and no summary.
    """
    check_new_folder(folder, "--out")
    with output_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    out = [folder / f"{_FILE_STEM}{ending}" for ending in (".npz", ".png", ".mp4")]
    check_outputs(out, None)
    with ProgressDisplay(quiet) as display:
        puppet = load_marionette(_SCENE, display.update)
        display.stage("finding the rest pose")
        x0, inputs, duration = walk(puppet)
        run, seconds, reason = simulate_with_progress(
            display, puppet, x0, inputs, duration, _METHOD, save_every=_SAVE_EVERY
        )
        write_outputs(puppet, run, out, None, display, WALK_PICTURE_TIMES)
    if not quiet:
        report_run(run, seconds)
        print_output("wrote " + ", ".join(map(str, out)))
    exit_if_stopped(run, reason)
