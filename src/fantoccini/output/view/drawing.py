"""Drawing on matplotlib's Agg canvas: a sheet in pixels with background, polygons and text.

matplotlib is imported when the first sheet is created, and only ``Figure`` objects are used: no
display, no global state. Names from files are drawn as plain text.

A layout places the geometry in a picture; a slack string sags, a taut one is straight.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from fantoccini.output.view.camera import Viewport, fit_camera, point_of_view
from fantoccini.output.view.compose import Layout
from fantoccini.output.view.geometry import Geometry, round_down
from fantoccini.output.view.shapes import handle_solids
from fantoccini.output.view.silhouettes import Polygon
from fantoccini.output.view.stage_set import LOOKS, STAGE_THEME, StageSet, vignette
from fantoccini.output.view.theme import Theme, mix_colours, theme_of

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from matplotlib.text import Text

DPI = 100.0
"""Pixels per inch of a sheet; a pixel is 0.72 points."""

_POINTS_PER_PIXEL = 72.0 / DPI
_STAGE_LINE_WIDTH = 0.6
"""Width of lines on a stage, relative to those of a diagram."""


@dataclass(frozen=True)
class PictureOptions:
    """Options of a picture.

    Attributes:
        view: preset, or (azimuth, elevation) in degrees.
        focus: ``all`` frames bodies and strings; with ``bodies`` strings may leave the picture.
        theme: colours.
        size: width and height [px]; None adapts it to the motion.
        look: ``diagram``, or ``stage`` for a theatre without title, time and tension scale.
    """

    view: str | tuple[float, float]
    focus: str
    theme: Theme
    size: tuple[int, int] | None
    look: str = "diagram"

    @classmethod
    def resolve(
        cls,
        view: str | tuple[float, float] = "auto",
        focus: str | None = None,
        theme: str | Theme = "light",
        size: tuple[int, int] | None = None,
        look: str = "diagram",
    ) -> PictureOptions:
        """Checks the options; resolves the theme's name, and the defaults of the look."""
        if look not in LOOKS:
            raise ValueError(f"look is {look!r}; it can be {' or '.join(LOOKS)}")
        stage = look == "stage"
        focus = focus or ("bodies" if stage else "all")
        if focus not in ("all", "bodies"):
            raise ValueError(f"focus is {focus!r}; it can be all or bodies")
        resolved_theme = theme_of(theme)
        if stage and isinstance(theme, str) and theme != "light":
            raise ValueError(
                f"theme is {theme!r} with look='stage', which has its own colours; leave it out"
            )
        return cls(
            view,
            focus,
            STAGE_THEME if stage and resolved_theme is not theme else resolved_theme,
            size,
            look,
        )


def one_line(text: str, max_length: int = 60) -> str:
    """The text on one line, without control characters, shortened to ``max_length``."""
    text = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return text if len(text) <= max_length else text[: max_length - 1] + "\N{HORIZONTAL ELLIPSIS}"


