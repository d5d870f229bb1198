"""Painting on matplotlib's Agg canvas: a sheet in pixels, its background, polygons and captions.

matplotlib is imported when the first sheet is made, never before, and only through ``Figure``
objects: no display, no global state. Names from files are drawn as plain text.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fantoccini.view.camera import Viewport, fit, point_of_view
from fantoccini.view.compose import Stage
from fantoccini.view.scene import Scene, handles
from fantoccini.view.silhouettes import Polygon
from fantoccini.view.theme import Theme, mix

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from matplotlib.text import Text

DPI = 100.0
"""Pixels of a sheet for an inch; one pixel is 0.72 points."""

_POINTS = 72.0 / DPI


def plain(text: str, most: int = 60) -> str:
    """Text on one line, without control characters, at most so long."""
    text = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return text if len(text) <= most else text[: most - 1] + "\N{HORIZONTAL ELLIPSIS}"


def sheet(size: tuple[int, int], theme: Theme) -> tuple[Figure, Axes]:
    """An empty picture: axes over all of it, in pixels, on a soft background.

    Args:
        size: width and height [px].
        theme: the look.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width, height = size
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, frameon=False)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    rows = np.linspace(0.0, 1.0, 128)[:, None, None]
    pixels = np.clip(mix(theme.bottom, theme.top, np.sqrt(rows)), 0.0, 1.0)
    image(axes, pixels, (0.0, width, 0.0, height), 0.0)
    return figure, axes


def image(
    axes: Axes, pixels: np.ndarray, extent: tuple, zorder: float, animated: bool = False
) -> AxesImage:
    """Rows of pixels from below, stretched over a part of the sheet."""
    shown = axes.imshow(
        pixels, extent=extent, origin="lower", aspect="auto", interpolation="bilinear",
        zorder=zorder, animated=animated,
    )  # fmt: skip
    axes.set_xlim(0.0, axes.figure.bbox.width)
    axes.set_ylim(0.0, axes.figure.bbox.height)
    return shown


def stage_of(
    scene: Scene,
    viewport: Viewport,
    theme: Theme,
    view: str | tuple[float, float] = "auto",
    focus: str = "all",
    top: float | None = None,
    pan: np.ndarray | None = None,
) -> Stage:
    """A stage whose camera has the whole motion inside the viewport.

    Args:
        scene: what to show.
        viewport: where in the picture.
        theme: the look.
        view: preset, or (azimuth, elevation) in degrees.
        focus: ``all`` frames bodies and strings, ``bodies`` lets strings leave the picture.
        top: upper end of the tension scale [N]; by default from the motion.
        pan: (T, 3) how far the camera goes along [m]; this is where it begins.
    """
    if focus not in ("all", "bodies"):
        raise ValueError(f"focus can be all or bodies, not {focus!r}")
    centres, radii = scene.balls(strings=focus == "all", pan=pan)
    azimuth, elevation = point_of_view(view, centres, scene.plane)
    # Shadows belong to the picture, unless the floor is far below.
    low = centres[:, 2] - scene.floor
    near = (low > 0.0) & (low < 0.25 * scene.size)
    feet = np.column_stack([centres[near, :2], np.full(near.sum(), scene.floor)])
    camera = fit(
        np.concatenate([centres, feet]), np.concatenate([radii, np.zeros(len(feet))]),
        azimuth, elevation, viewport.width / viewport.height,
    )  # fmt: skip
    pen = max(0.6, 1.9 * (min(viewport.height, 1.6 * viewport.width) / 720.0) ** 0.7)
    held = tuple(handles(scene.tree, theme, scene.size))
    return Stage(
        camera, viewport, theme, pen, scene.tension_top() if top is None else top,
        theme.tension_colours(), held,
    )  # fmt: skip


