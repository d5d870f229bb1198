"""A motion as one file that any browser plays from disk, without a network."""

from __future__ import annotations

import json
import os
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.files import replacing
from fantoccini.view.theme import Theme
from fantoccini.web.moment import moment_of
from fantoccini.web.panel import text
from fantoccini.web.replay import RATE, Film
from fantoccini.web.server import Server, policy, with_title
from fantoccini.web.stage import Stage
from fantoccini.web.tree import Growth

if TYPE_CHECKING:
    from collections.abc import Callable

    from fantoccini.marionette import Marionette
    from fantoccini.motion import Trajectory

_QUANTUM = 1e-4
"""Places are rounded to a tenth of a millimetre for a puppet of a metre."""
_SCRIPT = """
(() => {
  const {t0, rate, top, tension, taut, colours} = READINGS;
  const rows = [...document.querySelectorAll("#readings > div")];
  let shown = -1;
  const read = () => {
    // The player's own time, where its slider stands: the frame that it draws is the last one
    // that has begun.
    const slider = document.querySelector("[role=slider]");
    const t = slider === null ? NaN : parseFloat(slider.getAttribute("aria-valuenow"));
    const k = Math.max(0, Math.min(tension.length - 1, Math.floor(t * rate + 1e-6)));
    if (Number.isFinite(t) && k !== shown) {
      shown = k;
      document.getElementById("clock").textContent = (t0 + t).toFixed(1) + " s";
      rows.forEach((row, s) => {
        const pull = tension[k][s], share = taut[k][s] ? Math.min(1, Math.abs(pull) / top) : 0;
        row.children[1].firstChild.style.width = 100 * share + "%";
        row.children[1].firstChild.style.background =
          colours[Math.round(share * (colours.length - 1))];
        row.children[2].textContent = taut[k][s] ? pull.toFixed(2) + " N" : "slack";
      });
    }
    requestAnimationFrame(read);  // however slowly the page is drawn, the numbers go with it
  };
  read();
})();
"""


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
    stage.show(moment_of(scene, 0))
    recorder = server.viser.get_scene_serializer()
    for k in range(frames):
        stage.show(moment_of(scene, k))
        if k < frames - 1:
            recorder.insert_sleep(float(scene.t[k + 1] - scene.t[k]))
        if progress is not None:
            progress((k + 1) / frames)
    return recorder.as_html(dark_mode=theme.name == "dark")


def _dressed(page: str, film: Film, theme: Theme) -> str:
    """The page with its title, a caption with readings, and no way out to a network."""
    meta = f'<meta http-equiv="Content-Security-Policy" content="{escape(policy())}">'
    page = with_title(page, film.scene.title)
    head = page.index("<head>") + len("<head>")
    page = page[:head] + meta + page[head:]
    body = page.rindex("</body>")
    return page[:body] + _caption(film, theme) + page[body:]


def _caption(film: Film, theme: Theme) -> str:
    """Name, time and tensions in the corner, as HTML."""
    scene, run = film.scene, film.run
    ink = "#" + "".join(f"{round(255.0 * float(c)):02x}" for c in theme.ink)
    rows = "".join(
        '<div style="display:grid;grid-template-columns:8em 5em 4.2em;gap:0.6em;'
        f'align-items:center"><span>{text(name)}</span><span style="background:'
        'rgba(128,128,128,0.2);border-radius:3px;height:0.55em"><span style="display:block;'
        'height:100%;border-radius:3px"></span></span><span style="text-align:right"></span></div>'
        for name in scene.names
    )
    tension = np.zeros(scene.taut.shape) if scene.tension is None else scene.tension
    readings = {
        "t0": float(run.t[0]),
        "rate": (len(scene.t) - 1) / run.duration if run.duration > 0.0 else 1.0,
        "top": scene.tension_top(),
        "tension": np.round(tension, 2).tolist(),
        "taut": scene.taut.astype(int).tolist(),
        "colours": [
            "#" + "".join(f"{round(255.0 * float(c)):02x}" for c in colour)
            for colour in theme.tension_colours(32)
        ],
    }
    # Nothing in here is text of the puppet's; `<` cannot occur.
    script = _SCRIPT.replace("READINGS", json.dumps(readings, allow_nan=False))
    return (
        f'<div style="position:fixed;right:1.2em;top:1em;z-index:5;pointer-events:none;color:{ink};'
        'font:13px/1.5 system-ui,sans-serif">'
        f'<div style="font-size:18px;font-weight:600">{text(scene.title)} '
        '<span id="clock" style="font-weight:400;opacity:0.7"></span></div>'
        f'<div id="readings" style="margin-top:0.4em;font-variant-numeric:tabular-nums">{rows}'
        f"</div></div><script>{script}</script>"
    )