def blank_figure(size: tuple[int, int], **options: Any) -> Figure:
    """Figure of ``size`` [px] on an Agg canvas; ``options`` go to matplotlib's Figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(size[0] / DPI, size[1] / DPI), dpi=DPI, **options)
    FigureCanvasAgg(figure)
    return figure


def style_axes(
    axes: Axes, theme: Theme, grid: Literal["x", "both"], which: Literal["major", "both"] = "major"
) -> None:
    """Styles the frame, ticks (``which``) and grid lines (along ``grid``) of axes."""
    axes.set_facecolor("none")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(theme.muted)
    axes.tick_params(which=which, colors=theme.muted, labelcolor=theme.text, labelsize=8)
    axes.grid(True, which="major", axis=grid, color=theme.grid, linewidth=0.5, alpha=0.7)
    axes.set_axisbelow(True)


def fit_layout(
    geometry: Geometry,
    viewport: Viewport,
    options: PictureOptions,
    full_scale: float | None = None,
    pan: np.ndarray | None = None,
) -> Layout:
    """Layout whose camera has the whole motion inside the viewport.

    Args:
        geometry: geometry to show.
        viewport: rectangle of the picture.
        options: point of view, focus and theme.
        full_scale: upper end of the tension scale [N]; by default from the motion.
        pan: (T, 3) camera displacements [m]; the layout is for the first time.
    """
    centres, radii = geometry.balls(strings=options.focus == "all", pan=pan)
    azimuth, elevation = point_of_view(options.view, centres, geometry.plane)
    camera = fit_camera(
        *geometry.with_shadows(centres, radii), azimuth, elevation, viewport.width / viewport.height
    )
    line_width = max(0.6, 1.9 * (min(viewport.height, 1.6 * viewport.width) / 720.0) ** 0.7)
    theme = options.theme
    full_scale = geometry.tension_full_scale() if full_scale is None else full_scale
    stage = StageSet.around_motion(geometry, camera) if options.look == "stage" else None
    line_width *= 1.0 if stage is None else _STAGE_LINE_WIDTH
    beads = () if stage is not None else tuple(handle_solids(geometry.tree, theme, geometry.size))
    colours = theme.tension_colours()
    return Layout(camera, viewport, theme, line_width, full_scale, colours, beads, stage)


class Sheet:
    """Empty picture: axes in pixels over a soft background.

    Args:
        size: width and height [px].
        theme: colours.
    """

    def __init__(self, size: tuple[int, int], theme: Theme):
        self.width, self.height = size
        self.theme = theme
        self.figure = blank_figure(size, frameon=False)
        self.axes = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.axes.set_axis_off()
        rows = np.linspace(0.0, 1.0, 128)[:, None, None]
        pixels = np.clip(
            mix_colours(theme.lower_background, theme.upper_background, np.sqrt(rows)), 0.0, 1.0
        )
        self.add_image(pixels, (0.0, self.width, 0.0, self.height), 0.0)

    def add_image(
        self,
        pixels: np.ndarray,
        extent: tuple[float, float, float, float],
        zorder: float,
        animated: bool = False,
    ) -> AxesImage:
        """Adds rows of pixels, from the bottom up, stretched to (left, right, bottom, top) [px]."""
        artist = self.axes.imshow(
            pixels,
            extent=extent,
            origin="lower",
            aspect="auto",
            interpolation="bilinear",
            zorder=zorder,
            animated=animated,
        )
        self.axes.set_xlim(0.0, self.figure.bbox.width)
        self.axes.set_ylim(0.0, self.figure.bbox.height)
        return artist

    @property
    def frame(self) -> Viewport:
        """The whole sheet."""
        return Viewport(0.0, 0.0, self.width, self.height)

    def add_shadows(self, pixels: np.ndarray, frame: Viewport, animated: bool = False) -> AxesImage:
        """Adds the picture of the shadows on a stage, between the set and the puppets."""
        return self.add_image(pixels, frame.extent, 1.5, animated)

    def add_vignette(self, frame: Viewport, animated: bool = False) -> AxesImage:
        """Adds the darkness at the edges of a frame, in front of everything in it."""
        return self.add_image(vignette(frame), frame.extent, 3.5, animated)

    def clip(self, artist: Artist, frame: Viewport) -> None:
        """Hides what an artist draws outside of a frame."""
        from matplotlib.transforms import Bbox, TransformedBbox

        left, right, bottom, top = frame.extent
        box = Bbox.from_extents(left, bottom, right, top)
        artist.set_clip_box(TransformedBbox(box, self.axes.transData))

    def add_floor(
        self,
        geometry: Geometry,
        layout: Layout,
        grid: bool = True,
        light_centre: np.ndarray | None = None,
        animated: bool = False,
        frame: Viewport | None = None,
    ) -> list[Artist]:
        """Adds the set of a stage; else a spot of light on the floor and grid lines.

        Args:
            geometry: geometry with the floor.
            layout: camera and theme.
            grid: whether to draw grid lines.
            light_centre: (3,) centre of the light [m]; by default the light covers the whole
                motion.
            animated: whether matplotlib draws it only on request, as for animations.
            frame: rectangle that the set of a stage fills; the whole sheet by default.

        Returns:
            The added artists.
        """
        artists: list[Artist] = []
        theme, camera = layout.theme, layout.camera
        if layout.stage is not None:
            frame = frame or self.frame
            pixels = layout.stage.pixels(camera, layout.viewport, frame)
            return [self.add_image(pixels, frame.extent, 0.5, animated)]
        if camera.eye[2] <= geometry.floor + 0.02 * geometry.size:
            return artists
        centre, radius = (
            _light_spot(geometry)
            if light_centre is None
            else (light_centre[:2], 0.9 * geometry.size)
        )
        width, height = self.figure.bbox.width, self.figure.bbox.height
        x = np.linspace(0.0, width, 1 + int(width) // 4)
        y = np.linspace(0.0, height, 1 + int(height) // 4)
        rays = camera.rays(np.stack(np.meshgrid(x, y), axis=-1), layout.viewport)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = (geometry.floor - camera.eye[2]) / rays[..., 2]
            points = camera.eye[:2] + depth[..., None] * rays[..., :2]
            distance = np.linalg.norm(points - centre, axis=-1) / (1.25 * radius)
        light = np.where(
            (depth > 0.0) & (distance < 1.0), (1.0 - np.minimum(distance, 1.0) ** 2) ** 2, 0.0
        )
        lit_rows, lit_columns = (np.flatnonzero(light.any(axis=k)) for k in (1, 0))
        if len(lit_rows):
            # Only the lit part: the time to stretch an image grows with its area.
            rows = slice(lit_rows[0], lit_rows[-1] + 1)
            columns = slice(lit_columns[0], lit_columns[-1] + 1)
            lit_pixels = light[rows, columns]
            pixels = np.empty((*lit_pixels.shape, 4))
            pixels[..., :3], pixels[..., 3] = theme.floor[:3], theme.floor[3] * lit_pixels
            pixel_width, pixel_height = width / light.shape[1], height / light.shape[0]
            extent = (
                columns.start * pixel_width,
                columns.stop * pixel_width,
                rows.start * pixel_height,
                rows.stop * pixel_height,
            )
            artists.append(self.add_image(pixels, extent, 1.0, animated))
        if grid:
            lines = _grid_lines(geometry, layout, centre, radius)
            lines.set_animated(animated)
            self.axes.add_collection(lines, autolim=False)
            artists.append(lines)
        return artists

    def add_polygons(
        self, polygons: list[Polygon], zorder: float = 2.0, animated: bool = False
    ) -> PolyCollection:
        """Adds a collection of polygons, painted in the given order."""
        from matplotlib.collections import PolyCollection

        collection = PolyCollection(
            [], zorder=zorder, antialiased=True, joinstyle="round", animated=animated
        )
        self.axes.add_collection(collection, autolim=False)
        set_polygons(collection, polygons)
        return collection

    def add_text(
        self, x: float, y: float, text: str, size: float, colour: np.ndarray, **options: Any
    ) -> Text:
        """Adds plain text, without parsing formulas.

        Args:
            x, y: position [px].
            text: text to write.
            size: font size [px].
            colour: (3,) colour of the text.
            options: options of matplotlib (ha, va, weight, animated).
        """
        return self.axes.text(
            x,
            y,
            one_line(text),
            fontsize=size * _POINTS_PER_PIXEL,
            color=colour,
            parse_math=False,
            usetex=False,
            zorder=5.0,
            **options,
        )

    def add_title(self, text: str, unit: float, y: float, animated: bool = False) -> Text:
        """Adds the title at the left, with its top at height y, in multiples of ``unit`` [px]."""
        return self.add_text(
            1.6 * unit,
            y,
            text,
            1.35 * unit,
            self.theme.text,
            ha="left",
            va="top",
            weight="bold",
            animated=animated,
        )

    def add_tension_bar(
        self, geometry: Geometry, layout: Layout, y: float, unit: float, right: float | None = None
    ) -> None:
        """Adds the tension scale at the right, with a sample of a slack string.

        Args:
            geometry: geometry to show; without tensions nothing is drawn.
            layout: colours and upper end of the scale.
            y: vertical position of the bar [px].
            unit: unit of font sizes and gaps [px].
            right: right end of the bar [px]; by default near the sheet's edge.
        """
        if geometry.tension is None or not (geometry.names or geometry.chains):
            return
        theme, length, thickness = layout.theme, 15.0 * unit, 0.62 * unit
        right = self.width - 1.6 * unit if right is None else right
        left = right - length
        self.add_image(layout.colours[None, :, :], (left, right, y, y + thickness), 4.0)
        peaks = (
            np.nanmax(np.abs(x), initial=0.0) for x in (geometry.tension, geometry.chain_forces)
        )
        largest = max(geometry.max_tension, *map(float, peaks))
        prefix = "\N{GREATER-THAN OR EQUAL TO} " if largest > 1.001 * layout.full_scale else ""
        for x, text, align in (
            (left, "0", "left"),
            (right, f"{prefix}{layout.full_scale:g} N", "right"),
            (0.5 * (left + right), "tension", "center"),
            (left - 3.2 * unit, "slack", "center"),
        ):
            self.add_text(x, y - 0.35 * unit, text, 0.85 * unit, theme.muted, ha=align, va="top")
        self.axes.plot(
            [left - 4.4 * unit, left - 2.0 * unit],
            [y + 0.5 * thickness] * 2,
            color=theme.slack,
            linewidth=0.95 * layout.line_width * _POINTS_PER_PIXEL,
            zorder=4.0,
        )


def set_polygons(artist: PolyCollection, polygons: list[Polygon]) -> None:
    """Replaces the polygons of a collection, in painting order."""
    artist.set_verts([p.outline for p in polygons])
    artist.set_facecolor([p.face for p in polygons])
    artist.set_edgecolor([p.edge for p in polygons])
    artist.set_linewidth([p.width * _POINTS_PER_PIXEL for p in polygons])


def _light_spot(geometry: Geometry) -> tuple[np.ndarray, float]:
    """Centre (2,) and radius [m] of the light on the floor under a whole motion."""
    low, high = geometry.ground_box()
    return 0.5 * (low + high), 0.6 * float((high - low).max()) + 0.3 * geometry.size


def _grid_lines(
    geometry: Geometry, layout: Layout, centre: np.ndarray, radius: float
) -> LineCollection:
    from matplotlib.collections import LineCollection

    theme, camera = layout.theme, layout.camera
    step = round_down(radius / 4.0)
    ticks = np.arange(-6, 7) * step
    positions = np.linspace(-6 * step, 6 * step, 49)
    origin = np.round(centre / step) * step
    lines_along_y = np.stack([np.column_stack([np.full(49, t), positions]) for t in ticks])
    points = np.concatenate([lines_along_y, lines_along_y[..., ::-1]]) + origin
    points = np.concatenate([points, np.full((*points.shape[:2], 1), geometry.floor)], axis=2)
    projected = camera.project(points, layout.viewport)
    lines = np.stack([projected[:, :-1], projected[:, 1:]], axis=2).reshape(-1, 2, 3)
    distance = np.linalg.norm(
        0.5 * (points[:, :-1] + points[:, 1:])[..., :2] - centre, axis=2
    ).ravel()
    fade = np.clip(1.0 - distance / (1.35 * radius), 0.0, 1.0) ** 1.4
    visible = (fade > 0.0) & np.all(lines[..., 2] > 0.05 * geometry.size, axis=1)
    colours = np.column_stack([np.tile(theme.grid, (visible.sum(), 1)), fade[visible]])
    return LineCollection(
        lines[visible][..., :2],
        colors=colours,
        linewidths=0.55 * layout.line_width * _POINTS_PER_PIXEL,
        zorder=1.5,
        capstyle="butt",
    )
