"""Export of a motion as one file that any browser plays from disk, without a network.

A taut string pulls; a slack one hangs in a curve.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.app.pages.loop import REFRESH
from fantoccini.app.pages.nodes import SceneNodes
from fantoccini.app.pages.plan_tree import PlanTree
from fantoccini.app.pages.replay import ResampledRun
from fantoccini.app.pages.scene_state import scene_at_sample
from fantoccini.app.pages.server import Server, insert_in_head, security_policy, with_title
from fantoccini.base import OnProgress, Progress, replacing
from fantoccini.output.html import element, to_html
from fantoccini.output.view import Theme, to_hex

if TYPE_CHECKING:
    from fantoccini.dynamics.marionette import Marionette
    from fantoccini.motion import Trajectory

_ROUNDING_STEP = 1e-4
"""Step to which positions are rounded, relative to the puppet's size: 0.1 mm for 1 m."""
_SCRIPT = """
(() => {
  const {t0, rate, top, tension, taut, colours} = READINGS;
  const rows = [...document.querySelectorAll("#readings > div")];
  let shown = -1;
  const read = () => {
    // The player draws the last frame that begins at or before its slider's time.
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
    requestAnimationFrame(read);  // synchronous with the picture, even if that is slow
  };
  read();
})();
"""


def write_html(
    marionette: Marionette,
    run: Trajectory,
    path: str | os.PathLike[str],
    theme: Theme,
    tree: PlanTree | None = None,
    progress: OnProgress | None = None,
    forces: bool = False,
) -> Path:
    """Writes a motion as one HTML file, which appears only when complete.

    Args:
        marionette: the puppet.
        run: its motion.
        path: path of the file.
        theme: colours.
        tree: search tree of the plan with this motion, or None.
        progress: callback after every frame.
        forces: draw the forces of contacts.

    Returns:
        The path.

    Raises:
        ValueError: forces were requested for a run without contacts.
    """
    path = Path(path)
    motion = ResampledRun.from_run(marionette, run, REFRESH.rate, forces)
    # viser records the messages of a server, so it needs one, although nothing connects.
    server = Server(motion.geometry.title, theme, port=0)
    try:
        page = _record_page(server, motion, theme, tree, progress, forces)
    finally:
        server.stop()
    with replacing(path) as temporary:
        temporary.write_text(_with_caption(page, motion, theme), encoding="utf-8")
    return path


def _record_page(
    server: Server,
    motion: ResampledRun,
    theme: Theme,
    tree: PlanTree | None,
    progress: OnProgress | None,
    forces: bool,
) -> str:
    geometry, n_frames = motion.geometry, len(motion.geometry.t)
    nodes = SceneNodes(server.viser, geometry, theme, rounding_step=_ROUNDING_STEP * geometry.size)
    if tree is not None:
        tree.add_to(server.viser, theme, geometry.size)
    nodes.aim_camera(server.viser.initial_camera, "three-quarter")
    nodes.show_forces(forces)
    nodes.show(scene_at_sample(geometry, 0))
    recorder = server.viser.get_scene_serializer()
    for k in range(n_frames):
        nodes.show(scene_at_sample(geometry, k))
        if k < n_frames - 1:
            recorder.insert_sleep(float(geometry.t[k + 1] - geometry.t[k]))
        if progress is not None:
            progress(Progress(done=k + 1, total=n_frames))
    return recorder.as_html(dark_mode=theme.name == "dark")


def _with_caption(page: str, motion: ResampledRun, theme: Theme) -> str:
    """The page with a title, a caption with readings, and without access to a network."""
    meta = element("meta", http_equiv="Content-Security-Policy", content=security_policy())
    page = with_title(page, motion.geometry.title)
    page = insert_in_head(page, to_html(meta))
    body = page.rindex("</body>")
    return page[:body] + _caption(motion, theme) + page[body:]


def _caption(motion: ResampledRun, theme: Theme) -> str:
    """Caption in the corner with name, time and tensions, as HTML."""
    geometry, run = motion.geometry, motion.run
    row_style = "display:grid;grid-template-columns:8em 5em 4.2em;gap:0.6em;align-items:center"
    bar_style = "background:rgba(128,128,128,0.2);border-radius:3px;height:0.55em"
    rows = [
        element(
            "div",
            element("span", name),
            element(
                "span",
                element("span", style="display:block;height:100%;border-radius:3px"),
                style=bar_style,
            ),
            element("span", style="text-align:right"),
            style=row_style,
        )
        for name in geometry.names
    ]
    tension = np.zeros(geometry.taut.shape) if geometry.tension is None else geometry.tension
    readings = {
        "t0": float(run.t[0]),
        "rate": (len(geometry.t) - 1) / run.duration if run.duration > 0.0 else 1.0,
        "top": geometry.tension_full_scale(),
        "tension": np.round(tension, 2).tolist(),
        "taut": geometry.taut.astype(int).tolist(),
        "colours": [to_hex(colour) for colour in theme.tension_colours(32)],
    }
    # Contains no text from the puppet file, so `<` cannot occur.
    script = _SCRIPT.replace("READINGS", json.dumps(readings, allow_nan=False))
    clock = element("span", id="clock", style="font-weight:400;opacity:0.7")
    title = element("div", f"{geometry.title} ", clock, style="font-size:18px;font-weight:600")
    table_style = "margin-top:0.4em;font-variant-numeric:tabular-nums"
    corner_style = (
        "position:fixed;right:1.2em;top:1em;z-index:5;pointer-events:none;"
        f"color:{to_hex(theme.text)};font:13px/1.5 system-ui,sans-serif"
    )
    caption = element(
        "div", title, element("div", *rows, id="readings", style=table_style), style=corner_style
    )
    return to_html(caption, element("script", script))
