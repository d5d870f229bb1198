"""Plots of an identification: channels and predictions, residuals, jumps, correlations."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.base import Array
from fantoccini.lab.identification import LISTED, channel_units
from fantoccini.output.reports.panels import (
    COLUMNS,
    WIDTH,
    colour_bar,
    grid,
    labelled,
    parts,
    timed,
    titled,
)
from fantoccini.output.view import LIGHT, RED, Theme, blank_figure, dress, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fantoccini.lab.identification import Identified

_ROWS = 6
"""Rows of a figure of channels."""
_GROUPS = 8
"""Rows of a figure of residuals."""
_HIDDEN = 3.0
"""Times between samples, over the usual one, from which on a gap is shown."""
_EDGE = 5.0
"""Residuals beyond it are drawn there."""
MEAN = 0.5
"""Time over which residuals are averaged [s]."""
_HIGHEST = 4.0
"""Jumps beyond it are drawn there."""
_DEEP = 2.0
"""Jumps with the strongest colour."""
_NUMBERS = 14
"""Unknowns up to which correlations are written into the map."""


def channels(found: Identified, theme: Theme = LIGHT) -> Iterator[tuple[Figure, list[str]]]:
    """Samples and predictions of every channel over time, in figures of several."""
    names, units = found.record.channels.names, channel_units(found.record)
    seen = [j for j in range(len(names)) if np.any(np.isfinite(found.residuals[:, j]))]
    for part in parts(seen, COLUMNS * _ROWS):
        figure, panels = grid(len(part), 138, theme, share_x=True)
        for panel, j in zip(panels, part, strict=True):
            _channel(panel, found, j, theme)
            titled(panel, f"{plain(names[j], 34)} [{units[j]}]", theme)
        for panel in panels[-COLUMNS:]:
            labelled(panel, theme, "time [s]")
        yield figure, [names[j] for j in part]


def _channel(axes: Axes, found: Identified, j: int, theme: Theme) -> None:
    t, r = found.t, found.residuals[:, j]
    samples = found.predicted[:, j] + r
    _gaps(axes, t, np.isfinite(r), theme)
    _lost(axes, found)
    axes.plot(t, samples, ".", markersize=1.8, color=theme.colour(0), alpha=0.55)
    axes.plot(*broken(t, found.predicted[:, j]), color=theme.ink, linewidth=0.7)
    far = np.abs(r) > LISTED * found.noise[found.record.channels.names[j]]
    low, high = _range(np.concatenate([found.predicted[:, j], samples[~far]]))
    _outliers(axes, t[far], np.clip(samples[far], low, high))
    axes.set_ylim(low, high)
    timed(axes, t, theme)


def _range(values: Array) -> tuple[float, float]:
    """Of an axis: a little more than the values."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    more = 0.08 * (high - low) or 1.0
    return low - more, high + more


def residuals(found: Identified, theme: Theme = LIGHT) -> Iterator[tuple[Figure, list[str]]]:
    """Residuals over the noise, of every group over time and as histograms, in several figures."""
    for part in parts(_groups(found), _GROUPS):
        figure = blank_figure((WIDTH, 50 + 122 * len(part)), facecolor=theme.top)
        figure.set_layout_engine("constrained", h_pad=0.04, w_pad=0.04)
        panels = figure.subplots(
            len(part),
            2,
            squeeze=False,
            sharex="col",
            sharey=True,
            gridspec_kw={"width_ratios": (6.2, 1)},
        )
        for (left, right), (name, own) in zip(panels, part, strict=True):
            _residuals(left, found, own, theme)
            _histogram(right, found, own, theme)
            titled(left, name, theme)
        labelled(panels[-1, 0], theme, "time [s]")
        labelled(panels[-1, 1], theme, "density")
        yield figure, [name for name, _ in part]


def _groups(found: Identified) -> list[tuple[str, list[int]]]:
    """Channels with samples by what shares their noise."""
    out: dict[str, list[int]] = {}
    for j, group in enumerate(found.record.channels.groups):
        if np.any(np.isfinite(found.residuals[:, j])):
            out.setdefault(group, []).append(j)
    return list(out.items())


