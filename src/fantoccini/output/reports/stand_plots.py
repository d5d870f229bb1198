"""Plots of a stand's check: margins, torque against speed, and every axis over time.

A stand is the machine that moves a puppet, and an axis one of its motors. A margin is the remaining
part of a bound, such as the torque.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.base import Array
from fantoccini.output.reports.panels import (
    FIGURE_WIDTH,
    GRID_COLUMNS,
    chunks,
    label_axes,
    panel_grid,
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
_RAD_PER_TURN = 2.0 * np.pi


def margin_figure(check: StandCheck, theme: Theme = LIGHT) -> Figure:
    """Figure with the margins of all axes, one row for each axis."""
    names = [axis.name for axis in check.axes]
    figure = blank_figure(
        (FIGURE_WIDTH - 200, 110 + 26 * len(names)), facecolor=theme.upper_background
    )
    top_margin, bottom_margin = 34 / (110 + 26 * len(names)), 60 / (110 + 26 * len(names))
    axes = figure.add_axes((0.19, bottom_margin, 0.64, 1.0 - top_margin - bottom_margin))
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


def torque_figures(check: StandCheck, theme: Theme = LIGHT) -> Iterator[tuple[Figure, list[str]]]:
    """Figures with torque against speed of the motors, and the names of their axes."""
    for chunk in chunks(range(len(check.axes)), 3 * GRID_COLUMNS):
        figure, panels = panel_grid(len(chunk), 250, theme, share_x=False)
        for panel, k in zip(panels, chunk, strict=True):
            _torque_panel(panel, check, k, theme)
        yield figure, [check.axes[k].name for k in chunk]


def _torque_panel(axes: Axes, check: StandCheck, k: int, theme: Theme) -> None:
    axis = check.axes[k]
    style_axes(axes, theme, "both")
    motor_speed = axis.ratio * np.abs(check.motion.velocity[:, k])
    torque, available = np.abs(check.torque[:, k]), check.available[:, k]
    max_speed = max(1.25 * float(np.max(motor_speed)), 0.2 * _RAD_PER_TURN)
    speeds = np.linspace(0.0, max_speed, 300)
    limit_torque = axis.motor.max_torque(speeds, np.ones_like(speeds))
    axes.fill_between(
        speeds / _RAD_PER_TURN, limit_torque, color=theme.muted, alpha=0.18, linewidth=0.0
    )
    axes.plot(speeds / _RAD_PER_TURN, limit_torque, color=theme.muted, linewidth=1.2)
    is_known = ~check.unknown[:, k]
    axes.plot(
        motor_speed / _RAD_PER_TURN,
        np.where(is_known, torque, np.nan),
        color=theme.colour(0),
        linewidth=0.7,
    )
    is_exceeded = is_known & (torque > available)
    axes.plot(
        motor_speed[is_exceeded] / _RAD_PER_TURN,
        torque[is_exceeded],
        linestyle="",
        marker=".",
        color=RED,
        markersize=4.0,
    )
    axes.set_xlim(0.0, max_speed / _RAD_PER_TURN)
    largest = float(np.max(torque[is_known], initial=0.0))
    axes.set_ylim(0.0, 1.12 * max(largest, float(np.max(limit_torque))))
    set_title(axes, axis.name, theme)
    label_axes(axes, theme, "turns/s", "N m")


def time_figures(check: StandCheck, theme: Theme = LIGHT) -> Iterator[tuple[Figure, list[str]]]:
    """Figures with position, speed, acceleration and torque, and the names of their axes."""
    for chunk in chunks(range(len(check.axes)), _AXES_PER_FIGURE):
        figure = blank_figure(
            (FIGURE_WIDTH, 60 + 150 * len(chunk)), facecolor=theme.upper_background
        )
        figure.set_layout_engine("constrained", h_pad=0.04, w_pad=0.06)
        panels = figure.subplots(len(chunk), 4, sharex=True, squeeze=False)
        for row, k in zip(panels, chunk, strict=True):
            _axis_row(row, check, k, theme)
        titles = ("position [m, rad]", "speed [1/s]", "acceleration [1/s^2]", "torque [N m]")
        for panel, title in zip(panels[0], titles, strict=True):
            set_title(panel, title, theme)
        for panel in panels[-1]:
            label_axes(panel, theme, "time [s]")
        yield figure, [check.axes[k].name for k in chunk]


def _axis_row(row: Array, check: StandCheck, k: int, theme: Theme) -> None:
    axis, motion, limits = check.axes[k], check.motion, check.limits_of_axis(check.axes[k].name)
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
        is_exceeded = (values < below) | (values > above)
        panel.plot(t, np.where(is_exceeded, values, np.nan), color=RED, linewidth=1.6)
        largest = float(np.nanmax(np.abs(values), initial=1e-9))
        if symmetric:
            bound_size = 1.1 * float(np.max(above))
            limit = max(1.15 * largest, min(bound_size, 4.0 * largest), 0.1 * bound_size)
            panel.set_ylim(-limit, limit)
    label_axes(row[0], theme, y=one_line(axis.name, 20))
