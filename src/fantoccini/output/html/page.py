"""Pages of reports: self-contained HTML files with tables and pictures."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fantoccini.base import PictureError, replacing
from fantoccini.output.html.elements import Element, element, figure_image, line_elements, to_html

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


@dataclass(frozen=True)
class Table:
    """A table of a page.

    Attributes:
        header: headings of the columns; a final ``>`` aligns the column to the right.
        lines: cells as plain text.
        red_lines: indices of lines to mark in red, because something fails.
    """

    header: tuple[str, ...]
    lines: tuple[tuple[str, ...], ...]
    red_lines: frozenset[int] = frozenset()


class Page:
    """Page that is filled from top to bottom with plain texts, tables and figures.

    Empty texts and lists are left out.

    Args:
        title: title of the window.
        heading: heading of the page.
    """

    def __init__(self, title: str, heading: str):
        self._title = title
        self._body = element("body", element("h1", heading))

    def section(self, title: str) -> None:
        """Begins a section."""
        self._body.append(element("h2", title))

    def subsection(self, title: str) -> None:
        """Begins a section within a section."""
        self._body.append(element("h3", title))

    def text(self, text: str) -> None:
        """Adds a paragraph."""
        self._paragraph(text)

    def note(self, text: str) -> None:
        """Adds a paragraph of secondary text."""
        self._paragraph(text, "note")

    def verdict(self, text: str, holds: bool) -> None:
        """Adds the conclusion of the report, green if it holds and red if not."""
        self._paragraph(text, f"verdict {'holds' if holds else 'fails'}")

    def items(self, texts: Iterable[str]) -> None:
        """Adds a list."""
        if entries := line_elements(texts, "li"):
            self._body.append(element("ul", *entries))

    def table(self, table: Table) -> None:
        """Adds a table, which scrolls if the window is too narrow."""
        aligned_right = [heading.endswith(">") for heading in table.header]
        head = _row("th", [heading.rstrip(">") for heading in table.header], aligned_right)
        body = [
            _row("td", line, aligned_right, "wrong" if i in table.red_lines else "")
            for i, line in enumerate(table.lines)
        ]
        content = element("table", element("thead", head), element("tbody", *body))
        self._body.append(element("div", content, class_="wide"))

    def drawing(self, figure: Figure, alt: str, width_share: float = 1.0) -> None:
        """Adds a figure with few lines as SVG.

        Args:
            figure: figure to draw.
            alt: alternative text.
            width_share: width relative to that of the page.
        """
        style = f"width: {100.0 * width_share:.0f}%"
        self._body.append(figure_image(figure, alt, "svg", style=style))

    def plots(self, figures: Iterable[tuple[Figure, str]]) -> None:
        """Adds figures with many points as PNG, each with its alternative text."""
        for figure, alt in figures:
            self._body.append(figure_image(figure, alt, "png", style="width: 100%"))

    def to_html(self) -> str:
        """The page as text."""
        head = element(
            "head",
            element("meta", charset="utf-8"),
            element("meta", name="viewport", content="width=device-width, initial-scale=1"),
            element("title", self._title),
            element("style", _STYLE),
        )
        for part in (
            head,
            *self._body.iter("tr"),
            *self._body,
        ):  # short lines, for readers of the source
            part.tail = "\n"
        return f"<!DOCTYPE html>\n{to_html(element('html', head, self._body, lang='en'))}\n"

    def _paragraph(self, text: str, css_class: str = "") -> None:
        if text:
            self._body.append(element("p", text, class_=css_class))


def write_page(path: str | os.PathLike[str], build_page: Callable[[], Page]) -> Path:
    """Writes a report, if its path is valid. The file appears only when complete.

    Args:
        path: path that ends in ``.html``.
        build_page: function that returns the page.

    Returns:
        The path.

    Raises:
        ValueError: the path has another ending.
        PictureError: there is no such folder, or it cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".html":
        raise ValueError(f"a report ends in .html, not in {path.suffix!r}")
    if not os.path.isdir(path.parent):
        raise PictureError(f"there is no folder {path.parent}")
    text = build_page().to_html()
    try:
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise PictureError(f"{path} cannot be written: {error.strerror}") from error
    return path


def _row(
    tag: str, cells: Sequence[str], aligned_right: Sequence[bool], css_class: str = ""
) -> Element:
    elements = [
        element(tag, cell, class_="r" if is_right else "")
        for cell, is_right in zip(cells, aligned_right, strict=True)
    ]
    return element("tr", *elements, class_=css_class)
