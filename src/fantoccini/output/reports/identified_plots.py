"""Plots of an identification: channels and predictions, residuals, jumps, correlations.

A channel is a measured number over time. A segment is a piece of the record that is simulated on
its own, and a jump the difference of two segments where they meet. In names, D stands for dynamic
coordinates, which move by the equations of motion.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.base import Array
from fantoccini.lab.identification import OUTLIER_RESIDUAL, channel_units
from fantoccini.output.reports.panels import (
    FIGURE_WIDTH,
    GRID_COLUMNS,
    chunks,
    colour_bar,
    label_axes,
    panel_grid,
    set_title,
    style_time_axes,
)
from fantoccini.output.view import LIGHT, RED, Theme, blank_figure, one_line, style_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fantoccini.lab.identification import IdentificationResult

_ROWS_OF_CHANNELS = 6
"""Rows of panels in a figure of channels."""
_MAX_GROUPS = 8
"""Largest number of rows in a figure of residuals."""
_MIN_GAP = 3.0
"""Interval between samples, relative to the median, above which a gap is shown."""
_MAX_RESIDUAL = 5.0
"""Largest drawn residual, relative to the noise; larger ones are drawn there."""
AVERAGING_TIME = 0.5
"""Time over which residuals are averaged [s]."""
_MAX_JUMP = 4.0
"""Largest drawn jump, relative to the drift; larger ones are drawn there."""
_COLOUR_LIMIT = 2.0
"""Jump with the strongest colour, relative to the drift."""
_MAX_LABELLED = 14
"""Largest number of unknowns for which correlations are written into the map."""


def channel_figures(
    result: IdentificationResult, theme: Theme = LIGHT
) -> Iterator[tuple[Figure, list[str]]]:
    """Figures with samples and predictions over time, and the names of their channels."""
    names, units = result.record.channels.names, channel_units(result.record)
    measured = [j for j in range(len(names)) if np.any(np.isfinite(result.residuals[:, j]))]
    for chunk in chunks(measured, GRID_COLUMNS * _ROWS_OF_CHANNELS):
        figure, panels = panel_grid(len(chunk), 138, theme, share_x=True)
        for panel, j in zip(panels, chunk, strict=True):
            _draw_channel(panel, result, j, theme)
            set_title(panel, f"{one_line(names[j], 34)} [{units[j]}]", theme)
        for panel in panels[-GRID_COLUMNS:]:
            label_axes(panel, theme, "time [s]")
        yield figure, [names[j] for j in chunk]


def _draw_channel(axes: Axes, result: IdentificationResult, j: int, theme: Theme) -> None:
    """Draws samples, predictions and outliers of channel j."""
    t, r = result.t, result.residuals[:, j]
    samples = result.predicted[:, j] + r
    _shade_gaps(axes, t, np.isfinite(r), theme)
    _shade_rejected(axes, result)
    axes.plot(t, samples, ".", markersize=1.8, color=theme.colour(0), alpha=0.55)
    axes.plot(*with_gaps(t, result.predicted[:, j]), color=theme.text, linewidth=0.7)
    outliers = np.abs(r) > OUTLIER_RESIDUAL * result.noise[result.record.channels.names[j]]
    low, high = _axis_limits(np.concatenate([result.predicted[:, j], samples[~outliers]]))
    _draw_outliers(axes, t[outliers], np.clip(samples[outliers], low, high))
    axes.set_ylim(low, high)
    style_time_axes(axes, t, theme)


def _axis_limits(values: Array) -> tuple[float, float]:
    """Limits of an axis: slightly wider than the range of the values."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = 0.08 * (high - low) or 1.0
    return low - margin, high + margin


def residual_figures(
    result: IdentificationResult, theme: Theme = LIGHT
) -> Iterator[tuple[Figure, list[str]]]:
    """Figures with residuals relative to the noise, over time and as histograms, by group."""
    for chunk in chunks(_groups(result), _MAX_GROUPS):
        figure = blank_figure(
            (FIGURE_WIDTH, 50 + 122 * len(chunk)), facecolor=theme.upper_background
        )
        figure.set_layout_engine("constrained", h_pad=0.04, w_pad=0.04)
        panels = figure.subplots(
            len(chunk),
            2,
            squeeze=False,
            sharex="col",
            sharey=True,
            gridspec_kw={"width_ratios": (6.2, 1)},
        )
        for (left, right), (name, indices) in zip(panels, chunk, strict=True):
            _draw_residuals(left, result, indices, theme)
            _draw_histogram(right, result, indices, theme)
            set_title(left, name, theme)
        label_axes(panels[-1, 0], theme, "time [s]")
        label_axes(panels[-1, 1], theme, "density")
        yield figure, [name for name, _ in chunk]


