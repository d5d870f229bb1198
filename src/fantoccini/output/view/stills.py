"""Stills of a play: pictures of every act from the audience's position, with one camera.

An act is a part of a play.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.output.view.camera import Viewport
from fantoccini.output.view.compose import Layout, compose_polygons
from fantoccini.output.view.drawing import PictureOptions, Sheet, fit_layout
from fantoccini.output.view.geometry import Geometry, run_geometry
from fantoccini.output.view.pictures import panel_size, pose_times
from fantoccini.output.view.theme import LIGHT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fantoccini.motion import Trajectory
    from fantoccini.theatre.plays import Play

AUDIENCE = (0.0, 10.0)
"""Point of view of the audience: azimuth and elevation [deg]."""

STILLS_PER_ROW = 4
"""Number of stills in a row."""
_FONT_SIZE = 0.05
"""Font size, relative to the width of a still."""


class ActStills:
    """Stills of a play, with one camera for the whole stage.

    Args:
        play: the compiled play.
        run: its run.
    """

    def __init__(self, play: Play, run: Trajectory):
        self._play, self._run = play, run
        times = np.linspace(run.t[0], run.t[-1], 400)
        self._run_geometry = run_geometry(play.marionette, run.resample(times))
        self._options = PictureOptions.resolve(AUDIENCE, "all", LIGHT)
        inner = Viewport(0.0, 0.0, *panel_size(self._run_geometry, self._options))
        self._layout = fit_layout(self._run_geometry, inner, self._options)
        self._font_size = _FONT_SIZE * inner.width

    def of_act(self, name: str, n: int = 8) -> Figure:
        """Figure of an act's most different poses, in rows of four.

        Args:
            name: name of the act.
            n: number of stills.
        """
        starts = [*self._play.acts.values(), float(self._run.t[-1])]
        act = list(self._play.acts).index(name)
        begin, end = (min(t, float(self._run.t[-1])) for t in starts[act : act + 2])
        act_times = np.linspace(begin, end, 200)
        times = pose_times(self._play.marionette, self._run.resample(act_times), n)
        geometry = run_geometry(self._play.marionette, self._run.resample(times))
        width, font_size = self._layout.viewport.width, self._font_size
        height = self._layout.viewport.height + 3.8 * font_size
        columns = min(STILLS_PER_ROW, len(times))
        rows = -(-len(times) // columns)
        sheet = Sheet((round(columns * width), round(rows * height)), LIGHT)
        for k, t in enumerate(times):
            column, row = k % columns, k // columns
            left, low = column * width, (rows - 1 - row) * height
            viewport = replace(self._layout.viewport, x=left, y=low + 3.3 * font_size)
            layout = replace(self._layout, viewport=viewport)
            sheet.add_floor(self._run_geometry, layout, grid=False)
            sheet.add_polygons(compose_polygons(geometry, k, layout))
            self._write_names(sheet, geometry, k, layout)
            sheet.add_text(
                left + 0.5 * width,
                low + 0.6 * font_size,
                f"{t:.2f} s",
                font_size,
                LIGHT.text,
                ha="center",
                va="bottom",
            )
        for draw_line, step, count in (
            (sheet.axes.axvline, width, columns),
            (sheet.axes.axhline, height, rows),
        ):
            for k in range(1, count):
                draw_line(k * step, color=LIGHT.grid, linewidth=0.8, zorder=4.0)
        return sheet.figure

    def _write_names(self, sheet: Sheet, geometry: Geometry, k: int, layout: Layout) -> None:
        """Writes each player's name on the floor, because puppets of the same file look alike."""
        cast, font_size = self._play.cast, self._font_size
        for name in cast.players if len(cast.players) > 1 else ():
            first_points = [
                points[k, 0]
                for string, points in zip(geometry.names, geometry.points, strict=True)
                if cast.owner(string) == name
            ]
            if not first_points:
                continue
            point = np.append(np.mean(first_points, axis=0)[:2], geometry.floor)
            x, y, _ = layout.camera.project(point, layout.viewport)
            sheet.add_text(
                x, y - 0.4 * font_size, name, 0.9 * font_size, LIGHT.text, ha="center", va="top"
            )
