"""Picture of a puppet's body map: bodies and strings in the colours of their parts, with names.

A body map says which bodies and strings are trunk, head and limbs of a puppet. A link is a body on
its joint.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.base import Array
from fantoccini.model import BodyMap
from fantoccini.output.view.camera import Viewport
from fantoccini.output.view.compose import Layout, compose_polygons
from fantoccini.output.view.drawing import PictureOptions, Sheet, fit_layout
from fantoccini.output.view.geometry import Geometry, state_geometry
from fantoccini.output.view.pictures import check_picture_path, save_figure
from fantoccini.output.view.theme import STONE_COLOUR, mix_colours, rgb

if TYPE_CHECKING:
    from fantoccini.dynamics.marionette import Marionette
    from fantoccini.motion import State

PART_COLOURS = {
    "trunk": "#8f5a3c",
    "head": "#d1495b",
    "neck": "#e08a96",
    "arm": "#1b6ca8",
    "leg": "#3c8a5a",
    "wing": "#7b4fb0",
    "tail": "#d98b1f",
}
"""Kind of part -> its colour."""
_RIGHT_WHITE_SHARE = 0.45
"""Share of white in the colours of the right side."""
_PICTURE_SIZE = (1000, 900)
_NAME_COLUMN_WIDTH = 0.19
"""Width of the columns of names, relative to the picture's."""
_ARROW_LENGTH = 0.35
"""Length of the arrow in the direction in which the puppet looks, relative to its size."""


def body_map_picture(
    marionette: Marionette,
    state: State,
    body_map: BodyMap,
    path: str | os.PathLike[str],
    scale: float = 2.0,
) -> Path:
    """Writes a picture of a body map: parts in colours with their names, and where it looks.

    The right side is paler than the left one. Doubtful parts have a question mark.

    Args:
        marionette: puppet.
        state: its pose, usually at rest.
        body_map: its body map.
        path: path that ends in ``.png``, ``.svg`` or ``.pdf``.
        scale: pixels of the file per pixel of the picture, which has 1000 x 900.

    Returns:
        The path of the picture.
    """
    path = check_picture_path(path)
    part_by_body = _parts_of_bodies(body_map)
    geometry = _with_part_colours(state_geometry(marionette, state), body_map, part_by_body)
    size = float(np.ptp(geometry.balls(strings=False)[0], axis=0).max())
    trunk = geometry.poses[0, marionette.link_index(body_map.trunk[0])]
    forward = trunk[:, :3] @ np.array(body_map.facing)
    start = trunk[:, 3] + 0.15 * size * forward
    arrow = np.array([[start, start + _ARROW_LENGTH * size * forward]])
    geometry = replace(geometry, arrows=(arrow,))
    options, unit = PictureOptions.resolve(focus="bodies"), _PICTURE_SIZE[1] / 55.0
    sheet, side = Sheet(_PICTURE_SIZE, options.theme), _NAME_COLUMN_WIDTH * _PICTURE_SIZE[0] + unit
    inner = Viewport(side, 4.0 * unit, _PICTURE_SIZE[0] - 2.0 * side, _PICTURE_SIZE[1] - 8.0 * unit)
    layout = fit_layout(geometry, inner, options)
    sheet.add_floor(geometry, layout)
    sheet.add_polygons(compose_polygons(geometry, 0, layout))
    sheet.add_title(f"{geometry.title}: body map", unit, sheet.height - 1.5 * unit)
    _write_names(sheet, layout, _anchors(marionette, geometry, body_map), body_map, unit)
    return save_figure(sheet.figure, path, scale)


def _parts_of_bodies(body_map: BodyMap) -> dict[str, str]:
    """Body -> name of its part."""
    parts = {body: "trunk" for body in body_map.trunk}
    if body_map.head is not None:
        parts[body_map.head.body] = "head"
    for name, limb in body_map.parts.items():
        parts |= {body: name for body in limb.bodies}
    return parts


def _colour(body_map: BodyMap, part: str) -> Array:
    limb = body_map.parts.get(part)
    colour = rgb(PART_COLOURS[part if limb is None else limb.kind])
    return (
        mix_colours(colour, np.ones(3), _RIGHT_WHITE_SHARE)
        if limb and limb.side == "right"
        else colour
    )


def _with_part_colours(
    geometry: Geometry, body_map: BodyMap, part_by_body: Mapping[str, str]
) -> Geometry:
    """The geometry with bodies and strings in the colours of their parts."""
    links = geometry.tree.links

    def colour_of(link: int) -> Array:
        for k in geometry.tree.ancestors(link):
            if links[k].name in part_by_body:
                return _colour(body_map, part_by_body[links[k].name])
        return rgb(STONE_COLOUR)

    strings: dict[str, Array] = {}
    for part in ("trunk", "head", *body_map.parts):
        strings |= {name: _colour(body_map, part) for name in body_map.strings_of(part)}
    solids = tuple(
        replace(s, colour=colour_of(s.link), colours=None, detailed=None) for s in geometry.solids
    )
    return replace(geometry, solids=solids, colours=tuple(map(strings.get, geometry.names)))


def _anchors(marionette: Marionette, geometry: Geometry, body_map: BodyMap) -> dict[str, Array]:
    """Part -> (3,) point to which its name points [m]."""

    def world_point(body: str, point: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
        pose = geometry.poses[0, marionette.link_index(body)]
        return pose[:, :3] @ np.array(point) + pose[:, 3]

    anchors = {"trunk": world_point(body_map.trunk[0])}
    if body_map.head is not None:
        anchors["head"] = world_point(body_map.head.body, body_map.head.end)
    for name, limb in body_map.parts.items():
        anchors[name] = world_point(limb.bodies[-1], limb.end)
    return anchors


def _write_names(
    sheet: Sheet, layout: Layout, anchors: Mapping[str, Array], body_map: BodyMap, unit: float
) -> None:
    """Writes names in columns at the sides, in the order of the heights of their parts."""
    targets = {
        part: layout.camera.project(anchor[None], layout.viewport)[0, :2]
        for part, anchor in anchors.items()
    }
    by_x = sorted(targets, key=lambda part: targets[part][0])
    n_left = (len(by_x) + 1) // 2
    columns = (
        (by_x[:n_left], _NAME_COLUMN_WIDTH, "right"),
        (by_x[n_left:], 1.0 - _NAME_COLUMN_WIDTH, "left"),
    )
    for column, x, align in columns:
        gap, y = 2.4 * unit, sheet.height - 6.0 * unit
        for part in sorted(column, key=lambda name: -targets[name][1]):
            y = min(y - gap, float(targets[part][1]))
            colour = 0.8 * _colour(body_map, part)
            text = f"{part} ?" if body_map.doubt(part) else part
            sheet.add_text(x * sheet.width, y, text, 1.2 * unit, colour, ha=align, va="center")
            shift = -0.6 * unit if align == "left" else 0.6 * unit
            sheet.axes.plot(
                [x * sheet.width + shift, targets[part][0]],
                [y, targets[part][1]],
                color=colour,
                linewidth=0.08 * unit,
                zorder=6.0,
            )