def _groups(result: IdentificationResult) -> list[tuple[str, list[int]]]:
    """Channels with samples, grouped by the noise that they share."""
    groups: dict[str, list[int]] = {}
    for j, group in enumerate(result.record.channels.groups):
        if np.any(np.isfinite(result.residuals[:, j])):
            groups.setdefault(group, []).append(j)
    return list(groups.items())


def _normalised_residuals(result: IdentificationResult, j: int) -> Array:
    """(N,) residuals of channel j, relative to its noise."""
    return np.asarray(result.residuals[:, j] / result.noise[result.record.channels.names[j]])


def _draw_residuals(
    axes: Axes, result: IdentificationResult, indices: list[int], theme: Theme
) -> None:
    t = result.t
    _shade_rejected(axes, result)
    axes.axhspan(-2.0, 2.0, color=theme.muted, alpha=0.13, linewidth=0.0)
    names = result.record.channels.names
    for k, j in enumerate(indices):
        z = _normalised_residuals(result, j)
        axes.plot(t, z, ".", markersize=1.8, color=theme.colour(k), alpha=0.35)
        outliers = np.abs(z) > OUTLIER_RESIDUAL
        _draw_outliers(axes, t[outliers], np.clip(z[outliers], -_MAX_RESIDUAL, _MAX_RESIDUAL))
        label = names[j].rsplit(".", 1)[-1] if len(indices) > 1 else None
        axes.plot(
            *with_gaps(t, _running_mean(t, z)), color=theme.colour(k), linewidth=1.1, label=label
        )
    axes.set_ylim(-_MAX_RESIDUAL, _MAX_RESIDUAL)
    axes.set_yticks((-4, -2, 0, 2, 4))
    style_time_axes(axes, t, theme)
    if len(indices) > 1:
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 0.98),
            ncols=len(indices),
            frameon=False,
            fontsize=8,
            labelcolor=theme.text,
            handlelength=1.2,
            borderaxespad=0.0,
            columnspacing=1.0,
        )


def _draw_histogram(
    axes: Axes, result: IdentificationResult, indices: list[int], theme: Theme
) -> None:
    z = np.concatenate([_normalised_residuals(result, j) for j in indices])
    z = np.clip(z[np.isfinite(z)], -_MAX_RESIDUAL, _MAX_RESIDUAL)
    edges = np.linspace(-_MAX_RESIDUAL, _MAX_RESIDUAL, 41)
    height = np.histogram(z, edges, density=True)[0]
    axes.stairs(
        height, edges, orientation="horizontal", fill=True, color=theme.colour(0), alpha=0.35
    )
    x = np.linspace(-_MAX_RESIDUAL, _MAX_RESIDUAL, 201)
    axes.plot(np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi), x, color=theme.text, linewidth=0.9)
    axes.set_xlim(0.0, 0.56)
    axes.set_xticks((0.0, 0.2, 0.4))
    style_axes(axes, theme, "both")


def _running_mean(t: Array, z: Array) -> Array:
    """Mean of the samples around each time; NaN where most are missing."""
    finite = np.isfinite(z)
    total = np.concatenate(
        [[0.0], np.cumsum(np.where(finite, np.clip(z, -OUTLIER_RESIDUAL, OUTLIER_RESIDUAL), 0.0))]
    )
    count = np.concatenate([[0], np.cumsum(finite)])
    first = np.searchsorted(t, t - 0.5 * AVERAGING_TIME)
    last = np.searchsorted(t, t + 0.5 * AVERAGING_TIME, side="right")
    n = count[last] - count[first]
    enough = n > max(2.0, 0.6 * float(np.median(n[finite])))
    return np.asarray(np.where(enough, (total[last] - total[first]) / np.maximum(n, 1), np.nan))