def _scaled(found: Identified, j: int) -> Array:
    return np.asarray(found.residuals[:, j] / found.noise[found.record.channels.names[j]])


def _residuals(axes: Axes, found: Identified, own: list[int], theme: Theme) -> None:
    t = found.t
    _lost(axes, found)
    axes.axhspan(-2.0, 2.0, color=theme.faint, alpha=0.13, linewidth=0.0)
    names = found.record.channels.names
    for k, j in enumerate(own):
        z = _scaled(found, j)
        axes.plot(t, z, ".", markersize=1.8, color=theme.colour(k), alpha=0.35)
        far = np.abs(z) > LISTED
        _outliers(axes, t[far], np.clip(z[far], -_EDGE, _EDGE))
        label = names[j].rsplit(".", 1)[-1] if len(own) > 1 else None
        axes.plot(*broken(t, _running(t, z)), color=theme.colour(k), linewidth=1.1, label=label)
    axes.set_ylim(-_EDGE, _EDGE)
    axes.set_yticks((-4, -2, 0, 2, 4))
    timed(axes, t, theme)
    if len(own) > 1:
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 0.98),
            ncols=len(own),
            frameon=False,
            fontsize=8,
            labelcolor=theme.ink,
            handlelength=1.2,
            borderaxespad=0.0,
            columnspacing=1.0,
        )


def _histogram(axes: Axes, found: Identified, own: list[int], theme: Theme) -> None:
    z = np.concatenate([_scaled(found, j) for j in own])
    z = np.clip(z[np.isfinite(z)], -_EDGE, _EDGE)
    edges = np.linspace(-_EDGE, _EDGE, 41)
    height = np.histogram(z, edges, density=True)[0]
    axes.stairs(
        height, edges, orientation="horizontal", fill=True, color=theme.colour(0), alpha=0.35
    )
    x = np.linspace(-_EDGE, _EDGE, 201)
    axes.plot(np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi), x, color=theme.ink, linewidth=0.9)
    axes.set_xlim(0.0, 0.56)
    axes.set_xticks((0.0, 0.2, 0.4))
    dress(axes, theme, "both")


def _running(t: Array, z: Array) -> Array:
    """The mean of the samples about each time; NaN where most are missing."""
    there = np.isfinite(z)
    total = np.concatenate([[0.0], np.cumsum(np.where(there, np.clip(z, -LISTED, LISTED), 0.0))])
    count = np.concatenate([[0], np.cumsum(there)])
    low = np.searchsorted(t, t - 0.5 * MEAN)
    high = np.searchsorted(t, t + 0.5 * MEAN, side="right")
    n = count[high] - count[low]
    enough = n > max(2.0, 0.6 * float(np.median(n[there])))
    return np.asarray(np.where(enough, (total[high] - total[low]) / np.maximum(n, 1), np.nan))


def jumps(found: Identified, theme: Theme = LIGHT) -> Figure:
    """Jumps between segments over the drift: the largest ones, and those of every coordinate."""
    names = [plain(name, 30) for name in found.record.marionette.coordinates.v_D]
    n, at = len(names), found.starts[1:] + found.delay
    size = max(60, min(17 * n, 460))
    high = 100 + 2 * size + 130
    figure = blank_figure((WIDTH, high), facecolor=theme.top)
    left = (24 + 6 * max(map(len, names))) / WIDTH
    top, *rest = figure.subplots(
        3,
        1,
        sharex=True,
        gridspec_kw={
            "height_ratios": (100, size, size),
            "left": left,
            "right": 0.92,
            "bottom": 44 / high,
            "top": 1.0 - 24 / high,
            "hspace": 31 / ((100 + 2 * size) / 3),
        },
    )
    _lost(top, found)
    largest = np.max(np.abs(found.jumps), axis=1)
    top.axhline(1.0, color=theme.faint, linewidth=0.9, linestyle=(0, (4, 2)))
    top.vlines(at, 0.0, np.minimum(largest, _HIGHEST), color=theme.colour(0), linewidth=1.0)
    far = largest > _HIGHEST
    top.plot(at[~far], largest[~far], ".", markersize=4, color=theme.colour(0))
    top.plot(at[far], np.full(np.sum(far), _HIGHEST), "^", markersize=5, color=RED, clip_on=False)
    top.set_ylim(0.0, _HIGHEST)
    timed(top, found.t, theme)
    titled(top, "largest jump", theme)
    span = found.starts[1] - found.starts[0]
    edges = np.append(at - 0.5 * span, at[-1] + 0.5 * span)
    for axes, values, title in zip(
        rest,
        (found.jumps[:, :n], found.jumps[:, n:]),
        ("of configurations", "of velocities"),
        strict=True,
    ):
        image = axes.pcolormesh(
            edges,
            np.arange(n + 1) - 0.5,
            values.T,
            cmap="RdBu_r",
            vmin=-_DEEP,
            vmax=_DEEP,
            rasterized=True,
        )
        axes.set_yticks(range(n), names, parse_math=False)
        axes.set_ylim(n - 0.5, -0.5)
        timed(axes, found.t, theme)
        axes.grid(False)
        if 15 * n > size:
            axes.tick_params(axis="y", labelsize=min(8.0, 8.0 * size / (15 * n)))
        titled(axes, title, theme)
    labelled(rest[-1], theme, "time [s]")
    place = figure.add_axes((0.94, 44 / high, 0.012, (2 * size + 31) / high))
    colour_bar(figure, image, theme, "jump over drift", cax=place, extend="both")
    return figure


