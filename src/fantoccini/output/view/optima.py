"""A picture of a motion of least cost: poses and paths, errors, tensions and inputs."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.output.view.camera import Viewport
from fantoccini.output.view.drawing import Look, Sheet, dress, layout_of, plain
from fantoccini.output.view.geometry import geometry_of
from fantoccini.output.view.pictures import checked, pose_times, save
from fantoccini.output.view.plans import PATH_COLOUR, fading_poses
from fantoccini.output.view.plots import legend, line_look, short_numbers
from fantoccini.output.view.theme import Theme, rgb

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fantoccini.control.optimal import Optimum

TARGET_COLOUR = rgb("#d1495b")

_SHARE = 0.46
"""Of the width, that the puppet has."""
_FAR = 2.5
"""Farthest bound that is drawn, relative to the largest value."""


def optimum_picture(
    found: Optimum,
    path: str | os.PathLike[str],
    poses: int = 4,
    view: str | tuple[float, float] = "auto",
    theme: str | Theme = "light",
    size: tuple[int, int] = (1500, 900),
    scale: float = 2.0,
) -> Path:
    """Writes a picture of a motion of least cost.

    At the left the puppet: the later a pose, the firmer; tracked points in blue, their paths dashed
    in red, places that are touched as red circles. At the right, against time: how far what is
    tracked is from its path, but for velocities; tensions, with their paths dotted; speeds, where
    they have bounds; accelerations of the inputs that are not held. Bounds are dashed.

    Args:
        found: the motion.
        path: ends in ``.png``, ``.svg`` or ``.pdf``.
        poses: number of poses.
        view: preset, or (azimuth, elevation) in degrees.
        theme: ``light``, ``dark``, or a Theme.
        size: width and height [px].
        scale: pixels of the file for a pixel of ``size``.

    Returns:
        The path of the picture.
    """
    path, look = checked(path), Look.of(view, "all", theme, size)
    (width, height), unit = size, max(7.0, size[1] / 55.0)
    sheet = Sheet(size, look.theme)
    _draw_poses(sheet, found, look, poses, unit)
    panels = _panels(found, look.theme)
    # The floor's light and lines end where the panels begin.
    sheet.image(np.full((1, 1, 3), look.theme.top), (_SHARE * width, width, 0.0, height), 4.5)
    left, right, low, high = _SHARE + 0.055, 0.875, 0.07, 0.965
    gap = 0.025
    tall = (high - low - gap * (len(panels) - 1)) / len(panels)
    for k, paint in enumerate(panels):
        bottom = high - (k + 1) * tall - k * gap
        axes = sheet.figure.add_axes((left, bottom, right - left, tall))
        paint(axes)
        dress(axes, look.theme, "both")
        legend(axes, look.theme)
        axes.set_xlim(found.t[0], found.t[-1])
        if k + 1 < len(panels):
            axes.tick_params(labelbottom=False)
        else:
            axes.set_xlabel("time [s]", color=look.theme.ink)
    return save(sheet.figure, path, scale)


def _draw_poses(sheet: Sheet, found: Optimum, look: Look, poses: int, unit: float) -> None:
    """The puppet, and the paths of its points."""
    marionette, run, theme = found.task.marionette, found.run, look.theme
    chosen = pose_times(marionette, run, poses)
    geometry = geometry_of(marionette, run.resample(chosen))
    width = _SHARE * sheet.width
    inner = Viewport(unit, 4.0 * unit, width - 2.0 * unit, sheet.height - 8.0 * unit)
    layout = layout_of(geometry, inner, look)
    sheet.floor(geometry, layout)
    fading_poses(sheet, geometry, layout)
    for target, actual in found.paths().values():
        for points, colour, dashes, thick in (
            (actual, PATH_COLOUR, "-", 0.16),
            (target, TARGET_COLOUR, (0, (3, 2)), 0.1),
        ):
            line = layout.camera.project(points, layout.viewport)
            sheet.axes.plot(
                line[:, 0],
                line[:, 1],
                color=colour,
                linestyle=dashes,
                linewidth=thick * unit,
                zorder=4.0,
            )
    for one in found.touched:
        spot = layout.camera.project(np.array([one.touch.place], dtype=float), layout.viewport)
        sheet.axes.plot(
            spot[:, 0],
            spot[:, 1],
            color=TARGET_COLOUR,
            marker="o",
            markersize=0.45 * unit,
            markerfacecolor="none",
            markeredgewidth=0.1 * unit,
            zorder=4.0,
        )
    sheet.title(found.task.name or geometry.title, unit, sheet.height - 1.5 * unit)
    sheet.tension_bar(geometry, layout, sheet.height - 2.3 * unit, unit, width - 1.6 * unit)
    times = ", ".join(f"{t - run.t[0]:.2f}" for t in chosen)
    caption = f"cost {found.cost:.3g}; poses at {times} s"
    sheet.write(1.6 * unit, 2.2 * unit, caption, unit, theme.ink, ha="left", va="center")


def _panels(found: Optimum, theme: Theme) -> list[Callable[[Axes], None]]:
    """What paints each panel, from above."""
    bounds, marionette = found.task.bounds, found.task.marionette
    speed = bounds.magnitudes(marionette, "speed")
    out: list[Callable[[Axes], None]] = []
    errors = {
        name: error
        for track, (name, error) in zip(
            (t for t in found.task.tracks if t.kind != "tension"),
            found.errors().items(),
            strict=True,
        )
        if track.kind != "velocity"
    }
    if errors:
        out.append(lambda axes: _errors(axes, found.t, errors, theme))
    if found.run.tension.names:
        out.append(lambda axes: _tensions(axes, found, theme))
    if np.any(np.isfinite(speed)):
        out.append(lambda axes: _inputs(axes, found, found.nodes.v_K, speed, "speed", theme))
    most = bounds.magnitudes(marionette, "acceleration")
    held = np.concatenate([found.nodes.acc_K, found.nodes.acc_K[-1:]])  # over the last interval
    out.append(lambda axes: _inputs(axes, found, held, most, "acceleration", theme))
    return out


def _errors(axes: Axes, t: np.ndarray, errors: dict[str, np.ndarray], theme: Theme) -> None:
    for k, (name, error) in enumerate(errors.items()):
        axes.plot(t, error, **line_look(theme, k), linewidth=1.2, label=plain(name, 24))
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("error [m or rad]", color=theme.ink)
    short_numbers(axes, theme)


def _tensions(axes: Axes, found: Optimum, theme: Theme) -> None:
    run, bounds = found.run, found.task.bounds.tension
    for k, name in enumerate(run.tension.names):
        look = line_look(theme, k)
        axes.plot(run.t, run.tension[name], **look, linewidth=1.2, label=plain(name, 24))
        for bound in bounds.get(name, ()):
            if np.isfinite(bound):
                _bound(axes, bound, look["color"])
    for track in found.task.tracks:
        if track.kind == "tension":
            k = run.tension.names.index(track.name)
            target = found.target(track)[:, 0]
            axes.plot(found.t, target, ":", color=line_look(theme, k)["color"], linewidth=1.0)
    axes.set_ylabel("tension [N]", color=theme.ink)
    short_numbers(axes, theme)


def _inputs(
    axes: Axes, found: Optimum, values: np.ndarray, most: np.ndarray, what: str, theme: Theme
) -> None:
    """Driven velocities or their rates, of inputs that are not held."""
    table, held = found.task.marionette.coordinates, found.task.bounds.held
    moving = [k for k, name in enumerate(table.v_K) if name not in held]
    for n, k in enumerate(moving):
        look, style = line_look(theme, n), "steps-post" if what == "acceleration" else "default"
        axes.plot(
            found.t,
            values[:, k],
            **look,
            linewidth=1.2,
            drawstyle=style,
            label=plain(table.v_K[k], 24),
        )
    alike = len(np.unique(most[moving])) == 1
    reach = _FAR * np.max(np.abs(values[:, moving]), initial=0.0)
    for n, k in enumerate(moving[:1] if alike else moving):
        if most[k] <= reach:  # farther ones would flatten the lines
            colour = theme.faint if alike else line_look(theme, n)["color"]
            _bound(axes, most[k], colour)
            _bound(axes, -most[k], colour)
    unit = "[m/s]" if what == "speed" else "[m/s\N{SUPERSCRIPT TWO}]"
    if any(row.unit != "m" for row in table.rows if row.name in table.q_K):
        unit = "(m, rad; s)"
    axes.set_ylabel(f"{what} {unit}", color=theme.ink)
    short_numbers(axes, theme)


def _bound(axes: Axes, value: float, colour: object) -> None:
    axes.axhline(value, color=colour, linewidth=0.8, linestyle=(0, (4, 3)), alpha=0.7)
