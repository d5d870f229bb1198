"""Pictures and film of a motion, without a GPU or a display.

``strip`` writes a row of poses, ``draw`` one state, ``plot`` the run against time, ``film`` an mp4
or a gif, ``play_report`` the page of a verified play, ``stand_report`` that of a stand's check,
``identified_report`` that of an identification.
matplotlib and ffmpeg are loaded by the first call, not by importing this package; pyvista only
where ``renderer="pyvista"`` asks for it.
"""

from fantoccini.view.films import FilmError, film
from fantoccini.view.identified_page import identified_report
from fantoccini.view.notebook import puppet_html, run_html
from fantoccini.view.optima import optimum_picture
from fantoccini.view.pictures import draw, pose_times, strip
from fantoccini.view.plans import plan_picture
from fantoccini.view.play_page import play_report
from fantoccini.view.plots import plot
from fantoccini.view.stand_page import stand_report
from fantoccini.view.stills import AUDIENCE
from fantoccini.view.studio import RENDERERS
from fantoccini.view.theme import DARK, LIGHT, Theme

__all__ = [
    "AUDIENCE",
    "DARK",
    "LIGHT",
    "RENDERERS",
    "FilmError",
    "Theme",
    "draw",
    "film",
    "identified_report",
    "optimum_picture",
    "plan_picture",
    "play_report",
    "plot",
    "pose_times",
    "puppet_html",
    "run_html",
    "stand_report",
    "strip",
]
