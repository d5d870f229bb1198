"""Picture of a plan like the paper's Fig. 4: nodes as dots, the path, poses, obstacles.

A node is a state that the search has reached.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.model.tree import WORLD
from fantoccini.output.view.compose import Layout, compose_polygons
from fantoccini.output.view.drawing import PictureOptions, Sheet
from fantoccini.output.view.geometry import Geometry, run_geometry, spread_indices
from fantoccini.output.view.pictures import (
    add_title_and_scale,
    check_picture_path,
    framed_sheet,
    pose_times,
    save_figure,
)
from fantoccini.output.view.still import Drawable
from fantoccini.output.view.theme import Theme, rgb

if TYPE_CHECKING:
    from fantoccini.motion import Trajectory

FIRST_OPACITY = 0.22
"""Opacity of the first pose; the last has 1."""

MAX_DOTS = 20_000
"""Largest number of nodes that are drawn."""

PATH_COLOUR = rgb("#2b6cb0")


def plan_picture(
    marionette: Drawable,
    run: Trajectory,
    nodes: np.ndarray,
    way: np.ndarray,
    path: str | os.PathLike[str],
    poses: int = 4,
    view: str | tuple[float, float] = "auto",
    theme: str | Theme = "light",
    size: tuple[int, int] = (900, 900),
    scale: float = 2.0,
) -> Path:
    """Writes a picture of a plan and its search tree.

    Args:
        marionette: the puppet with its obstacles.
        run: the plan's motion.
        nodes: (n, 3) positions of a point of the puppet at the nodes of the tree [m].
        way: (m, 3) path of this point along the plan [m].
        path: path that ends in ``.png``, ``.svg`` or ``.pdf``.
        poses: number of poses of the puppet along the plan.
        view: preset, or (azimuth, elevation) in degrees.
        theme: ``light``, ``dark``, or a Theme.
        size: width and height [px].
        scale: pixels of the file per pixel of ``size``.

    Returns:
        The path of the picture.
    """
    path, options = check_picture_path(path), PictureOptions.resolve(view, "all", theme, size)
    times = pose_times(marionette, run, poses)
    geometry = run_geometry(marionette, run.resample(times))
    sheet, layout, unit = framed_sheet(geometry, options)
    dots = layout.camera.project(nodes[spread_indices(len(nodes), MAX_DOTS)], layout.viewport)
    sheet.axes.plot(
        dots[:, 0],
        dots[:, 1],
        ".",
        color=options.theme.text,
        alpha=0.35,
        markersize=0.22 * unit,
        markeredgewidth=0.0,
        zorder=1.5,
        rasterized=True,
    )
    fading_poses(sheet, geometry, layout)
    line = layout.camera.project(way, layout.viewport)
    sheet.axes.plot(line[:, 0], line[:, 1], color=PATH_COLOUR, linewidth=0.12 * unit, zorder=4.0)
    caption = f"{len(nodes)} nodes; {run.t[-1] - run.t[0]:.2f} s, poses at " + ", ".join(
        f"{t - run.t[0]:.2f} s" for t in times
    )
    sheet.add_text(
        1.6 * unit, 2.2 * unit, caption, unit, options.theme.text, ha="left", va="center"
    )
    add_title_and_scale(sheet, geometry, layout, unit)
    return save_figure(sheet.figure, path, scale)


def fading_poses(sheet: Sheet, geometry: Geometry, layout: Layout) -> None:
    """Paints all samples of a geometry over one another, later ones more opaque."""
    # Obstacles are painted with the last pose, so that they stay opaque.
    moving = replace(geometry, solids=tuple(s for s in geometry.solids if s.link != WORLD))
    last = len(geometry.t) - 1
    for k in range(last + 1):
        opacity = FIRST_OPACITY + (1.0 - FIRST_OPACITY) * k / max(last, 1)
        polygons = [
            replace(p, face=_faded(p.face, opacity), edge=_faded(p.edge, opacity))
            for p in compose_polygons(geometry if k == last else moving, k, layout)
        ]
        sheet.add_polygons(polygons, zorder=2.0 + 0.1 * k)


def _faded(colour: tuple[float, ...], opacity: float) -> tuple[float, ...]:
    return (*colour[:3], colour[3] * opacity)
