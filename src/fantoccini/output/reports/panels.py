"""Panels of the figures in reports: their frames, titles and colour bars.

Axes are the frame of one plot in a figure.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from fantoccini.base import Array
from fantoccini.output.view import Theme, blank_figure, one_line, style_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

    Panels = tuple[Figure, list[Axes]]

FIGURE_WIDTH = 1150
"""Width of a figure [px]."""
GRID_COLUMNS = 3
"""Panels in a row of a grid."""

T = TypeVar("T")


def chunks(items: Sequence[T], size: int) -> Iterator[Sequence[T]]:
    """The items in order, in parts of at most ``size``, one for each figure."""
    return (items[begin : begin + size] for begin in range(0, len(items), size))


def panel_grid(count: int, height: int, theme: Theme, share_x: bool) -> Panels:
    """Figure with ``count`` panels in rows of :data:`COLUMNS`, each row ``height`` high [px]."""
    rows = -(-count // GRID_COLUMNS)
    figure = blank_figure((FIGURE_WIDTH, 44 + height * rows), facecolor=theme.upper_background)
    figure.set_layout_engine("constrained", h_pad=0.04, w_pad=0.06)
    panels = list(figure.subplots(rows, GRID_COLUMNS, sharex=share_x, squeeze=False).flat)
    for panel in panels[count:]:
        panel.set_visible(False)
    for panel in panels[max(0, count - GRID_COLUMNS) : count]:
        panel.tick_params(labelbottom=True)
    return figure, panels[:count]


def set_title(axes: Axes, text: str, theme: Theme) -> None:
    """Writes plain text above axes, without parsing formulas."""
    title = one_line(text, 60)
    axes.set_title(title, fontsize=9, color=theme.text, loc="left", parse_math=False, pad=4)


def label_axes(axes: Axes, theme: Theme, x: str = "", y: str = "") -> None:
    """Writes plain text beside the axes, without parsing formulas."""
    for axis, text in ((axes.xaxis, x), (axes.yaxis, y)):
        if text:
            axis.set_label_text(one_line(text, 40), fontsize=8, color=theme.text).set_parse_math(
                False
            )


def style_time_axes(axes: Axes, t: Array, theme: Theme) -> None:
    """Sets frame, grid and limits of axes over the given times."""
    style_axes(axes, theme, "both")
    axes.set_xlim(t[0], t[-1])


def colour_bar(
    figure: Figure, image: ScalarMappable, theme: Theme, text: str, **placement: Any
) -> None:
    """Adds the colour bar of an image; ``placement`` as in matplotlib."""
    bar = figure.colorbar(image, **placement)
    bar.ax.tick_params(labelsize=8, colors=theme.muted, labelcolor=theme.text)
    bar.outline.set_visible(False)
    bar.set_label(text, fontsize=8, color=theme.text)
