"""Pictures and film of a motion, without a GPU or a display.

``strip`` writes a row of poses, ``draw`` one state, ``plot`` the run against time, ``film`` an mp4
or a gif, ``play_report`` the page of a verified play, ``stand_report`` that of a stand's check,
``identified_report`` that of an identification.
matplotlib and ffmpeg are loaded by the first call, not by importing this package; pyvista only
for ``renderer="pyvista"``.
"""

from fantoccini.output.view import rope
from fantoccini.output.view.body_maps import body_map_picture
from fantoccini.output.view.camera import Camera, fit, point_of_view
from fantoccini.output.view.drawing import DPI, blank_figure, one_line, style_axes
from fantoccini.output.view.films import MAX_GIF_FPS, FilmError, film
from fantoccini.output.view.geometry import (
    Geometry,
    Guides,
    chain_points,
    force_arrows,
    geometry_at,
    geometry_of,
    round_down,
    spread,
    spring_ends,
)
from fantoccini.output.view.meshes import TriangleMesh, coloured, frame_along, triangles
from fantoccini.output.view.notebook import puppet_html, run_html
from fantoccini.output.view.optima import optimum_picture
from fantoccini.output.view.pictures import draw, pose_times, strip
from fantoccini.output.view.plans import MAX_DOTS, PATH_COLOUR, plan_picture
from fantoccini.output.view.plots import plot
from fantoccini.output.view.shapes import handles
from fantoccini.output.view.silhouettes import Solid, box, capsule
from fantoccini.output.view.still import Drawable, Still
from fantoccini.output.view.stills import AUDIENCE, Stills
from fantoccini.output.view.studio import RENDERERS
from fantoccini.output.view.subtitles import save_captions
from fantoccini.output.view.theme import (
    DARK,
    LIGHT,
    RED,
    STONE,
    Theme,
    mix,
    rgb,
    theme_of,
    to_bytes,
    to_hex,
)

__all__ = [
    "AUDIENCE",
    "DARK",
    "DPI",
    "LIGHT",
    "MAX_DOTS",
    "MAX_GIF_FPS",
    "PATH_COLOUR",
    "RED",
    "RENDERERS",
    "STONE",
    "Camera",
    "Drawable",
    "FilmError",
    "Geometry",
    "Guides",
    "Solid",
    "Still",
    "Stills",
    "Theme",
    "TriangleMesh",
    "blank_figure",
    "body_map_picture",
    "box",
    "capsule",
    "chain_points",
    "coloured",
    "draw",
    "film",
    "fit",
    "force_arrows",
    "frame_along",
    "geometry_at",
    "geometry_of",
    "handles",
    "mix",
    "one_line",
    "optimum_picture",
    "plan_picture",
    "plot",
    "point_of_view",
    "pose_times",
    "puppet_html",
    "rgb",
    "rope",
    "round_down",
    "run_html",
    "save_captions",
    "spread",
    "spring_ends",
    "strip",
    "style_axes",
    "theme_of",
    "to_bytes",
    "to_hex",
    "triangles",
]