def jump_figure(result: IdentificationResult, theme: Theme = LIGHT) -> Figure:
    """Figure of jumps between segments: the largest, and those of every coordinate.

    They are relative to the allowed drift.
    """
    names = [one_line(name, 30) for name in result.record.marionette.coordinates.v_D]
    n, jump_times = len(names), result.starts[1:] + result.delay
    size = max(60, min(17 * n, 460))
    height = 100 + 2 * size + 130
    figure = blank_figure((FIGURE_WIDTH, height), facecolor=theme.upper_background)
    left = (24 + 6 * max(map(len, names))) / FIGURE_WIDTH
    top_axes, *map_axes = figure.subplots(
        3,
        1,
        sharex=True,
        gridspec_kw={
            "height_ratios": (100, size, size),
            "left": left,
            "right": 0.92,
            "bottom": 44 / height,
            "top": 1.0 - 24 / height,
            "hspace": 31 / ((100 + 2 * size) / 3),
        },
    )
    _shade_rejected(top_axes, result)
    largest = np.max(np.abs(result.jumps), axis=1)
    top_axes.axhline(1.0, color=theme.muted, linewidth=0.9, linestyle=(0, (4, 2)))
    top_axes.vlines(
        jump_times, 0.0, np.minimum(largest, _MAX_JUMP), color=theme.colour(0), linewidth=1.0
    )
    is_clipped = largest > _MAX_JUMP
    top_axes.plot(
        jump_times[~is_clipped], largest[~is_clipped], ".", markersize=4, color=theme.colour(0)
    )
    top_axes.plot(
        jump_times[is_clipped],
        np.full(np.sum(is_clipped), _MAX_JUMP),
        "^",
        markersize=5,
        color=RED,
        clip_on=False,
    )
    top_axes.set_ylim(0.0, _MAX_JUMP)
    style_time_axes(top_axes, result.t, theme)
    set_title(top_axes, "largest jump", theme)
    segment_duration = result.starts[1] - result.starts[0]
    edges = np.append(jump_times - 0.5 * segment_duration, jump_times[-1] + 0.5 * segment_duration)
    for axes, values, title in zip(
        map_axes,
        (result.jumps[:, :n], result.jumps[:, n:]),
        ("of configurations", "of velocities"),
        strict=True,
    ):
        image = axes.pcolormesh(
            edges,
            np.arange(n + 1) - 0.5,
            values.T,
            cmap="RdBu_r",
            vmin=-_COLOUR_LIMIT,
            vmax=_COLOUR_LIMIT,
            rasterized=True,
        )
        axes.set_yticks(range(n), names, parse_math=False)
        axes.set_ylim(n - 0.5, -0.5)
        style_time_axes(axes, result.t, theme)
        axes.grid(False)
        if 15 * n > size:
            axes.tick_params(axis="y", labelsize=min(8.0, 8.0 * size / (15 * n)))
        set_title(axes, title, theme)
    label_axes(map_axes[-1], theme, "time [s]")
    bar_axes = figure.add_axes((0.94, 44 / height, 0.012, (2 * size + 31) / height))
    colour_bar(figure, image, theme, "jump / drift", cax=bar_axes, extend="both")
    return figure


def correlation_figure(result: IdentificationResult, theme: Theme = LIGHT) -> Figure:
    """Map of the correlations of the unknowns' errors; grey where one is undetermined."""
    names, n = [one_line(name, 26) for name in result.names], len(result.names)
    cell_size = 40 if n <= _MAX_LABELLED else 20
    label_width = 60 + 7 * max(len(name) for name in names)
    figure = blank_figure(
        (label_width + cell_size * n + 90, label_width + cell_size * n),
        facecolor=theme.upper_background,
    )
    figure.set_layout_engine("constrained")
    axes = figure.subplots()
    determined = np.isfinite(result.deviations)
    values = np.where(np.outer(determined, determined), result.correlation, np.nan)
    axes.set_facecolor(theme.grid)
    image = axes.imshow(values, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    axes.set_xticks(range(n), names, rotation=90, parse_math=False)
    axes.set_yticks(range(n), names, parse_math=False)
    axes.tick_params(labelsize=8, colors=theme.muted, labelcolor=theme.text, length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    if n <= _MAX_LABELLED:
        for i, k in np.argwhere(np.isfinite(values)):
            axes.text(
                k,
                i,
                f"{values[i, k]:.2f}",
                ha="center",
                va="center",
                fontsize=7.5,
                color="white" if abs(values[i, k]) > 0.6 else theme.text,
            )
    colour_bar(figure, image, theme, "", shrink=0.6, aspect=25)
    return figure


def with_gaps(t: Array, y: Array) -> tuple[Array, Array]:
    """Points of a line that is interrupted, by NaN, at gaps in time."""
    gaps = np.flatnonzero(np.diff(t) > _MIN_GAP * np.median(np.diff(t))) + 1
    return np.insert(t, gaps, np.nan), np.insert(y, gaps, np.nan)


def _shade_gaps(axes: Axes, t: Array, finite: Array, theme: Theme) -> None:
    """Shades gaps of a channel, also before and after its samples."""
    times = t[finite]
    interval = np.median(np.diff(times)) if len(times) > 1 else t[-1] - t[0]
    boundaries = np.concatenate([[t[0]], times, [t[-1]]])
    for k in np.flatnonzero(np.diff(boundaries) > _MIN_GAP * interval):
        axes.axvspan(boundaries[k], boundaries[k + 1], color=theme.muted, alpha=0.2, linewidth=0.0)


def _shade_rejected(axes: Axes, result: IdentificationResult) -> None:
    """Shades the rejected segments."""
    delay = result.delay
    for begin, end in pairwise([*result.starts.tolist(), float(result.t[-1]) - delay]):
        if begin in result.rejected:
            axes.axvspan(begin + delay, end + delay, color=RED, alpha=0.12, linewidth=0.0)


def _draw_outliers(axes: Axes, t: Array, y: Array) -> None:
    """Draws circles, also on the edges of the axes; the layout ignores them."""
    lines = axes.plot(t, y, "o", markersize=4, color=RED, fillstyle="none", clip_on=False)
    lines[0].set_in_layout(False)
