"""HTML of a puppet and of a run for notebooks: a picture and tables.

Nothing is derived or compiled for it (see :mod:`fantoccini.output.view.still`). Every text is
escaped. A picture that fails is left out; if everything fails, the result is None and the notebook
shows plain text.

q_D and q_K are the dynamic and driven coordinates. At a catch a slack string becomes taut; slip is
the length that a winch has let out. A marionette is a puppet with its compiled equations;
`marionette.puppet` is the description in its file. The ledger is the table of energies and work. A
link is a body on its joint. A row of the tree describes a string, limit, spring or drive, a row of
the coordinate table one coordinate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.base.documents import Parameter
from fantoccini.model.tree import WORLD, StringRow, grow
from fantoccini.output.html import Element, element, figure_image, to_html
from fantoccini.output.view.drawing import DPI, PictureOptions, one_line
from fantoccini.output.view.geometry import state_geometry
from fantoccini.output.view.pictures import state_figure, strip_figure
from fantoccini.output.view.plots import plot
from fantoccini.output.view.still import UncompiledPuppet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fantoccini.dynamics.marionette import Marionette
    from fantoccini.motion import Trajectory

MAX_IMAGE_LENGTH = 270_000
"""Length of an embedded picture above which it is drawn again with fewer pixels [characters]."""
MAX_LINES = 16
"""Largest number of lines of a table; further lines are only counted."""
N_POSES = 5
"""Number of poses in a run's strip."""


def puppet_html(marionette: Marionette) -> str | None:
    """A puppet as HTML: its start pose, mass, strings and driven coordinates."""
    try:
        still = UncompiledPuppet(marionette.puppet, marionette.tree, marionette.number)
        image = _embedded_image(
            lambda: state_figure(
                state_geometry(still, still.start()), PictureOptions.resolve(size=(420, 520))
            ),
            "the start pose",
        )
        return _page_html(marionette.name, image, _puppet_tables(marionette))
    except Exception:  # a display must never fail a notebook's cell
        return None


def run_html(run: Trajectory) -> str | None:
    """A run as HTML: a strip of poses, or plots if its poses are unknown; and key numbers."""
    try:
        still = _still_of(run)
        if still is None:
            image = _embedded_image(lambda: plot(run, size=(900, 800)), "the run against time")
        else:
            image = _embedded_image(
                lambda: strip_figure(still, run, N_POSES, "poses", PictureOptions.resolve()),
                "poses of the run",
            )
        name = run.puppet.name if run.puppet else "run"
        return _page_html(name, image, _run_tables(run), wide=True)
    except Exception:  # a display must never fail a notebook's cell
        return None


def _still_of(run: Trajectory) -> UncompiledPuppet | None:
    """Puppet of a run; None if it is unknown or the run's strings do not fit it."""
    if run.puppet is None:
        return None
    tree = grow(run.puppet)
    if (tree.coordinates.q_D, tree.coordinates.q_K) != (run.coordinates.q_D, run.coordinates.q_K):
        return None
    still = UncompiledPuppet(run.puppet, tree)
    spans = [
        np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
        for points in still.string_points(run.q_D[:1], run.q_K[:1]).values()
    ]
    gaps = np.array(spans).reshape(-1) - still.string_lengths(run.q_D[:1], run.q_K[:1])[0]
    slip = 0.0 if run.slip is None else run.slip.values[0]
    return still if np.all(gaps - slip <= 1e-3 * np.abs(gaps).max(initial=1.0)) else None


def _embedded_image(figure: Callable[[], Figure], alt: str) -> Element | None:
    """Image embedded in the page; None if it cannot be drawn."""
    try:
        drawing = figure()
        width, style = f"{drawing.get_figwidth() * DPI:.0f}", "max-width:100%;height:auto"
        for scale in (2.0, 1.5, 1.0, 0.7):
            image = figure_image(
                drawing, one_line(alt), "png", DPI * scale, width=width, style=style
            )
            if len(image.attrib["src"]) <= MAX_IMAGE_LENGTH:
                break
    except Exception:  # the tables are useful without a picture
        return None
    return image


