"""Stills of a play: every act as a few pictures from where the audience sits, all alike framed."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.output.view.camera import Viewport
from fantoccini.output.view.compose import Layout, compose
from fantoccini.output.view.drawing import Look, Sheet, layout_of
from fantoccini.output.view.geometry import Geometry, geometry_of
from fantoccini.output.view.pictures import panel_size, pose_times
from fantoccini.output.view.theme import LIGHT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fantoccini.motion import Trajectory
    from fantoccini.theatre.plays import Play

AUDIENCE = (0.0, 10.0)
"""The point of view of the audience: azimuth and elevation [deg]."""

ACROSS = 4
"""Stills in a row."""
_LETTERS = 0.05
"""Height of a line of text over the width of a still."""


class Stills:
    """The stage of a play, with one camera for all of it.

    Args:
        play: compiled.
        run: of it.
    """

    def __init__(self, play: Play, run: Trajectory):
        self._play, self._run = play, run
        times = np.linspace(run.t[0], run.t[-1], 400)
        self._whole = geometry_of(play.marionette, run.resample(times))
        self._look = Look.of(AUDIENCE, "all", LIGHT)
        inner = Viewport(0.0, 0.0, *panel_size(self._whole, self._look))
        self._layout = layout_of(self._whole, inner, self._look)
        self._letters = _LETTERS * inner.width

    def of_act(self, name: str, n: int = 8) -> Figure:
        """Stills of an act, the most different ones, in rows of four.

        Args:
            name: of the act.
            n: number of stills.
        """
        starts = [*self._play.acts.values(), float(self._run.t[-1])]
        act = list(self._play.acts).index(name)
        begin, end = (min(t, float(self._run.t[-1])) for t in starts[act : act + 2])
        within = np.linspace(begin, end, 200)
        times = pose_times(self._play.marionette, self._run.resample(within), n)
        geometry = geometry_of(self._play.marionette, self._run.resample(times))
        width, letters = self._layout.viewport.width, self._letters
        height = self._layout.viewport.height + 3.8 * letters
        across = min(ACROSS, len(times))
        rows = -(-len(times) // across)
        sheet = Sheet((round(across * width), round(rows * height)), LIGHT)
        for k, t in enumerate(times):
            column, row = k % across, k // across
            left, low = column * width, (rows - 1 - row) * height
            viewport = replace(self._layout.viewport, x=left, y=low + 3.3 * letters)
            layout = replace(self._layout, viewport=viewport)
            sheet.floor(self._whole, layout, grid=False)
            sheet.polygons(compose(geometry, k, layout))
            self._names(sheet, geometry, k, layout)
            sheet.write(
                left + 0.5 * width,
                low + 0.6 * letters,
                f"{t:.2f} s",
                letters,
                LIGHT.ink,
                ha="center",
                va="bottom",
            )
        for line, step, most in (
            (sheet.axes.axvline, width, across),
            (sheet.axes.axhline, height, rows),
        ):
            for k in range(1, most):
                line(k * step, color=LIGHT.grid, linewidth=0.8, zorder=4.0)
        return sheet.figure

    def _names(self, sheet: Sheet, geometry: Geometry, k: int, layout: Layout) -> None:
        """Writes each player's name below its feet: puppets of one file look alike."""
        cast, letters = self._play.cast, self._letters
        for name in cast.players if len(cast.players) > 1 else ():
            own = [
                places[k, 0]
                for string, places in zip(geometry.names, geometry.points, strict=True)
                if cast.owner(string) == name
            ]
            if not own:
                continue
            below = np.append(np.mean(own, axis=0)[:2], geometry.floor)
            x, y, _ = layout.camera.project(below, layout.viewport)
            sheet.write(x, y - 0.4 * letters, name, 0.9 * letters, LIGHT.ink, ha="center", va="top")
