"""The report of a play's verification: one page with pictures that needs nothing else."""

from __future__ import annotations

import os
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from fantoccini.base import OnProgress, Progress
from fantoccini.output.reports import play_tables
from fantoccini.output.reports.pages import (
    Table,
    checked_page,
    listing,
    page,
    paragraph,
    png,
    svg,
    write_page,
)
from fantoccini.output.reports.stage_plan import plan
from fantoccini.output.reports.timeline import timeline
from fantoccini.output.view import Stills

if TYPE_CHECKING:
    from fantoccini.theatre.plays import Verification

"""Called with the share that is done."""


def play_report(
    verification: Verification, path: str | os.PathLike[str], progress: OnProgress | None = None
) -> Path:
    """Writes the report of a play's verification: one HTML file, pictures included.

    It has the verdict, cast and stage from above, the timeline, stills and cues of every act, and
    what was measured: clearances, tensions, catches, speeds and accelerations of the hands and
    where they go.

    Args:
        verification: of the play.
        path: ends in ``.html``.
        progress: called with the share that is done.

    Returns:
        The path of the page.

    Raises:
        ValueError: the path has another ending.
    """
    path = checked_page(path)
    write_page(path, _page(verification, progress or (lambda progress: None)))
    return path


def _page(verification: Verification, progress: OnProgress) -> str:
    play = verification.play
    name = escape(play.name)
    parts = [
        f"<h1>{name}</h1>",
        paragraph(play.cast.file.about),
        paragraph(_facts(verification)),
        *_verdict(verification),
        "<h2>Cast and stage</h2>",
        play_tables.cast_table(verification).html(),
        svg(plan(play, verification.space), f"Plan of the stage of {play.name}", 0.66),
        play_tables.space_table(verification).html(),
        "<h2>Timeline</h2>",
        svg(timeline(play), f"Timeline of {play.name}"),
        '<p class="note">Bars are the hands\' motions, with the numbers of the cues below; '
        "a cross is a cue that cannot be done, where it was to begin. A cue is seen where the limb "
        "turns at its mark, if there is such a turn, otherwise where the hands begin.</p>",
    ]
    progress(Progress(done=0.1, total=1.0))
    stills = Stills(play, verification.run)
    ends = [*play.acts.values(), play.duration]
    for k, act in enumerate(play.acts):
        parts += [
            f"<h2>{escape(act)}</h2>",
            paragraph(f"From {ends[k]:.2f} to {ends[k + 1]:.2f} s.", "note"),
            png(stills.of_act(act), f"Stills of {act}"),
            play_tables.cue_table(verification, act).html(),
        ]
        progress(Progress(done=0.1 + 0.7 * (k + 1) / len(play.acts), total=1.0))
    parts += _measured(verification)
    progress(Progress(done=1.0, total=1.0))
    return page(f"{play.name}: verification", parts)


def _facts(verification: Verification) -> str:
    play = verification.play
    table = play.marionette.coordinates
    n = len(play.cast.players)
    return (
        f"{play.duration:.1f} s at {60.0 / play.score.beat:g} beats a minute; "
        f"{n} player{'s' * (n > 1)}, {len(play.cues)} cues; {table.n_vD} degrees of freedom, "
        f"{len(play.marionette.tree.strings)} strings, {table.n_vK} driven coordinates."
    )


def _verdict(verification: Verification) -> list[str]:
    """Whether all holds, what cannot be done and what does not hold."""
    play = verification.play
    faults, refused = verification.faults, len(play.refused)
    late = 1e3 * verification.worst
    first = "Every cue is done as written" if play else play.counts
    if refused:
        first = f"{refused} of {len(play.cues)} cues cannot be done as written"
    second = (
        f"the run breaks {len(faults)} of its promises"
        if faults
        else f"the run keeps its promises, no cue more than {late:.0f} ms off"
    )
    kind = "fails" if play.lacking or faults else "holds"
    parts = [paragraph(f"{first}; {second}.", f"verdict {kind}")]
    if play.changes:
        parts += ["<h3>What is not as written, and why</h3>", listing(map(str, play.changes))]
    if faults:
        parts += ["<h3>What does not hold</h3>", listing(faults)]
    return parts


def _measured(verification: Verification) -> list[str]:
    sections: list[tuple[str, str, Table]] = [
        (
            "Least clearances",
            "Of bodies of players, obstacles and the floor, then of strings "
            "that come within 0.3 m of others, over the whole run.",
            play_tables.clearance_table(verification),
        ),
        (
            "Strings",
            "Largest tension over the whole run, beside the weight of the whole player. A string "
            "catches where it goes taut: often many times in a row, and softly.",
            play_tables.string_table(verification),
        ),
        (
            "Hands",
            "Of every hand the coordinate that is nearest to its bound.",
            play_tables.hand_table(verification),
        ),
    ]
    parts = ["<h2>Measured</h2>", paragraph(f"The run: {verification.run.status.message}.")]
    for title, text, table in sections:
        parts += [f"<h3>{title}</h3>", paragraph(text, "note"), table.html()]
    return parts