def correlations(found: Identified, theme: Theme = LIGHT) -> Figure:
    """How the errors of the unknowns hang together; grey where a number is not told."""
    names, n = [plain(name, 26) for name in found.names], len(found.names)
    cell = 40 if n <= _NUMBERS else 20
    wide = 60 + 7 * max(len(name) for name in names)
    figure = blank_figure((wide + cell * n + 90, wide + cell * n), facecolor=theme.top)
    figure.set_layout_engine("constrained")
    axes = figure.subplots()
    told = np.isfinite(found.deviations)
    values = np.where(np.outer(told, told), found.correlation, np.nan)
    axes.set_facecolor(theme.grid)
    image = axes.imshow(values, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    axes.set_xticks(range(n), names, rotation=90, parse_math=False)
    axes.set_yticks(range(n), names, parse_math=False)
    axes.tick_params(labelsize=8, colors=theme.faint, labelcolor=theme.ink, length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    if n <= _NUMBERS:
        for i, k in np.argwhere(np.isfinite(values)):
            axes.text(
                k,
                i,
                f"{values[i, k]:.2f}",
                ha="center",
                va="center",
                fontsize=7.5,
                color="white" if abs(values[i, k]) > 0.6 else theme.ink,
            )
    colour_bar(figure, image, theme, "", shrink=0.6, aspect=25)
    return figure


def broken(t: Array, y: Array) -> tuple[Array, Array]:
    """A line that is broken where nothing was measured for long."""
    wide = np.flatnonzero(np.diff(t) > _HIDDEN * np.median(np.diff(t))) + 1
    return np.insert(t, wide, np.nan), np.insert(y, wide, np.nan)


def _gaps(axes: Axes, t: Array, there: Array, theme: Theme) -> None:
    """Shades where a channel was not seen, before and after its samples, too."""
    own = t[there]
    usual = np.median(np.diff(own)) if len(own) > 1 else t[-1] - t[0]
    ends = np.concatenate([[t[0]], own, [t[-1]]])
    for k in np.flatnonzero(np.diff(ends) > _HIDDEN * usual):
        axes.axvspan(ends[k], ends[k + 1], color=theme.faint, alpha=0.2, linewidth=0.0)


def _lost(axes: Axes, found: Identified) -> None:
    """Shades the segments that do not count."""
    late = found.delay
    for begin, end in pairwise([*found.starts.tolist(), float(found.t[-1]) - late]):
        if begin in found.lost:
            axes.axvspan(begin + late, end + late, color=RED, alpha=0.12, linewidth=0.0)


def _outliers(axes: Axes, t: Array, y: Array) -> None:
    """Circles, over the edges of the axes, too; the layout does not wait for them."""
    lines = axes.plot(t, y, "o", markersize=4, color=RED, fillstyle="none", clip_on=False)
    lines[0].set_in_layout(False)
