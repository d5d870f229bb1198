"""Still pictures: a strip of poses, or one state.

A strip is a row of poses; a link is a body on its joint. In names, D stands for dynamic
coordinates, which move by the equations of motion, and K for driven ones: ends and lengths of
strings, driven joints.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.base import PictureError, replacing
from fantoccini.output.view.camera import Viewport
from fantoccini.output.view.compose import Layout, compose_polygons, shadow_polygons
from fantoccini.output.view.drawing import DPI, PictureOptions, Sheet, fit_layout
from fantoccini.output.view.geometry import Geometry, Guides, run_geometry, state_geometry
from fantoccini.output.view.stage_set import puppet_viewport
from fantoccini.output.view.stage_shadows import stage_shadows
from fantoccini.output.view.still import Drawable
from fantoccini.output.view.studio import Studio, check_renderer
from fantoccini.output.view.theme import Theme

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fantoccini.motion import State, Trajectory

FORMATS = (".png", ".svg", ".pdf")
"""File endings of pictures."""
_STAGE_GAP = 6.0
"""Distance between the stages of a strip [px]."""
MAX_POSE_GAP = 1.5
"""Largest time between neighbouring poses of a strip, relative to equal steps."""


def strip(
    marionette: Drawable,
    run: Trajectory,
    path: str | os.PathLike[str],
    n: int = 7,
    times: str | Sequence[float] | None = None,
    view: str | tuple[float, float] = "auto",
    focus: str | None = None,
    theme: str | Theme = "light",
    size: tuple[int, int] | None = None,
    scale: float = 2.0,
    forces: bool = False,
    guides: Guides | None = None,
    look: str = "diagram",
) -> Path:
    """Writes a strip of poses of a run, side by side, from left to right in time.

    Args:
        marionette: the puppet.
        run: its motion.
        path: path that ends in ``.png``, ``.svg`` or ``.pdf``.
        n: number of poses.
        times: ``poses`` for the most different poses, ``events`` for those just after catches,
            ``even`` for equal steps; or the times themselves [s]. By default ``poses``, but
            ``even`` in the look ``stage``, which does not show the times.
        view: preset, or (azimuth, elevation) in degrees.
        focus: ``all`` frames bodies and strings; with ``bodies`` strings may leave the picture,
            as by default in the look ``stage``.
        theme: ``light``, ``dark``, or a Theme; the look ``stage`` has its own colours.
        size: width and height [px]; by default adapted to the motion.
        scale: pixels of the file per pixel of ``size``.
        forces: whether to draw the forces of contacts, as arrows to scale; those of impacts are
            shortened.
        guides: lines that the motion is compared with, as for :func:`film`.
        look: ``diagram``, or ``stage``: a theatre, with thin plain strings and without title,
            times and tension scale.

    Returns:
        The path of the picture.

    Raises:
        ValueError: forces were requested for a run without contacts.
    """
    path = check_picture_path(path)
    options = PictureOptions.resolve(view, focus, theme, size, look)
    if times is None:
        times = "even" if options.look == "stage" else "poses"
    return save_figure(
        strip_figure(marionette, run, n, times, options, forces, guides), path, scale
    )


def strip_figure(
    marionette: Drawable,
    run: Trajectory,
    n: int,
    times: str | Sequence[float],
    options: PictureOptions,
    forces: bool = False,
    guides: Guides | None = None,
) -> Figure:
    """Strip as a matplotlib figure; arguments as for :func:`strip`."""
    sample_times = pose_times(marionette, run, n, times)
    geometry = run_geometry(marionette, run.resample(sample_times), forces).with_guides(guides)
    motion = run_geometry(marionette, run.resample(np.linspace(run.t[0], run.t[-1], 400)))
    peaks = run.tension.values[np.isfinite(run.tension.values)]
    motion = replace(motion, max_tension=float(np.max(peaks, initial=0.0)))
    n = len(sample_times)
    if options.size is None:
        panel = panel_size(geometry, options)
        width = round(n * panel[0] + 40)
        unit = max(12.0, width / 130.0)  # a wide strip is viewed from farther away
        height = round(panel[1] + 9.2 * unit)
    else:
        width, height = options.size
        unit = max(7.0, height / 50.0)
    sheet = Sheet((width, height), options.theme)

    if options.look == "stage":
        for k in range(n):
            frame = Viewport(
                k * width / n, 0.0, width / n - (_STAGE_GAP if k < n - 1 else 0.0), height
            )
            add_stage(sheet, geometry, k, options, frame)
        return sheet.figure
    full_scale = motion.tension_full_scale()
    panel_width = (width - 2.0 * unit) / n
    for k in range(n):
        viewport = Viewport(unit + k * panel_width, 4.6 * unit, panel_width, height - 9.2 * unit)
        layout = fit_layout(geometry, viewport, options, full_scale)
        sheet.add_floor(geometry, layout, grid=False)
        sheet.add_polygons(compose_polygons(geometry, k, layout))
        sheet.add_text(
            viewport.x + 0.5 * panel_width,
            3.2 * unit,
            f"{sample_times[k]:.2f} s",
            1.1 * unit,
            options.theme.text,
            ha="center",
            va="center",
        )
    add_title_and_scale(sheet, motion, layout, unit)
    return sheet.figure


def add_stage(
    sheet: Sheet, geometry: Geometry, k: int, options: PictureOptions, frame: Viewport
) -> None:
    """Adds sample k of a geometry on a stage, within a frame."""
    layout = fit_layout(geometry, puppet_viewport(frame), options)
    sheet.add_floor(geometry, layout, frame=frame)
    sheet.add_shadows(stage_shadows(geometry, k, layout, frame), frame)
    sheet.clip(sheet.add_polygons(compose_polygons(geometry, k, layout)), frame)
    sheet.add_vignette(frame)


def draw(
    marionette: Drawable,
    state: State,
    path: str | os.PathLike[str],
    tension: np.ndarray | None = None,
    view: str | tuple[float, float] = "auto",
    focus: str | None = None,
    theme: str | Theme = "light",
    size: tuple[int, int] = (720, 900),
    scale: float = 2.0,
    renderer: str = "matplotlib",
    look: str = "diagram",
) -> Path:
    """Writes a picture of one state.

    Args:
        marionette: the puppet.
        state: configuration and active set.
        path: path that ends in ``.png``, ``.svg`` or ``.pdf``.
        tension: (n_strings,) tensions [N]; None draws strings without the tension scale.
        view: preset, or (azimuth, elevation) in degrees.
        focus, theme, look: options of :func:`strip`.
        size: width and height [px].
        scale: pixels of the file per pixel of ``size``.
        renderer: ``matplotlib``, or ``pyvista`` for shaded solids, if installed.

    Returns:
        The path of the picture.

    Raises:
        MissingLibraryError: pyvista was chosen and is not installed.
    """
    path = check_picture_path(path)
    geometry = state_geometry(marionette, state, tension)
    studio_scale = scale if check_renderer(renderer) == "pyvista" else None
    options = PictureOptions.resolve(view, focus, theme, size, look)
    return save_figure(state_figure(geometry, options, studio_scale), path, scale)


def state_figure(
    geometry: Geometry, options: PictureOptions, studio_scale: float | None = None
) -> Figure:
    """First sample of a geometry as a matplotlib figure.

    With ``studio_scale``, pyvista renders solids and strings, with that many pixels per pixel of
    the figure.
    """
    sheet, layout, unit = framed_sheet(geometry, options)
    if studio_scale is None:
        sheet.add_polygons(compose_polygons(geometry, 0, layout))
    else:
        sheet.add_polygons(shadow_polygons(geometry, 0, layout))
        size = (sheet.width, sheet.height)
        studio = Studio(geometry, layout, size, studio_scale)
        sheet.add_image(studio.render(0)[::-1], (0.0, size[0], 0.0, size[1]), 3.0)
        studio.close()
    add_title_and_scale(sheet, geometry, layout, unit)
    return sheet.figure


def framed_sheet(geometry: Geometry, options: PictureOptions) -> tuple[Sheet, Layout, float]:
    """Sheet with the floor of a geometry, its layout, and the font size [px]."""
    width, height = options.size or (720, 900)
    unit = max(7.0, height / 55.0)
    sheet = Sheet((width, height), options.theme)
    inner = Viewport(unit, 4.0 * unit, width - 2.0 * unit, height - 8.0 * unit)
    inner = puppet_viewport(sheet.frame) if options.look == "stage" else inner
    layout = fit_layout(geometry, inner, options)
    sheet.add_floor(geometry, layout)
    if layout.stage is not None:
        sheet.add_shadows(stage_shadows(geometry, 0, layout, sheet.frame), sheet.frame)
    return sheet, layout, unit


def add_title_and_scale(sheet: Sheet, geometry: Geometry, layout: Layout, unit: float) -> None:
    """Adds the title and the tension scale, or the darkness around a stage."""
    if layout.stage is not None:
        sheet.add_vignette(sheet.frame)
        return
    sheet.add_title(geometry.title, unit, sheet.height - 1.5 * unit)
    sheet.add_tension_bar(geometry, layout, sheet.height - 2.3 * unit, unit)


def pose_times(
    marionette: Drawable, run: Trajectory, n: int, selection: str | Sequence[float] = "poses"
) -> np.ndarray:
    """Times [s] at which a strip shows the puppet, in order.

    ``poses`` begins with the first and last time and repeatedly adds the time whose pose differs
    most from all poses so far; the difference includes the distance in time. Neighbours are at most
    :data:`MAX_POSE_GAP` even steps apart.

    Args:
        marionette: the puppet.
        run: its motion.
        n: number of times.
        selection: ``poses``, ``events``, ``even``, or the times themselves.
    """
    start, stop = float(run.t[0]), float(run.t[-1])
    if not isinstance(selection, str):
        return np.sort(np.clip(np.asarray(selection, dtype=float), start, stop))
    if n < 1:
        raise ValueError(f"n is {n}; a strip needs at least one pose")
    even_times = np.linspace(start, stop, n) if n > 1 else np.array([0.5 * (start + stop)])
    if selection == "even" or n < 3:
        return even_times
    if selection not in ("poses", "events"):
        raise ValueError(f"times is {selection!r}; it can be poses, events, even or numbers")
    grid = np.linspace(start, stop, 200)
    pose_features = _features(marionette, run.resample(grid))
    relative_time = ((grid - start) / max(stop - start, 1e-12))[:, None]
    features = np.concatenate([pose_features, 1.2 * relative_time], axis=1)
    samples = [0, len(grid) - 1]
    if selection == "events":
        catch_times = sorted(e.t for e in run.events if e.kind in ("catch", "accumulation"))
        catch_indices = np.unique(
            np.linspace(0, len(catch_times) - 1, min(n - 2, len(catch_times))).astype(int)
        )
        samples += [int(np.searchsorted(grid, catch_times[k])) for k in catch_indices]
        samples = sorted({min(k, len(grid) - 1) for k in samples})
    max_gap = math.ceil(MAX_POSE_GAP * (len(grid) - 1) / (n - 1))
    while len(samples) < n:
        distances = np.linalg.norm(features[:, None] - features[samples][None], axis=2).min(axis=1)
        if distances.max() <= 0.0:
            break
        n_left = n - len(samples) - 1
        fills_gaps = [_n_missing([*samples, k], max_gap) <= n_left for k in range(len(grid))]
        if any(fills_gaps):
            distances = np.where(fills_gaps, distances, -1.0)
        samples.append(int(np.argmax(distances)))
    return grid[sorted(samples)]


def _n_missing(samples: list[int], max_gap: int) -> int:
    """Number of further samples after which no two neighbours are more than a gap apart."""
    return sum(max(0, b - a - 1) // max_gap for a, b in pairwise(sorted(samples)))


def _features(marionette: Drawable, run: Trajectory) -> np.ndarray:
    """Positions of all links (T, 3 n_links), scaled so that the motion has size one."""
    positions = np.asarray(marionette.poses(run.q_D, run.q_K))[..., 3]
    flat = positions.reshape(len(positions), -1)
    flat = np.nan_to_num(flat - flat.mean(axis=0))
    return flat / max(float(np.linalg.norm(flat, axis=1).max()), 1e-12)


def panel_size(geometry: Geometry, options: PictureOptions) -> tuple[float, float]:
    """Width and height [px] of a pose; the width is adapted to the motion."""
    layout = fit_layout(geometry, Viewport(0.0, 0.0, 500.0, 500.0), options)
    centres, radii = geometry.balls(strings=options.focus == "all")
    projected = layout.camera.project(centres, layout.viewport)
    radii_px = radii * layout.camera.scale(projected[:, 2], layout.viewport)
    low, high = (
        (projected[:, :2] - radii_px[:, None]).min(0),
        (projected[:, :2] + radii_px[:, None]).max(0),
    )
    aspect = float(np.clip((high[0] - low[0]) / max(high[1] - low[1], 1e-9), 0.30, 1.3))
    if options.look == "stage":
        return 560.0 * max(aspect, 0.7), 560.0
    height = 560.0 if aspect < 0.7 else 400.0
    return aspect * height * 1.06, height


def check_picture_path(path: str | os.PathLike[str]) -> Path:
    """Returns the path of a picture, if its ending is known and its folder exists."""
    path = Path(path)
    if path.suffix.lower() not in FORMATS:
        raise ValueError(f"a picture ends in {', '.join(FORMATS)}, not in {path.suffix!r}")
    if not os.path.isdir(path.parent):
        raise PictureError(f"there is no folder {path.parent}")
    return path


def save_figure(figure: Figure, path: Path, scale: float) -> Path:
    """Writes a figure; the file appears only when complete."""
    try:
        with replacing(path) as temporary:
            figure.savefig(temporary, dpi=DPI * scale, format=path.suffix[1:].lower())
    except OSError as error:
        raise PictureError(f"{path} cannot be written: {error.strerror}") from error
    return path