def _puppet_tables(m: Marionette) -> list[Element | None]:
    table = m.coordinates
    key_numbers = [
        ("degrees of freedom", table.n_vD),
        ("strings", len(m.tree.strings)),
        ("driven coordinates", table.n_vK),
        ("bodies", sum(not _is_end(m, k) for k in range(len(m.tree.links)))),
        ("moving mass", f"{m.mass:.4g} kg"),
    ]
    if m.puppet.obstacles:
        key_numbers.append(("obstacles", len(m.puppet.obstacles)))
    strings = [
        (string.name, _end_name(m, string, 0), _end_name(m, string, -1), _length_text(m, string))
        for string in m.tree.strings
    ]
    q_K = UncompiledPuppet(m.puppet, m.tree).start().q_K
    starts = [
        (row.name, f"{q_K[row.index]:.4g} {row.unit.strip('1')}{taut}")
        for row in table.rows
        if row.role == "driven"
        for taut in [", just taut" if np.isnan(table.start_K[row.index]) else ""]
    ]
    values = zip(m.tree.parameters, (f"{value:.6g}" for value in m.p), strict=True)
    return [
        _table((), key_numbers),
        _table(("string", "from", "to", "length"), strings),
        _table(("driven", "start"), starts),
        _table(("parameter", "value"), list(values)),
    ]


def _end_name(m: Marionette, string: StringRow, k_point: int) -> str:
    link = string.points[k_point].link
    if link == WORLD:
        return "world"
    return "driven end" if _is_end(m, link) else m.tree.links[link].name


def _is_end(m: Marionette, link: int) -> bool:
    """Whether a link is merely the driven end of a string."""
    return m.tree.links[link].name in {f"{string.name}.end" for string in m.tree.strings}


def _length_text(m: Marionette, string: StringRow) -> str:
    if string.length is None:
        return "driven"
    name = f"{string.length.parameter} = " if isinstance(string.length, Parameter) else ""
    return f"{name}{m.number(string.length):.4g} m"


def _run_tables(run: Trajectory) -> list[Element | None]:
    summary = run.summary()
    events = "not recorded"
    if summary["events"] is not None:
        events = ", ".join(f"{n} {kind}" for kind, n in summary["events"].items()) or "none"
    key_numbers = [
        ("duration", f"{run.duration:.6g} s"),
        ("method", run.method),
        ("status", run.status.message),
        ("events", events),
        ("samples", len(run)),
    ]
    if run.seconds is not None:
        slow = run.method == "event" and run.seconds > run.duration
        hint = ", slower than real time; method='timestepping' is faster" if slow else ""
        key_numbers.append(("computed in", f"{run.seconds:.3g} s{hint}"))
    if run.causes:
        key_numbers.insert(3, ("caused by", ", ".join(run.causes)))
    strings = [
        (
            name,
            f"{row['min']:.4g}",
            f"{row['max']:.4g}",
            f"{row['slack']:.3f}",
            "" if row["catches"] is None else row["catches"],
            f"{row['impulse']:.3g}" if row["catches"] else "",
        )
        for name, row in summary["tension"].items()
    ]
    headings = ("string", "min. [N]", "max. [N]", "slack [s]", "catches", "largest impulse [N s]")
    ledger = [(name, f"{value:.4g}") for name, value in summary["ledger"].items()]
    return [
        _table((), key_numbers),
        _table(headings, strings),
        _table(("energy at the end", "J"), ledger),
    ]


def _page_html(
    title: str, image: Element | None, tables: list[Element | None], wide: bool = False
) -> str:
    """Image and tables side by side, or tables below a ``wide`` image.

    The image contains the title; without an image the title is above the tables.
    """
    head = [element("div", one_line(title), style="font-weight:bold")] if image is None else []
    margin, row = "margin:0 2em .8em 0", "display:flex;gap:1.2em;align-items:flex-start"
    cells = [element("div", table, style=margin) for table in tables if table is not None]
    inner = [] if image is None else [element("div", image, style="flex:none;max-width:100%")]
    inner.append(element("div", *cells, style=f"{row};flex-wrap:wrap"))
    direction = "column" if wide else "row"
    body = element("div", *inner, style=f"{row};flex-direction:{direction}")
    return to_html(element("div", *head, body, class_="fantoccini"))


def _table(headings: Sequence[str], rows: Sequence[Iterable[object]]) -> Element | None:
    """Table; a long one ends with the number of lines left out."""
    if not rows:
        return None
    lines = [[_cell("td", str(cell)) for cell in row] for row in rows[:MAX_LINES]]
    if len(rows) > len(lines):
        remainder = _cell("td", f"and {len(rows) - len(lines)} more", str(len(lines[0])))
        lines.append([remainder])
    head = [[_cell("th", text) for text in headings]] if headings else []
    return element("table", *(element("tr", *cells) for cells in head + lines))


def _cell(tag: str, text: str, columns: str = "") -> Element:
    style = "text-align:left;padding:.1em .6em .1em 0"
    return element(tag, one_line(text), colspan=columns, style=style)
