"""Plots of a stand's check: margins, torque against speed, and every axis over time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.base import Array
from fantoccini.output.reports.panels import (
    COLUMNS,
    WIDTH,
    chunks,
    grid,
    label_axes,
    set_title,
    style_time_axes,
)
from fantoccini.output.view import LIGHT, RED, Theme, blank_figure, one_line, style_axes
from fantoccini.stand import QUANTITIES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fantoccini.stand import StandCheck

_MARKERS = dict(zip(QUANTITIES, "|os^Dv", strict=True))
_AXES_PER_FIGURE = 7
"""Number of axes in a figure of :func:`over_time`."""
_MIN_MARGIN = -100.0
"""Lower end of the plot; smaller margins are drawn there [%]."""
_TURN = 2.0 * np.pi


def margins(check: StandCheck, theme: Theme = LIGHT) -> Figure:
    """Figure with the margins of all axes, one row for each axis."""
    names = [axis.name for axis in check.axes]
    figure = blank_figure((WIDTH - 200, 110 + 26 * len(names)), facecolor=theme.upper_background)
    above, below = 34 / (110 + 26 * len(names)), 60 / (110 + 26 * len(names))
    axes = figure.add_axes((0.19, below, 0.64, 1.0 - above - below))
    style_axes(axes, theme, "both")
    axes.axvspan(_MIN_MARGIN, 0.0, color=RED, alpha=0.07, linewidth=0.0)
    axes.axvline(0.0, color=RED, linewidth=1.0)
    for n, quantity in enumerate(QUANTITIES):
        limits = [limit for limit in check.limits if limit.quantity == quantity]
        if not limits:
            continue
        x = [max(limit.margin, _MIN_MARGIN) for limit in limits]
        y = [names.index(limit.axis) for limit in limits]
        axes.plot(
            x,
            y,
            linestyle="",
            marker=_MARKERS[quantity],
            markersize=9 if n == 0 else 6,
            markeredgewidth=2.0 if n == 0 else 0.8,
            color=theme.colour(n),
            markeredgecolor=theme.colour(n) if n == 0 else theme.upper_background,
            label=quantity,
            clip_on=False,
            zorder=3 + n,
        )
    axes.set_yticks(range(len(names)), [one_line(name, 24) for name in names], parse_math=False)
    axes.set_ylim(len(names) - 0.5, -0.5)
    smallest = min(limit.margin for limit in check.limits)
    axes.set_xlim(min(-10.0, max(smallest, _MIN_MARGIN) - 5.0), 103.0)
    label_axes(axes, theme, "margin [%]")
    axes.legend(
        loc="upper left",
        bbox_to_anchor=(1.02, 1.0),
        frameon=False,
        fontsize=9,
        labelcolor=theme.text,
    )
    return figure


def torque_and_speed(check: StandCheck, theme: Theme = LIGHT) -> Iterator[tuple[Figure, list[str]]]:
    """Figures with torque against speed of the motors, and the names of their axes."""
    for part in chunks(range(len(check.axes)), 3 * COLUMNS):
        figure, panels = grid(len(part), 250, theme, share_x=False)
        for panel, k in zip(panels, part, strict=True):
            _torque_panel(panel, check, k, theme)
        yield figure, [check.axes[k].name for k in part]


def _torque_panel(axes: Axes, check: StandCheck, k: int, theme: Theme) -> None:
    axis = check.axes[k]
    style_axes(axes, theme, "both")
    w = axis.ratio * np.abs(check.motion.velocity[:, k])
    torque, available = np.abs(check.torque[:, k]), check.available[:, k]
    max_speed = max(1.25 * float(np.max(w)), 0.2 * _TURN)
    speeds = np.linspace(0.0, max_speed, 300)
    limit_torque = axis.motor.max_torque(speeds, np.ones_like(speeds))
    axes.fill_between(speeds / _TURN, limit_torque, color=theme.muted, alpha=0.18, linewidth=0.0)
    axes.plot(speeds / _TURN, limit_torque, color=theme.muted, linewidth=1.2)
    known = ~check.unknown[:, k]
    axes.plot(w / _TURN, np.where(known, torque, np.nan), color=theme.colour(0), linewidth=0.7)
    over = known & (torque > available)
    axes.plot(w[over] / _TURN, torque[over], linestyle="", marker=".", color=RED, markersize=4.0)
    axes.set_xlim(0.0, max_speed / _TURN)
    largest = float(np.max(torque[known], initial=0.0))
    axes.set_ylim(0.0, 1.12 * max(largest, float(np.max(limit_torque))))
    set_title(axes, axis.name, theme)
    label_axes(axes, theme, "turns/s", "N m")


def over_time(check: StandCheck, theme: Theme = LIGHT) -> Iterator[tuple[Figure, list[str]]]:
    """Figures with position, speed, acceleration and torque, and the names of their axes."""
    for part in chunks(range(len(check.axes)), _AXES_PER_FIGURE):
        figure = blank_figure((WIDTH, 60 + 150 * len(part)), facecolor=theme.upper_background)
        figure.set_layout_engine("constrained", h_pad=0.04, w_pad=0.06)
        panels = figure.subplots(len(part), 4, sharex=True, squeeze=False)
        for row, k in zip(panels, part, strict=True):
            _axis_row(row, check, k, theme)
        titles = ("position [m, rad]", "speed [1/s]", "acceleration [1/s^2]", "torque [N m]")
        for panel, title in zip(panels[0], titles, strict=True):
            set_title(panel, title, theme)
        for panel in panels[-1]:
            label_axes(panel, theme, "time [s]")
        yield figure, [check.axes[k].name for k in part]


def _axis_row(row: Array, check: StandCheck, k: int, theme: Theme) -> None:
    axis, motion, limits = check.axes[k], check.motion, check.of(check.axes[k].name)
    t = motion.t
    speed = np.full(len(t), limits["speed"].bound)
    acceleration = np.full(len(t), limits["acceleration"].bound)
    low, high = axis.travel
    curves: list[tuple[Array, Array, Array, bool]] = [
        (motion.position[:, k], np.full(len(t), low), np.full(len(t), high), False),
        (motion.velocity[:, k], -speed, speed, True),
        (motion.acceleration[:, k], -acceleration, acceleration, True),
        (
            np.where(check.unknown[:, k], np.nan, check.torque[:, k]),
            -check.available[:, k],
            check.available[:, k],
            True,
        ),
    ]
    for panel, (values, below, above, symmetric) in zip(row, curves, strict=True):
        style_time_axes(panel, t, theme)
        for bound in (below, above):
            panel.plot(t, bound, color=theme.muted, linewidth=0.9, linestyle=(0, (4, 2)))
        panel.plot(t, values, color=theme.colour(0), linewidth=0.9)
        over = (values < below) | (values > above)
        panel.plot(t, np.where(over, values, np.nan), color=RED, linewidth=1.6)
        size = float(np.nanmax(np.abs(values), initial=1e-9))
        if symmetric:
            bound_size = 1.1 * float(np.max(above))
            limit = max(1.15 * size, min(bound_size, 4.0 * size), 0.1 * bound_size)
            panel.set_ylim(-limit, limit)
    label_axes(row[0], theme, y=one_line(axis.name, 20))