def floor(
    axes: Axes,
    scene: Scene,
    stage: Stage,
    grid: bool = True,
    gone: np.ndarray | None = None,
    animated: bool = False,
) -> list[Artist]:
    """A spot of light on the floor and, with ``grid``, the floor's lines, fading outwards.

    Args:
        axes: of a sheet.
        scene: whose floor it is.
        stage: how.
        grid: draw the lines.
        gone: (3,) how far the camera has gone along; the light is about the puppet there [m].
        animated: for matplotlib: drawn when it is asked for.

    Returns:
        What was added.
    """
    made: list[Artist] = []
    theme, camera = stage.theme, stage.camera
    if camera.eye[2] <= scene.floor + 0.02 * scene.size:
        return made
    middle, reach = spot(scene) if gone is None else (gone[:2], 0.9 * scene.size)
    width, height = axes.figure.bbox.width, axes.figure.bbox.height
    x = np.linspace(0.0, width, 1 + int(width) // 4)
    y = np.linspace(0.0, height, 1 + int(height) // 4)
    rays = camera.rays(np.stack(np.meshgrid(x, y), axis=-1), stage.viewport)
    with np.errstate(divide="ignore", invalid="ignore"):
        ahead = (scene.floor - camera.eye[2]) / rays[..., 2]
        place = camera.eye[:2] + ahead[..., None] * rays[..., :2]
        away = np.linalg.norm(place - middle, axis=-1) / (1.25 * reach)
    light = np.where((ahead > 0.0) & (away < 1.0), (1.0 - np.minimum(away, 1.0) ** 2) ** 2, 0.0)
    rows, columns = (np.flatnonzero(light.any(axis=k)) for k in (1, 0))
    if len(rows):
        # Only the lit part: stretching an image takes time by its area.
        rows, columns = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        lit = light[rows, columns]
        pixels = np.empty((*lit.shape, 4))
        pixels[..., :3], pixels[..., 3] = theme.floor[:3], theme.floor[3] * lit
        across, up = width / light.shape[1], height / light.shape[0]
        extent = (columns.start * across, columns.stop * across, rows.start * up, rows.stop * up)
        made.append(image(axes, pixels, extent, 1.0, animated))
    if grid:
        made.append(_grid(axes, scene, stage, middle, reach))
        made[-1].set_animated(animated)
    return made


def spot(scene: Scene) -> tuple[np.ndarray, float]:
    """Middle (2,) and reach [m] of the light on the floor that a whole motion has."""
    centres, _ = scene.balls()
    low, high = np.percentile(centres[:, :2], [2.0, 98.0], axis=0)
    return 0.5 * (low + high), 0.6 * float((high - low).max()) + 0.3 * scene.size


def _grid(
    axes: Axes, scene: Scene, stage: Stage, middle: np.ndarray, reach: float
) -> LineCollection:
    from matplotlib.collections import LineCollection

    theme, camera = stage.theme, stage.camera
    step = _round(reach / 4.0)
    ticks = np.arange(-6, 7) * step
    along = np.linspace(-6 * step, 6 * step, 49)
    origin = np.round(middle / step) * step
    lines = [np.column_stack([np.full(49, t), along]) for t in ticks]
    lines += [line[:, ::-1] for line in lines]
    points = np.stack(lines) + origin
    points = np.concatenate([points, np.full((*points.shape[:2], 1), scene.floor)], axis=2)
    placed = camera.project(points, stage.viewport)
    lines = np.stack([placed[:, :-1], placed[:, 1:]], axis=2).reshape(-1, 2, 3)
    away = np.linalg.norm(0.5 * (points[:, :-1] + points[:, 1:])[..., :2] - middle, axis=2).ravel()
    fade = np.clip(1.0 - away / (1.35 * reach), 0.0, 1.0) ** 1.4
    good = (fade > 0.0) & np.all(lines[..., 2] > 0.05 * scene.size, axis=1)
    colours = np.column_stack([np.tile(theme.grid, (good.sum(), 1)), fade[good]])
    drawn = LineCollection(
        lines[good][..., :2], colors=colours, linewidths=0.55 * stage.pen * _POINTS, zorder=1.5,
        capstyle="butt",
    )  # fmt: skip
    axes.add_collection(drawn, autolim=False)
    return drawn


def collection(axes: Axes, zorder: float = 2.0, animated: bool = False) -> PolyCollection:
    """An empty collection of polygons on the axes."""
    from matplotlib.collections import PolyCollection

    polygons = PolyCollection(
        [], zorder=zorder, antialiased=True, joinstyle="round", animated=animated
    )
    axes.add_collection(polygons, autolim=False)
    return polygons


def show(artist: PolyCollection, polygons: list[Polygon]) -> None:
    """Puts these polygons, in this order, into a collection."""
    artist.set_verts([p.outline for p in polygons])
    artist.set_facecolor([p.face for p in polygons])
    artist.set_edgecolor([p.edge for p in polygons])
    artist.set_linewidth([p.width * _POINTS for p in polygons])


def write(axes: Axes, x: float, y: float, text: str, size: float, colour, **how) -> Text:
    """Plain text on the sheet: no mathematics, whatever the text holds.

    Args:
        axes: of a sheet.
        x, y: place [px].
        text: to write.
        size: height of the letters' line [px].
        colour: of the text.
        how: passed on to matplotlib (ha, va, weight, animated).
    """
    return axes.text(
        x, y, plain(text), fontsize=size * _POINTS, color=colour, parse_math=False, usetex=False,
        zorder=5.0, **how,
    )  # fmt: skip


def tension_bar(
    axes: Axes, scene: Scene, stage: Stage, right: float, y: float, unit: float
) -> None:
    """The scale of tension, with the sign for a slack string, ending at ``right`` [px].

    Args:
        axes: of a sheet.
        scene: what is shown; nothing is drawn when it has no tension.
        stage: how.
        right, y: right end and height of the bar [px].
        unit: size of the letters [px].
    """
    if scene.tension is None or not (scene.names or scene.chains):
        return
    theme = stage.theme
    length, thick = 15.0 * unit, 0.62 * unit
    left = right - length
    image(axes, stage.colours[None, :, :], (left, right, y, y + thick), 4.0)
    largest = max(float(np.nanmax(np.abs(x), initial=0.0)) for x in (scene.tension, scene.pulls))
    over = largest > 1.001 * stage.top
    sign = "\N{GREATER-THAN OR EQUAL TO} " if over else ""
    write(axes, left, y - 0.35 * unit, "0", 0.85 * unit, theme.faint, ha="left", va="top")
    write(
        axes, right, y - 0.35 * unit, f"{sign}{stage.top:g} N", 0.85 * unit, theme.faint,
        ha="right", va="top",
    )  # fmt: skip
    write(
        axes, 0.5 * (left + right), y - 0.35 * unit, "tension", 0.85 * unit, theme.faint,
        ha="center", va="top",
    )  # fmt: skip
    axes.plot(
        [left - 4.4 * unit, left - 2.0 * unit], [y + 0.5 * thick] * 2, color=theme.slack,
        linewidth=0.95 * stage.pen * _POINTS, zorder=4.0,
    )  # fmt: skip
    write(
        axes, left - 3.2 * unit, y - 0.35 * unit, "slack", 0.85 * unit, theme.faint, ha="center",
        va="top",
    )  # fmt: skip


def _round(length: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above ``length``."""
    unit = 10.0 ** np.floor(np.log10(length))
    return float(unit * max(f for f in (1.0, 2.0, 5.0) if f * unit <= length * (1.0 + 1e-9)))
