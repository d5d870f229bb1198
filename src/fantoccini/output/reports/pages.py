"""Pages that need nothing else: their frame and style, tables, and pictures inside."""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from fantoccini.base import PictureError, replacing
from fantoccini.output.view import DPI

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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


def checked_page(path: str | os.PathLike[str]) -> Path:
    """The path of a page.

    Raises:
        ValueError: it has another ending than ``.html``.
        PictureError: there is no such folder.
    """
    path = Path(path)
    if path.suffix.lower() != ".html":
        raise ValueError(f"a report ends in .html, not in {path.suffix!r}")
    if not os.path.isdir(path.parent):
        raise PictureError(f"there is no folder {path.parent}")
    return path


def write_page(path: Path, text: str) -> None:
    """Writes a page whole."""
    try:
        with replacing(path) as part:
            part.write_text(text, encoding="utf-8")
    except OSError as reason:
        raise PictureError(f"{path} cannot be written: {reason.strerror}") from reason


def page(title: str, parts: Iterable[str]) -> str:
    """A page of parts in HTML; the title is plain text."""
    body = "\n".join(part for part in parts if part)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n"
        f"<body>\n{body}\n</body>\n</html>\n"
    )


@dataclass(frozen=True)
class Table:
    """A table of a page.

    Attributes:
        header: of the columns; those that end in ``>`` are set flush right.
        lines: cells as plain text.
        wrong: indices of lines that say what does not hold.
    """

    header: tuple[str, ...]
    lines: tuple[tuple[str, ...], ...]
    wrong: frozenset[int] = frozenset()

    def html(self) -> str:
        """The table; names are escaped."""
        right = [heading.endswith(">") for heading in self.header]
        head = _row("th", [heading.rstrip(">") for heading in self.header], right)
        body = "\n".join(
            _row("td", line, right, "wrong" if i in self.wrong else "")
            for i, line in enumerate(self.lines)
        )
        return (
            f'<div class="wide"><table>\n<thead>{head}</thead>\n<tbody>\n{body}\n</tbody>\n'
            "</table></div>"
        )


def _row(tag: str, cells: Iterable[str], right: Sequence[bool], kind: str = "") -> str:
    made = "".join(
        f'<{tag} class="r">{escape(cell)}</{tag}>' if flush else f"<{tag}>{escape(cell)}</{tag}>"
        for cell, flush in zip(cells, right, strict=True)
    )
    return f'<tr class="{kind}">{made}</tr>' if kind else f"<tr>{made}</tr>"


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph of plain text, or nothing; ``kind`` is its class."""
    if not text:
        return ""
    return f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>"


def listing(lines: Iterable[str]) -> str:
    """A list of plain texts."""
    return "<ul>\n" + "\n".join(f"<li>{escape(line)}</li>" for line in lines) + "\n</ul>"


def svg(figure: Figure, words: str, share: float = 1.0) -> str:
    """A drawing as an embedded picture: its names cannot clash with those of another."""
    written = io.BytesIO()
    figure.savefig(written, format="svg", facecolor=figure.get_facecolor())
    return _image("svg+xml", written.getvalue(), words, share)


def png(figure: Figure, words: str) -> str:
    """A drawing with many points as an embedded picture."""
    written = io.BytesIO()
    figure.savefig(written, format="png", dpi=DPI)
    return _image("png", written.getvalue(), words)


def _image(kind: str, content: bytes, words: str, share: float = 1.0) -> str:
    data = base64.b64encode(content).decode("ascii")
    return (
        f'<img alt="{escape(words)}" style="width: {100.0 * share:.0f}%" '
        f'src="data:image/{kind};base64,{data}">'
    )
