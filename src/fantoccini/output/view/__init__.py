"""Pictures and film of a motion, without a GPU or a display.

``strip`` writes a row of poses, ``draw`` one state, ``plot`` the run against time, ``film`` an mp4
or a gif, ``play_report`` the page of a verified play, ``stand_report`` that of a stand's check,
``identified_report`` that of an identification.
matplotlib and ffmpeg are loaded by the first call, not by importing this package; pyvista only
for ``renderer="pyvista"``.
"""

from fantoccini.output.view import rope
from fantoccini.output.view.body_maps import body_map_picture
from fantoccini.output.view.camera import Camera, fit_camera, point_of_view
from fantoccini.output.view.drawing import DPI, blank_figure, one_line, style_axes
from fantoccini.output.view.films import MAX_GIF_FPS, FilmError, film
from fantoccini.output.view.geometry import (
    Geometry,
    Guides,
    chain_points,
    force_arrows,
    round_down,
    run_geometry,
    spread_indices,
    spring_ends,
    state_geometry,
)
from fantoccini.output.view.meshes import TriangleMesh, coloured_surfaces, frame_along, triangulate
from fantoccini.output.view.notebook import puppet_html, run_html
from fantoccini.output.view.optima import optimum_picture
from fantoccini.output.view.pictures import draw, pose_times, strip
from fantoccini.output.view.plans import MAX_DOTS, PATH_COLOUR, plan_picture
from fantoccini.output.view.plots import plot
from fantoccini.output.view.shapes import handle_solids
from fantoccini.output.view.silhouettes import Solid, box_solid, capsule_solid
from fantoccini.output.view.still import Drawable, UncompiledPuppet
from fantoccini.output.view.stills import AUDIENCE, ActStills
from fantoccini.output.view.studio import RENDERERS
from fantoccini.output.view.subtitles import save_captions
from fantoccini.output.view.theme import (
    DARK,
    LIGHT,
    RED,
    STONE_COLOUR,
    Theme,
    mix_colours,
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
    "STONE_COLOUR",
    "ActStills",
    "Camera",
    "Drawable",
    "FilmError",
    "Geometry",
    "Guides",
    "Solid",
    "Theme",
    "TriangleMesh",
    "UncompiledPuppet",
    "blank_figure",
    "body_map_picture",
    "box_solid",
    "capsule_solid",
    "chain_points",
    "coloured_surfaces",
    "draw",
    "film",
    "fit_camera",
    "force_arrows",
    "frame_along",
    "handle_solids",
    "mix_colours",
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
    "run_geometry",
    "run_html",
    "save_captions",
    "spread_indices",
    "spring_ends",
    "state_geometry",
    "strip",
    "style_axes",
    "theme_of",
    "to_bytes",
    "to_hex",
    "triangulate",
]
