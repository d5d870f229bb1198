"""Plots of measurements against a varied quantity, on logarithmic axes.

A power law y ~ x^n is a straight line on such axes.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.output.view.drawing import blank_figure, one_line, style_axes
from fantoccini.output.view.pictures import check_picture_path, save_figure
from fantoccini.output.view.theme import Theme, theme_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

REFERENCE_OFFSET = 1.4
"""Factor by which a reference line lies above the measured points."""
MAX_LABELLED_RANGE = 10.0
"""Ratio of largest to smallest x below which every measured x gets a tick."""


@dataclass(frozen=True, eq=False)
class Curve:
    """Measured points, or a reference line.

    Attributes:
        label: label in the legend.
        x, y: (n,) the points; a logarithmic axis leaves out values that are not positive.
        marked: whether to draw a dot at each point.
        faint: whether to draw a dashed grey line, for reference.
    """

    label: str
    x: np.ndarray
    y: np.ndarray
    marked: bool = True
    faint: bool = False


@dataclass(frozen=True, eq=False)
class Panel:
    """A pair of axes with curves.

    Attributes:
        title: title above the axes.
        x, y: labels of the axes, with units.
        curves: curves to draw.
        log_x: whether x is logarithmic. y always is, unless all values are 0.
    """

    title: str
    x: str
    y: str
    curves: Sequence[Curve]
    log_x: bool = True


def power_law(label: str, x: np.ndarray, y: np.ndarray, order: float) -> Curve:
    """Reference line y ~ x^order just above the last positive measured point."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    last = np.flatnonzero(y > 0.0)[-1] if np.any(y > 0.0) else len(y) - 1
    line = REFERENCE_OFFSET * y[last] * (x / x[last]) ** order
    return Curve(label, x, line, marked=False, faint=True)


def draw_panels(
    panels: Sequence[Panel],
    path: str | os.PathLike[str],
    theme: str | Theme = "light",
    size: tuple[int, int] = (640, 470),
    scale: float = 2.0,
) -> Path:
    """Writes panels side by side.

    Args:
        panels: panels in the order from left to right.
        path: path that ends in ``.png``, ``.svg`` or ``.pdf``.
        theme: ``light``, ``dark``, or a Theme.
        size: width and height of a panel [px].
        scale: pixels of the file per pixel of ``size``.

    Returns:
        The path of the picture.
    """
    path, theme = check_picture_path(path), theme_of(theme)
    shape = (len(panels) * size[0], size[1])
    figure = blank_figure(shape, facecolor=theme.upper_background)
    figure.set_layout_engine("constrained", w_pad=0.15, h_pad=0.1)
    for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        _draw_panel(axes, panel, theme)
    return save_figure(figure, path, scale)


def _draw_panel(axes: Axes, panel: Panel, theme: Theme) -> None:
    n_measured = 0
    for curve in panel.curves:
        x, y = np.asarray(curve.x, dtype=float), np.asarray(curve.y, dtype=float)
        positive = np.isfinite(y) & (y > 0.0)
        style: dict[str, Any]
        if curve.faint:
            style = {"color": theme.muted, "linestyle": "--", "linewidth": 0.9, "zorder": 1.5}
        else:
            style = {"color": theme.colour(n_measured), "linewidth": 1.2}
            n_measured += 1
        if curve.marked:
            style |= {"marker": "o", "markersize": 4.0, "markeredgecolor": theme.upper_background}
        if not np.any(positive):
            positive = np.isfinite(y)
        axes.plot(x[positive], y[positive], label=one_line(curve.label, 40), **style)
    if any(np.any(np.asarray(curve.y) > 0.0) for curve in panel.curves):
        axes.set_yscale("log")
    if panel.log_x:
        axes.set_xscale("log")
        ticks = np.unique([f"{x:.2g}" for c in panel.curves if c.marked for x in c.x]).astype(float)
        if len(ticks) and ticks.max() < MAX_LABELLED_RANGE * ticks.min():
            axes.set_xticks(ticks, [f"{x:g}" for x in ticks])
            axes.minorticks_off()
    axes.set_title(
        one_line(panel.title, 80), color=theme.text, fontsize=10, loc="left", parse_math=False
    )
    axes.set_xlabel(panel.x, color=theme.text, fontsize=9)
    axes.set_ylabel(panel.y, color=theme.text, fontsize=9)
    style_axes(axes, theme, "both", "both")
    if any(curve.label for curve in panel.curves):
        legend = axes.legend(frameon=False, fontsize=8, labelcolor=theme.text, handlelength=1.6)
        for text in legend.get_texts():
            text.set_parse_math(False)
