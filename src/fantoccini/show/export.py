"""A motion as one file that any browser plays from disk, without a network."""

from __future__ import annotations

import os
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.motion.archive import replacing
from fantoccini.show.moment import Moment, moment_of
from fantoccini.show.panel import text
from fantoccini.show.replay import RATE, Film
from fantoccini.show.server import Server, policy, with_title
from fantoccini.show.stage import Stage
from fantoccini.show.tree import Growth
from fantoccini.view.theme import Theme

if TYPE_CHECKING:
    from collections.abc import Callable

    from fantoccini.marionette import Marionette
    from fantoccini.motion import Trajectory

_QUANTUM = 1e-4
"""Places are rounded to a tenth of a millimetre for a puppet of a metre."""
_LABELS_EVERY = 6
"""Frames between two readings of the tensions."""


def write_html(
    marionette: Marionette,
    run: Trajectory,
    path: str | os.PathLike,
    theme: Theme,
    growth: Growth | None = None,
    view: str = "three-quarter",
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Writes a motion as one HTML file; it appears whole or not at all.

    Args:
        marionette: the puppet's handle.
        run: its motion.
        path: of the file.
        theme: the look.
        growth: tree of the plan that the motion comes from, or None.
        view: where it is seen from at first.
        progress: is told how much is done, 0 to 1.

    Returns:
        The path.
    """
    path = Path(path)
    film = Film.of(marionette, run, rate=RATE)
    # viser records what a server would send: one is needed, though nobody comes.
    server = Server(film.scene.title, theme, port=0)
    try:
        page = _recorded(server, film, theme, growth, view, progress)
    finally:
        server.stop()
    with replacing(path) as temporary:
        temporary.write_text(_dressed(page, film, theme), encoding="utf-8")
    return path


def _recorded(
    server: Server,
    film: Film,
    theme: Theme,
    growth: Growth | None,
    view: str,
    progress: Callable[[float], None] | None,
) -> str:
    scene, frames = film.scene, len(film.scene.t)
    stage = Stage(server.viser, scene, theme, quantum=_QUANTUM * scene.size)
    if growth is not None:
        growth.add_to(server.viser, theme, scene.size)
    stage.look(server.viser.initial_camera, view)
    readings = Readings(server, stage)
    first = moment_of(scene, 0)
    stage.show(first)
    readings.show(first)
    recorder = server.viser.get_scene_serializer()
    for k in range(frames):
        moment = moment_of(scene, k)
        stage.show(moment)
        if k % _LABELS_EVERY == 0:
            readings.show(moment)
        if k < frames - 1:
            recorder.insert_sleep(float(scene.t[k + 1] - scene.t[k]))
        if progress is not None:
            progress((k + 1) / frames)
    return recorder.as_html(dark_mode=theme.name == "dark")


class Readings:
    """Tensions in the scene, each at the upper end of its string.

    Args:
        server: of the page.
        stage: what it shows.
    """

    def __init__(self, server: Server, stage: Stage):
        self._size = stage.scene.size
        self._labels = [
            server.viser.scene.add_label(
                f"/readings/{s}", "", font_screen_scale=0.95, anchor="bottom-center"
            )
            for s in range(len(stage.scene.names))
        ]
        self._ends = [self._upper(points[0]) for points in stage.scene.points]
        self._wires = stage.scene.wires

    def show(self, moment: Moment) -> None:
        """Reads the tensions of a moment."""
        for s, label in enumerate(self._labels):
            place = moment.points[s][self._ends[s]]
            if not np.isfinite(place).all():
                continue
            label.position = place + [0.0, 0.0, 0.02 * self._size]
            holds = bool(moment.taut[s]) or self._wires[s]
            pull = None if moment.tension is None else float(moment.tension[s])
            label.text = f"{pull:.1f} N" if holds and pull is not None else "slack"

    @staticmethod
    def _upper(points: np.ndarray) -> int:
        return 0 if points[0, 2] > points[-1, 2] else -1


def _dressed(page: str, film: Film, theme: Theme) -> str:
    """The page with its title, a caption, and no way out to a network."""
    scene = film.scene
    ink = "#" + "".join(f"{round(255.0 * float(c)):02x}" for c in theme.ink)
    caption = (
        f'<div style="position:fixed;left:1em;top:0.8em;z-index:5;pointer-events:none;color:{ink};'
        'font:600 17px/1.4 system-ui,sans-serif">'
        f"{text(scene.title)}"
        f'<div style="font-weight:400;font-size:13px;opacity:0.7">{film.run.duration:.2f} s'
        f"{_scale(film, theme)}</div></div>"
    )
    meta = f'<meta http-equiv="Content-Security-Policy" content="{escape(policy())}">'
    page = with_title(page, scene.title)
    head = page.index("<head>") + len("<head>")
    page = page[:head] + meta + page[head:]
    body = page.rindex("</body>")
    return page[:body] + caption + page[body:]


def _scale(film: Film, theme: Theme) -> str:
    """The colours of tension, as HTML."""
    scene = film.scene
    if scene.tension is None or not scene.names:
        return ""
    steps = theme.tension_colours(12)
    colours = ",".join("rgb(" + ",".join(str(round(255 * float(c))) for c in s) + ")" for s in steps)
    return (
        f'<div style="margin-top:0.6em">tension 0 <span style="display:inline-block;width:7em;'
        f'height:0.5em;border-radius:3px;background:linear-gradient(90deg,{colours})"></span> '
        f"{scene.tension_top():g} N</div>"
    )
