"""The report of a play's verification: one page with pictures that needs nothing else."""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Callable, Iterable
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from fantoccini.errors import PictureError
from fantoccini.files import replacing
from fantoccini.view import play_tables
from fantoccini.view.drawing import DPI
from fantoccini.view.play_tables import Table
from fantoccini.view.stage_plan import plan
from fantoccini.view.stills import Stills
from fantoccini.view.timeline import timeline

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fantoccini.plays import Verification

_STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.45 system-ui, "Helvetica Neue", Arial, sans-serif; color: #2b2a28;
  background: #fdfcf9; margin: 0 auto; padding: 1.5em 2em 4em; max-width: 1180px; }
h1 { font-size: 1.9em; margin: 0; }
h2 { font-size: 1.25em; margin: 2em 0 .5em; border-bottom: 1px solid #c9c3b4; }
h3 { font-size: 1em; margin: 1.4em 0 .4em; }
p { margin: .4em 0; max-width: 60em; }
.wide { overflow-x: auto; }
img { display: block; max-width: 100%; height: auto; margin: .6em 0; }
table { border-collapse: collapse; margin: .5em 0; font-size: .87em; }
th, td { text-align: left; vertical-align: top; padding: .16em 1em .16em 0;
  border-bottom: 1px solid #e6e2d8; }
th, td:not(:last-child) { white-space: nowrap; }
th { font-weight: 600; border-bottom: 1px solid #8a857a; }
.r { text-align: right; font-variant-numeric: tabular-nums; }
.verdict { font-weight: 600; padding: .5em .8em; margin: 1em 0; border-left: 6px solid; }
.holds { border-color: #00855a; background: #e8f4ee; }
.fails { border-color: #b3261e; background: #fbeceb; }
.wrong td { color: #b3261e; }
.note { color: #6b675e; font-size: .87em; }
li { margin: .15em 0; }
@media print {
  .wide { overflow: visible; }
  body { font-size: 10pt; padding: 0; max-width: none; background: white; }
  h2, h3, h2 + p { break-after: avoid; }
  img, tr { break-inside: avoid; }
  img { width: auto !important; max-height: 165mm; }
  .verdict, .wrong td { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  @page { size: A4 landscape; margin: 12mm; }
}
"""

Progress = Callable[[float], None]
"""Called with the share that is done."""


def play_report(
    verification: Verification,
    path: str | os.PathLike[str],
    progress: Progress | None = None,
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
    path = Path(path)
    if path.suffix.lower() != ".html":
        raise ValueError(f"a report ends in .html, not in {path.suffix!r}")
    if not path.parent.is_dir():
        raise PictureError(f"there is no folder {path.parent}")
    page = _page(verification, progress or (lambda share: None))
    try:
        with replacing(path) as part:
            part.write_text(page, encoding="utf-8")
    except OSError as reason:
        raise PictureError(f"{path} cannot be written: {reason.strerror}") from reason
    return path


def _page(verification: Verification, progress: Progress) -> str:
    play = verification.play
    name = escape(play.name)
    parts = [
        f"<h1>{name}</h1>", _paragraph(play.cast.file.about), _paragraph(_facts(verification)),
        *_verdict(verification),
        "<h2>Cast and stage</h2>", play_tables.cast_table(verification).html(),
        _svg(plan(play, verification.space), f"Plan of the stage of {play.name}", 0.66),
        play_tables.space_table(verification).html(),
        "<h2>Timeline</h2>",
        _svg(timeline(play), f"Timeline of {play.name}"),
        '<p class="note">Bars are the hands\' motions, with the numbers of the cues below; '
        "a cross is a cue that cannot be done, where it was to begin. A cue is seen where the limb "
        "turns at its mark, if there is such a turn, otherwise where the hands begin.</p>",
    ]  # fmt: skip
    progress(0.1)
    stills = Stills(play, verification.run)
    ends = [*play.acts.values(), play.duration]
    for k, act in enumerate(play.acts):
        parts += [
            f"<h2>{escape(act)}</h2>",
            _paragraph(f"From {ends[k]:.2f} to {ends[k + 1]:.2f} s.", "note"),
            _png(stills.of_act(act), f"Stills of {act}"),
            play_tables.cue_table(verification, act).html(),
        ]
        progress(0.1 + 0.7 * (k + 1) / len(play.acts))
    parts += _measured(verification)
    progress(1.0)
    body = "\n".join(part for part in parts if part)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{name}: verification</title>\n<style>{_STYLE}</style>\n</head>\n"
        f"<body>\n{body}\n</body>\n</html>\n"
    )


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
    lacking, faults = play.lacking, verification.faults
    late = 1e3 * verification.worst
    first = (
        f"{len(lacking)} of {len(play.cues)} cues cannot be done as written"
        if lacking else "Every cue is done as written"
    )  # fmt: skip
    second = (
        f"the run breaks {len(faults)} of its promises"
        if faults else f"the run keeps its promises, no cue more than {late:.0f} ms off"
    )  # fmt: skip
    kind = "fails" if lacking or faults else "holds"
    parts = [_paragraph(f"{first}; {second}.", f"verdict {kind}")]
    if play.changes:
        parts += ["<h3>What is not as written, and why</h3>", _list(map(str, play.changes))]
    if faults:
        parts += ["<h3>What does not hold</h3>", _list(faults)]
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
    parts = ["<h2>Measured</h2>", _paragraph(f"The run: {verification.run.status.message}.")]
    for title, text, table in sections:
        parts += [f"<h3>{title}</h3>", _paragraph(text, "note"), table.html()]
    return parts


def _paragraph(text: str, kind: str = "") -> str:
    if not text:
        return ""
    return f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>"


def _list(lines: Iterable[str]) -> str:
    return "<ul>\n" + "\n".join(f"<li>{escape(line)}</li>" for line in lines) + "\n</ul>"


def _svg(figure: Figure, words: str, share: float = 1.0) -> str:
    """A drawing as an embedded picture: its names cannot clash with those of another."""
    written = io.BytesIO()
    figure.savefig(written, format="svg", facecolor=figure.get_facecolor())
    return _image("svg+xml", written.getvalue(), words, share)


def _png(figure: Figure, words: str) -> str:
    written = io.BytesIO()
    figure.savefig(written, format="png", dpi=DPI)
    return _image("png", written.getvalue(), words)


def _image(kind: str, content: bytes, words: str, share: float = 1.0) -> str:
    data = base64.b64encode(content).decode("ascii")
    return (
        f'<img alt="{escape(words)}" style="width: {100.0 * share:.0f}%" '
        f'src="data:image/{kind};base64,{data}">'
    )
