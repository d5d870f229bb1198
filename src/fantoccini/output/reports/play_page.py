"""Report of a play's verification: one self-contained page with pictures.

A cue is a line of the play: a verb with its player and time. In names, D stands for dynamic
coordinates, which move by the equations of motion, and K for driven ones: ends and lengths of
strings, driven joints.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from fantoccini.base import OnProgress, Progress
from fantoccini.output.html import Page, write_page
from fantoccini.output.reports import play_tables
from fantoccini.output.reports.stage_plan import draw_stage_plan
from fantoccini.output.reports.timeline import draw_timeline
from fantoccini.output.view import ActStills

if TYPE_CHECKING:
    from fantoccini.theatre.plays import Verification


def play_report(
    verification: Verification, path: str | os.PathLike[str], progress: OnProgress | None = None
) -> Path:
    """Writes the report of a play's verification: one HTML file, pictures included.

    It has the verdict, cast and stage plan, the timeline, stills and cues of every act, and
    measurements: clearances, tensions, catches, speeds, accelerations and ranges of the hands.

    Args:
        verification: verification of the play.
        path: path that ends in ``.html``.
        progress: callback that receives the completed share.

    Returns:
        The path of the page.

    Raises:
        ValueError: the path has another ending.
    """
    return write_page(path, lambda: _page(verification, progress or (lambda progress: None)))


def _page(verification: Verification, progress: OnProgress) -> Page:
    play = verification.play
    page = Page(f"{play.name}: verification", play.name)
    page.text(play.cast.file.about)
    page.text(_key_numbers(verification))
    _add_verdict(page, verification)
    page.section("Cast and stage")
    page.table(play_tables.cast_table(verification))
    page.drawing(
        draw_stage_plan(play, verification.space), f"Plan of the stage of {play.name}", 0.66
    )
    page.table(play_tables.space_table(verification))
    page.section("Timeline")
    page.drawing(draw_timeline(play), f"Timeline of {play.name}")
    page.note(
        "Bars are motions of the hands, with the numbers of the cues in the tables below. A cross "
        "is a cue that cannot be done, at its planned start. The observed time of a cue is when "
        "the limb turns at its mark or, without such a turn, when the hands begin to move."
    )
    progress(Progress(done=0.1, total=1.0))
    stills = ActStills(play, verification.run)
    act_times = [*play.acts.values(), play.duration]
    for k, act in enumerate(play.acts):
        page.section(act)
        page.note(f"From {act_times[k]:.2f} to {act_times[k + 1]:.2f} s.")
        page.plots([(stills.of_act(act), f"Stills of {act}")])
        page.table(play_tables.cue_table(verification, act))
        progress(Progress(done=0.1 + 0.7 * (k + 1) / len(play.acts), total=1.0))
    _add_measurements(page, verification)
    progress(Progress(done=1.0, total=1.0))
    return page


def _key_numbers(verification: Verification) -> str:
    play = verification.play
    coordinates = play.marionette.coordinates
    n = len(play.cast.players)
    return (
        f"{play.duration:.1f} s at {60.0 / play.score.beat:g} beats a minute; "
        f"{n} player{'s' * (n > 1)}, {len(play.cues)} cues; {coordinates.n_vD} degrees of freedom, "
        f"{len(play.marionette.tree.strings)} strings, {coordinates.n_vK} driven coordinates."
    )


def _add_verdict(page: Page, verification: Verification) -> None:
    """Adds the verdict, changed and refused cues, and broken requirements."""
    play = verification.play
    faults, n_refused = verification.faults, len(play.refused)
    max_delay = 1e3 * verification.max_lateness
    cue_verdict = "Every cue is done as written" if play else play.counts
    if n_refused:
        cue_verdict = f"{n_refused} of {len(play.cues)} cues cannot be done as written"
    run_verdict = (
        f"the run breaks {len(faults)} requirement{'s' * (len(faults) > 1)}"
        if faults
        else f"the run meets every requirement; no cue is off by more than {max_delay:.0f} ms"
    )
    page.verdict(f"{cue_verdict}; {run_verdict}.", not (play.deviations or faults))
    if play.changes:
        page.subsection("Changes to the script, with reasons")
        page.items(map(str, play.changes))
    if faults:
        page.subsection("Broken requirements")
        page.items(faults)


def _add_measurements(page: Page, verification: Verification) -> None:
    page.section("Measured")
    page.text(f"The run: {verification.run.status.message}.")
    page.subsection("Smallest clearances")
    page.note(
        "Over the whole run: first bodies of players, obstacles and the floor, then strings that "
        "come within 0.3 m of others."
    )
    page.table(play_tables.clearance_table(verification))
    page.subsection("Strings")
    page.note(
        "Largest tension over the whole run, and relative to the weight of the whole player. A "
        "catch is a string that snaps taut: often many times in a row, and softly."
    )
    page.table(play_tables.string_table(verification))
    page.subsection("Hands")
    page.note("For every hand, the coordinate that is nearest to its bound.")
    page.table(play_tables.hand_table(verification))
