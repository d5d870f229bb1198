"""Picture of an optimal motion: poses and paths, errors, tensions and inputs.

q_K are the driven coordinates, the ends and lengths of strings, v_K and acc_K their velocities and
accelerations.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.output.view.camera import Viewport
from fantoccini.output.view.drawing import PictureOptions, Sheet, fit_layout, one_line, style_axes
from fantoccini.output.view.geometry import run_geometry
from fantoccini.output.view.pictures import check_picture_path, pose_times, save_figure
from fantoccini.output.view.plans import PATH_COLOUR, fading_poses
from fantoccini.output.view.plots import add_legend, fit_legends, line_style, use_powers_of_ten
from fantoccini.output.view.theme import Theme, rgb

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fantoccini.control.optimal import Optimum

TARGET_COLOUR = rgb("#d1495b")
"""Colour of target paths and touched places."""

_PUPPET_WIDTH_SHARE = 0.46
"""Share of the width for the puppet."""
_MAX_BOUND = 2.5
"""Largest bound that is drawn, relative to the largest value."""


def optimum_picture(
    optimum: Optimum,
    path: str | os.PathLike[str],
    poses: int = 4,
    view: str | tuple[float, float] = "auto",
    theme: str | Theme = "light",
    size: tuple[int, int] = (1500, 900),
    scale: float = 2.0,
) -> Path:
    """Writes a picture of an optimal motion.

    Left: the puppet, with later poses more opaque; tracked points in blue, their target paths
    dashed in red, touched places as red circles. Right, over time: tracking errors, except those of
    velocities; tensions, with dotted targets; speeds that have bounds; accelerations of the inputs
    that are not held. Bounds are dashed.

    Args:
        optimum: the motion.
        path: path that ends in ``.png``, ``.svg`` or ``.pdf``.
        poses: number of poses.
        view: preset, or (azimuth, elevation) in degrees.
        theme: ``light``, ``dark``, or a Theme.
        size: width and height [px].
        scale: pixels of the file per pixel of ``size``.

    Returns:
        The path of the picture.
    """
    path, options = check_picture_path(path), PictureOptions.resolve(view, "all", theme, size)
    (width, height), unit = size, max(7.0, size[1] / 55.0)
    sheet = Sheet(size, options.theme)
    _draw_poses(sheet, optimum, options, poses, unit)
    panels = _panels(optimum, options.theme)
    # Covers the floor's light and lines behind the panels.
    sheet.add_image(
        np.full((1, 1, 3), options.theme.upper_background),
        (_PUPPET_WIDTH_SHARE * width, width, 0.0, height),
        4.5,
    )
    left, right, bottom_edge, top_edge = _PUPPET_WIDTH_SHARE + 0.055, 0.875, 0.07, 0.965
    gap = 0.025
    panel_height = (top_edge - bottom_edge - gap * (len(panels) - 1)) / len(panels)
    panel_axes = []
    for k, draw in enumerate(panels):
        bottom = top_edge - (k + 1) * panel_height - k * gap
        axes = sheet.figure.add_axes((left, bottom, right - left, panel_height))
        draw(axes)
        style_axes(axes, options.theme, "both")
        add_legend(axes, options.theme)
        axes.set_xlim(optimum.t[0], optimum.t[-1])
        if k + 1 < len(panels):
            axes.tick_params(labelbottom=False)
        else:
            axes.set_xlabel("time [s]", color=options.theme.text)
        panel_axes.append(axes)
    fit_legends(panel_axes)
    return save_figure(sheet.figure, path, scale)


def _draw_poses(
    sheet: Sheet, optimum: Optimum, options: PictureOptions, poses: int, unit: float
) -> None:
    """Draws the puppet and the paths of its points."""
    marionette, run, theme = optimum.task.drawn_marionette, optimum.run, options.theme
    times = pose_times(marionette, run, poses)
    geometry = run_geometry(marionette, run.resample(times))
    width = _PUPPET_WIDTH_SHARE * sheet.width
    inner = Viewport(unit, 4.0 * unit, width - 2.0 * unit, sheet.height - 8.0 * unit)
    layout = fit_layout(geometry, inner, options)
    sheet.add_floor(geometry, layout)
    fading_poses(sheet, geometry, layout)
    for target, actual in optimum.paths().values():
        for points, colour, dashes, thickness in (
            (actual, PATH_COLOUR, "-", 0.16),
            (target, TARGET_COLOUR, (0, (3, 2)), 0.1),
        ):
            line = layout.camera.project(points, layout.viewport)
            sheet.axes.plot(
                line[:, 0],
                line[:, 1],
                color=colour,
                linestyle=dashes,
                linewidth=thickness * unit,
                zorder=4.0,
            )
    for contact in optimum.closest_approaches:
        pixel = layout.camera.project(np.array([contact.touch.place], dtype=float), layout.viewport)
        sheet.axes.plot(
            pixel[:, 0],
            pixel[:, 1],
            color=TARGET_COLOUR,
            marker="o",
            markersize=0.45 * unit,
            markerfacecolor="none",
            markeredgewidth=0.1 * unit,
            zorder=4.0,
        )
    sheet.add_title(optimum.task.name or geometry.title, unit, sheet.height - 1.5 * unit)
    sheet.add_tension_bar(geometry, layout, sheet.height - 2.3 * unit, unit, width - 1.6 * unit)
    times_text = ", ".join(f"{t - run.t[0]:.2f}" for t in times)
    caption = f"cost {optimum.cost:.3g}; poses at {times_text} s"
    sheet.add_text(1.6 * unit, 2.2 * unit, caption, unit, theme.text, ha="left", va="center")


def _panels(optimum: Optimum, theme: Theme) -> list[Callable[[Axes], None]]:
    """Functions that draw the panels, from the top down."""
    bounds, marionette = optimum.task.bounds, optimum.task.marionette
    speed = bounds.magnitudes(marionette, "speed")
    panels: list[Callable[[Axes], None]] = []
    errors = {
        name: error
        for track, (name, error) in zip(
            (t for t in optimum.task.tracks if t.kind != "tension"),
            optimum.errors().items(),
            strict=True,
        )
        if track.kind != "velocity"
    }
    if errors:
        panels.append(lambda axes: _plot_errors(axes, optimum.t, errors, theme))
    if optimum.run.tension.names:
        panels.append(lambda axes: _plot_tensions(axes, optimum, theme))
    if np.any(np.isfinite(speed)):
        v_K = optimum.nodes.v_K
        panels.append(lambda axes: _plot_inputs(axes, optimum, v_K, speed, "speed", theme))
    limits = bounds.magnitudes(marionette, "acceleration")
    # Constant over the last interval.
    acc_K = np.concatenate([optimum.nodes.acc_K, optimum.nodes.acc_K[-1:]])
    panels.append(lambda axes: _plot_inputs(axes, optimum, acc_K, limits, "acceleration", theme))
    return panels


def _plot_errors(axes: Axes, t: np.ndarray, errors: dict[str, np.ndarray], theme: Theme) -> None:
    for k, (name, error) in enumerate(errors.items()):
        axes.plot(t, error, **line_style(theme, k), linewidth=1.2, label=one_line(name, 24))
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("error [m or rad]", color=theme.text)
    use_powers_of_ten(axes, theme)


def _plot_tensions(axes: Axes, optimum: Optimum, theme: Theme) -> None:
    run, bounds = optimum.run, optimum.bounds.tension
    for k, name in enumerate(run.tension.names):
        style = line_style(theme, k)
        axes.plot(run.t, run.tension[name], **style, linewidth=1.2, label=one_line(name, 24))
        for bound in bounds.get(name, ()):
            if np.isfinite(bound):
                _draw_bound(axes, bound, style["color"])
    for track in optimum.task.tracks:
        if track.kind == "tension":
            k = run.tension.names.index(track.name)
            target = optimum.target(track)[:, 0]
            axes.plot(optimum.t, target, ":", color=line_style(theme, k)["color"], linewidth=1.0)
    axes.set_ylabel("tension [N]", color=theme.text)
    use_powers_of_ten(axes, theme)


def _plot_inputs(
    axes: Axes,
    optimum: Optimum,
    values: np.ndarray,
    limits: np.ndarray,
    quantity: str,
    theme: Theme,
) -> None:
    """Plots driven velocities or accelerations of the inputs that are not held."""
    coordinates = optimum.task.marionette.coordinates
    held_indices = optimum.task.bounds.held_velocities(coordinates)
    moving_indices = [k for k in range(coordinates.n_vK) if k not in held_indices]
    for n, k in enumerate(moving_indices):
        line, style = (
            line_style(theme, n),
            "steps-post" if quantity == "acceleration" else "default",
        )
        axes.plot(
            optimum.t,
            values[:, k],
            **line,
            linewidth=1.2,
            drawstyle=style,
            label=one_line(coordinates.v_K[k], 24),
        )
    same_limit = len(np.unique(limits[moving_indices])) == 1
    max_drawn = _MAX_BOUND * np.max(np.abs(values[:, moving_indices]), initial=0.0)
    for n, k in enumerate(moving_indices[:1] if same_limit else moving_indices):
        if limits[k] <= max_drawn:  # larger ones would flatten the lines
            colour = theme.muted if same_limit else line_style(theme, n)["color"]
            _draw_bound(axes, limits[k], colour)
            _draw_bound(axes, -limits[k], colour)
    unit = "[m/s]" if quantity == "speed" else "[m/s\N{SUPERSCRIPT TWO}]"
    if any(row.unit != "m" for row in coordinates.rows if row.name in coordinates.q_K):
        unit = "(m, rad; s)"
    axes.set_ylabel(f"{quantity} {unit}", color=theme.text)
    use_powers_of_ten(axes, theme)


def _draw_bound(axes: Axes, value: float, colour: object) -> None:
    axes.axhline(value, color=colour, linewidth=0.8, linestyle=(0, (4, 3)), alpha=0.7)
