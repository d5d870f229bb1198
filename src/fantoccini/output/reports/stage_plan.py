"""Plan of a play's stage: marks, obstacles, start positions of players, and their paths.

A mark is a named place on the stage, and a heading the direction in which a player looks.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.output.view import LIGHT, STONE_COLOUR, blank_figure, one_line, style_axes
from fantoccini.theatre.plays import StagePlan, make_stage_plan

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fantoccini.theatre.plays import Play

Rectangle = tuple[tuple[float, float], tuple[float, float]]

_WIDTH = 760
"""Width of the picture [px]."""
_MARGIN = 0.12
"""Margin around the drawing [m]."""


def draw_stage_plan(play: Play, used_area: Rectangle) -> Figure:
    """The stage from above, with the audience at the lower edge of the picture.

    Args:
        play: the compiled play.
        used_area: ((low, high) of x, (low, high) of y): area in which the hands move in the play
            [m].
    """
    stage = make_stage_plan(play)
    low, high = _extent(play, stage, used_area)
    width, depth = high[1] - low[1], high[0] - low[0]
    size = (_WIDTH, round(np.clip(_WIDTH * depth / width, 0.4 * _WIDTH, 1.6 * _WIDTH)) + 60)
    figure = blank_figure(size, facecolor=LIGHT.upper_background)
    figure.set_layout_engine("constrained")
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.set_xlim(low[1], high[1])
    axes.set_ylim(high[0], low[0])
    style_axes(axes, LIGHT, "both")
    axes.set_xlabel(
        "y, to stage left [m]   (the audience sits below)", color=LIGHT.text, fontsize=9
    )
    axes.set_ylabel("x, towards the audience [m]", color=LIGHT.text, fontsize=9)
    if stage.hand_space is not None:
        _draw_box(
            axes, stage.hand_space, "allowed area of the hands", linestyle="--", color=LIGHT.muted
        )
    _draw_box(axes, used_area, "area used by the hands", linestyle=":", color=LIGHT.text)
    for name, polygons in stage.obstacles.items():
        for polygon in polygons:
            axes.fill(polygon[:, 1], polygon[:, 0], color=STONE_COLOUR, linewidth=0.0, zorder=1.5)
        _write_label(axes, np.mean(polygons[0], axis=0), name, ha="center", va="center")
    for name, position in stage.marks.items():
        axes.plot(position[1], position[0], "+", color=LIGHT.muted, markersize=9.0, zorder=2.0)
        _write_label(axes, position, name, (6.0, -7.0), ha="left", va="top", color=LIGHT.muted)
    for k, name in enumerate(stage.starts):
        _draw_player(axes, play, stage, name, LIGHT.colour(k))
    axes.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, 1.07),
        ncols=4,
        frameon=False,
        fontsize=8,
        labelcolor=LIGHT.text,
    )
    return figure


def _draw_player(axes: Axes, play: Play, stage: StagePlan, name: str, colour: str) -> None:
    """Draws a player's start and heading, and its paths with their start and end times."""
    from matplotlib.patches import Circle

    start, radius = stage.starts[name], play.cast.players[name].radius
    axes.add_patch(
        Circle((start.y, start.x), radius, facecolor=colour, alpha=0.16, linewidth=0.0, zorder=1.8)
    )
    _arrow(axes, (start.x, start.y), start.heading, radius, colour)
    axes.plot(start.y, start.x, "o", color=colour, markersize=5.0, zorder=3.0)
    _write_label(
        axes,
        (start.x, start.y),
        name,
        (0.0, 8.0),
        ha="center",
        va="bottom",
        color=colour,
        weight="bold",
    )
    for way in stage.walks[name]:
        if np.ptp(way.places, axis=0).max() < 1e-3:
            continue
        axes.plot(way.places[:, 1], way.places[:, 0], color=colour, linewidth=1.6, zorder=2.5)
        end = way.places[-1]
        _arrow(axes, end, way.heading, radius, colour)
        axes.plot(end[1], end[0], "s", color=colour, markersize=4.0, zorder=3.0)
        distance = np.cumsum(np.linalg.norm(np.diff(way.places, axis=0), axis=1))
        middle = way.places[1 + int(np.searchsorted(distance, 0.5 * distance[-1]))]
        times = f"{way.begin:.1f} to {way.end:.1f} s"
        _write_label(axes, middle, times, (6.0, 0.0), ha="left", va="center", color=colour)


def _arrow(axes: Axes, position: Any, heading: float, length: float, colour: str) -> None:
    """Draws an arrow for a heading."""
    x, y = position[0] + length * np.cos(heading), position[1] + length * np.sin(heading)
    axes.annotate(
        "",
        (y, x),
        (position[1], position[0]),
        zorder=2.6,
        arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 1.0},
    )


def _draw_box(axes: Axes, box: Rectangle, label: str, **style: Any) -> None:
    (x_low, x_high), (y_low, y_high) = box
    y, x = [y_low, y_high, y_high, y_low, y_low], [x_low, x_low, x_high, x_high, x_low]
    axes.plot(y, x, linewidth=1.0, label=label, zorder=1.0, **style)


def _write_label(
    axes: Axes, position: Any, text: str, offset: tuple[float, float] = (0.0, 0.0), **style: Any
) -> None:
    from matplotlib import patheffects

    annotation = axes.annotate(
        one_line(text, 30),
        (position[1], position[0]),
        offset,
        textcoords="offset points",
        **{"color": LIGHT.text, "fontsize": 8, "zorder": 4.0, **style},
    )
    annotation.set_parse_math(False)
    annotation.set_path_effects(
        [patheffects.withStroke(linewidth=2.5, foreground=LIGHT.upper_background)]
    )


def _extent(play: Play, stage: StagePlan, used_area: Rectangle) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest (x, y) of everything that is drawn [m]."""
    point_sets = [np.array(used_area).T]
    if stage.hand_space is not None:
        point_sets.append(np.array(stage.hand_space).T)
    point_sets += [np.array([position]) for position in stage.marks.values()]
    point_sets += [polygon for polygons in stage.obstacles.values() for polygon in polygons]
    for name, start in stage.starts.items():
        radius = play.cast.players[name].radius
        point_sets += [np.array([[start.x, start.y]]) + sign * radius for sign in (-1.0, 1.0)]
        point_sets += [way.places for way in stage.walks[name]]
    points = np.concatenate(point_sets)
    return points.min(axis=0) - _MARGIN, points.max(axis=0) + _MARGIN
