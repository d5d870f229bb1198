"""A plan as the paper's Fig. 4 shows one: nodes as dots, the way taken, poses, obstacles."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.view.camera import Viewport
from fantoccini.view.compose import compose
from fantoccini.view.drawing import collection, floor, sheet, show, stage_of, tension_bar, write
from fantoccini.view.pictures import checked, pose_times, save
from fantoccini.view.scene import scene_of
from fantoccini.view.theme import Theme, theme_of

if TYPE_CHECKING:
    from fantoccini.marionette import Marionette
    from fantoccini.motion import Trajectory

_FAINTEST = 0.22
"""Opacity of the first pose; the last has all."""

_MOST_DOTS = 20_000


def plan_picture(
    marionette: Marionette,
    run: Trajectory,
    nodes: np.ndarray,
    way: np.ndarray,
    path: str | os.PathLike,
    poses: int = 4,
    view: str | tuple[float, float] = "auto",
    theme: str | Theme = "light",
    size: tuple[int, int] = (900, 900),
    scale: float = 2.0,
) -> Path:
    """Writes a picture of a plan in its tree.

    Args:
        marionette: the puppet, among the obstacles.
        run: the plan's motion.
        nodes: (n, 3) where a point of the puppet is at the nodes of the tree [m].
        way: (m, 3) where it goes along the plan [m].
        path: ends in ``.png``, ``.svg`` or ``.pdf``.
        poses: of the puppet along the plan.
        view: preset, or (azimuth, elevation) in degrees.
        theme: ``light``, ``dark``, or a Theme.
        size: width and height [px].
        scale: pixels of the file for a pixel of ``size``.

    Returns:
        The path of the picture.
    """
    path, theme = checked(path), theme_of(theme)
    chosen = pose_times(marionette, run, poses)
    scene, (width, height) = scene_of(marionette, run.resample(chosen)), size
    unit = max(7.0, height / 55.0)
    figure, axes = sheet(size, theme)
    inner = Viewport(unit, 4.0 * unit, width - 2.0 * unit, height - 8.0 * unit)
    stage = stage_of(scene, inner, theme, view, "all")
    floor(axes, scene, stage)
    shown = nodes[np.unique(np.linspace(0, len(nodes) - 1, _MOST_DOTS).astype(int))]
    dots = stage.camera.project(shown, inner)
    axes.plot(
        dots[:, 0], dots[:, 1], ".", color=theme.ink, alpha=0.35, markersize=0.22 * unit,
        markeredgewidth=0.0, zorder=1.5, rasterized=True,
    )  # fmt: skip
    for k in range(len(chosen)):
        opacity = _FAINTEST + (1.0 - _FAINTEST) * k / max(len(chosen) - 1, 1)
        # Obstacles stand with the last pose, that nothing of them is painted over.
        last = k == len(chosen) - 1
        part = (
            scene if last else replace(scene, solids=tuple(s for s in scene.solids if s.link >= 0))
        )
        polygons = [
            replace(p, face=_faint(p.face, opacity), edge=_faint(p.edge, opacity))
            for p in compose(part, k, stage)
        ]
        show(collection(axes, zorder=2.0 + 0.1 * k), polygons)
    line = stage.camera.project(way, inner)
    axes.plot(line[:, 0], line[:, 1], color="#2b6cb0", linewidth=0.12 * unit, zorder=4.0)
    write(
        axes, 1.6 * unit, height - 1.5 * unit, scene.title, 1.35 * unit, theme.ink,
        ha="left", va="top", weight="bold",
    )  # fmt: skip
    caption = f"{len(nodes)} nodes; {run.t[-1] - run.t[0]:.2f} s, poses at " + ", ".join(
        f"{t - run.t[0]:.2f} s" for t in chosen
    )
    write(axes, 1.6 * unit, 2.2 * unit, caption, unit, theme.ink, ha="left", va="center")
    tension_bar(axes, scene, stage, width - 1.6 * unit, height - 2.3 * unit, unit)
    return save(figure, path, scale)


def _faint(colour: tuple[float, ...], opacity: float) -> tuple[float, ...]:
    return (*colour[:3], colour[3] * opacity) if len(colour) == 4 else (*colour[:3], opacity)
