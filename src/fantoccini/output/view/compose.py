"""Polygons of one sample of the geometry, in painting order, shadows first.

An occluder is a solid that may hide a string. A handle is a string end that a hand holds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.model.tree import WORLD
from fantoccini.output.view.camera import Camera, Viewport
from fantoccini.output.view.geometry import Geometry, StringCurve
from fantoccini.output.view.order import BoxFaces, Occluder, StringPiece, painting_order
from fantoccini.output.view.silhouettes import (
    TRANSPARENT,
    Polygon,
    Solid,
    paint_solid,
    shadow_outline,
)
from fantoccini.output.view.stage_set import StageSet
from fantoccini.output.view.theme import Theme, mix_colours

MIN_DEPTH = 1e-6
"""Distance from the eye below which nothing is drawn [m]."""

_THREAD_WIDTH = 0.9
"""Width of strings in the theme's colour, in line widths."""
_GUIDE_WIDTH, _GUIDE_EDGE_WIDTH = 2.6, 5.0
"""Widths of guides without and with their edge, in line widths."""
_SHADOW_LAYERS = (9.0, 6.0, 3.5, 1.2, 0.0)
"""Widths of the nested outlines that soften a shadow's edge, in line widths."""


@dataclass(frozen=True)
class Layout:
    """Placement of the geometry in a picture, and drawing options.

    Attributes:
        camera, viewport: the view, and the rectangle of the picture that it fills.
        theme: colours.
        line_width: width of an outline [px].
        full_scale: upper end of the tension scale [N].
        colours: (256, 3) colours of the tension scale.
        handles: beads and hooks on held string ends.
        stage: curtain and floor of a stage; None in a diagram.
    """

    camera: Camera
    viewport: Viewport
    theme: Theme
    line_width: float
    full_scale: float
    colours: np.ndarray
    handles: tuple[Solid, ...]
    stage: StageSet | None = None

    def string_colour(self, string: StringCurve) -> np.ndarray:
        """Colour (3,) of a string: the theme's for slack ones and on a stage, else by tension."""
        if self.theme.thread is not None:
            return self.theme.thread if string.colour is None else string.colour
        if not string.taut:
            return self.theme.slack
        if string.tension is None or not np.isfinite(string.tension):
            return self.theme.text if string.colour is None else string.colour
        share = np.clip(abs(string.tension) / self.full_scale, 0.0, 1.0)
        return self.colours[int(share * (len(self.colours) - 1))]


def compose_polygons(geometry: Geometry, k: int, layout: Layout) -> list[Polygon]:
    """Polygons of the geometry at time ``t[k]``, in painting order."""
    camera, viewport = layout.camera, layout.viewport
    polygons_by_solid: list[list[Polygon]] = []
    occluders: list[Occluder] = []
    for solid in (*geometry.solids, *layout.handles):
        pose = solid_pose(solid, geometry.poses[k])
        if not np.isfinite(pose).all():
            continue
        if polygons := paint_solid(solid, pose, camera, viewport, layout.theme, layout.line_width):
            polygons_by_solid.append(polygons)
            occluders.append(make_occluder(solid, pose, polygons))
    strings = string_lines(geometry, k, layout)
    composed = shadow_polygons(geometry, k, layout)
    for entry in painting_order(camera, viewport, occluders, [line.points for line in strings]):
        if isinstance(entry, StringPiece):
            line = strings[entry.string]
            composed.append(_stroke(line, line.points[entry.start : entry.stop + 1], layout))
        else:
            composed += polygons_by_solid[entry]
    return composed + arrow_polygons(geometry, k, layout) + guide_strokes(geometry, k, layout)


def guide_strokes(geometry: Geometry, k: int, layout: Layout) -> list[Polygon]:
    """Guides, lines that the motion is compared with, at time ``t[k]``, in front of everything.

    An edge in the colour of the background separates them from the puppet.
    """
    lines = [
        line[k]
        for line in geometry.guides
        if np.isfinite(line[k]).all() and np.all(layout.camera.to_camera(line[k])[:, 2] > MIN_DEPTH)
    ]
    edge, colour = (
        (_GUIDE_EDGE_WIDTH, layout.theme.lower_background),
        (_GUIDE_WIDTH, layout.theme.guide),
    )
    return [
        _stroke(Line(points, width * layout.line_width, stroke_colour), points, layout)
        for width, stroke_colour in (edge, colour)
        for points in lines
    ]


def arrow_polygons(geometry: Geometry, k: int, layout: Layout) -> list[Polygon]:
    """Arrows of forces at time ``t[k]``, in front of everything."""
    colour, polygons = layout.theme.force, []
    for arrow in geometry.arrows[k] if geometry.arrows else ():
        if np.any(layout.camera.to_camera(arrow)[:, 2] <= MIN_DEPTH):
            continue
        polygons.append(_stroke(Line(arrow, 2.2 * layout.line_width, colour), arrow, layout))
        (x0, y0), (x1, y1) = layout.camera.project(arrow, layout.viewport)[:, :2]
        length = np.hypot(x1 - x0, y1 - y0)
        if length > 0.0:
            direction = np.array([x1 - x0, y1 - y0]) / length
            head_length = min(7.0 * layout.line_width, length)
            side = 0.4 * head_length * np.array([-direction[1], direction[0]])
            tip, base = (
                np.array([x1, y1]) + 0.3 * head_length * direction,
                np.array([x1, y1]) - head_length * direction,
            )
            corners = np.array([tip, base + side, base - side])
            polygons.append(Polygon(corners, (*colour, 1.0), TRANSPARENT, 0.0))
    return polygons


def make_occluder(solid: Solid, pose: np.ndarray, polygons: list[Polygon]) -> Occluder:
    """Occluder of a solid at its link's pose (3, 4), from its painted polygons."""
    # The first polygon of a round solid contains all others.
    outlines = polygons if solid.kind == "faces" else polygons[:1]
    corners = np.concatenate([p.outline for p in outlines])
    rotation = pose[:, :3]
    half_axes = solid.radius * np.eye(3) if solid.kind == "capsule" else solid.half_axes
    return Occluder(
        axis=solid.axis @ rotation.T + pose[:, 3],
        half_thickness=solid.half_thickness,
        to_unit_ball=np.linalg.inv(half_axes) @ rotation.T,
        is_capsule=solid.kind == "capsule",
        bounds=np.concatenate([corners.min(axis=0), corners.max(axis=0)]),
        faces=_box_faces(solid, pose),
    )


def _box_faces(solid: Solid, pose: np.ndarray) -> BoxFaces | None:
    if solid.kind != "faces" or solid.smooth:
        return None
    corners = solid.points @ pose[:, :3].T + pose[:, 3]
    quads = np.array([corners[f] for f in solid.faces])
    normals = np.cross(quads[:, 1] - quads[:, 0], quads[:, 2] - quads[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return BoxFaces(normals, quads.mean(axis=1))


def solid_pose(solid: Solid, poses: np.ndarray) -> np.ndarray:
    """Pose (3, 4) of a solid's link, or of the world, from link poses (n_links, 3, 4)."""
    return np.eye(3, 4) if solid.link == WORLD else poses[solid.link]


def shadow_polygons(geometry: Geometry, k: int, layout: Layout) -> list[Polygon]:
    """Soft shadows on the floor: nested translucent outlines, fainter for higher solids.

    Those of a stage are a picture, :func:`stage_shadows`.
    """
    if layout.stage is not None:
        return []
    right, _, back = layout.camera.axes
    ray = np.array([0.10 * right[0] - 0.06 * back[0], 0.10 * right[1] - 0.06 * back[1], -1.0])
    polygons = []
    for solid in geometry.solids:
        pose = solid_pose(solid, geometry.poses[k])
        centre = pose[2, :3] @ solid.axis.mean(axis=0) + pose[2, 3]
        height = centre - geometry.floor
        if not np.isfinite(height) or height <= 0.0:
            continue
        outline = layout.camera.project(
            shadow_outline(solid, pose, geometry.floor, ray), layout.viewport
        )
        if np.any(outline[:, 2] <= MIN_DEPTH):
            continue
        strength = layout.theme.shadow_opacity / (1.0 + 2.2 * height / geometry.size)
        spread = 0.6 + 1.6 * min(1.0, height / geometry.size)
        colour = (*layout.theme.shadow, strength)
        polygons += [
            Polygon(
                outline[:, :2],
                colour,
                colour if w else TRANSPARENT,
                2.0 * w * spread * layout.line_width,
            )
            for w in _SHADOW_LAYERS
        ]
    return polygons


@dataclass(frozen=True)
class Line:
    """A string or spring to draw: points (n, 3) [m], width [px], colour (3,)."""

    points: np.ndarray
    width: float
    colour: np.ndarray


def string_lines(geometry: Geometry, k: int, layout: Layout) -> list[Line]:
    """Strings and springs at time ``t[k]``, except those behind the eye."""
    curves = []
    for string in geometry.string_curves(k):
        width = (1.75 if string.wire else 1.35) if string.taut else 0.95
        is_plain = layout.theme.thread is not None and string.colour is None
        width = _THREAD_WIDTH if is_plain else width
        curves.append((string.points, width, layout.string_colour(string)))
    steel = mix_colours(layout.theme.muted, layout.theme.text, 0.4)
    curves += [(_zigzag(ends[k], layout), 1.0, steel) for ends in geometry.springs]
    return [
        Line(_subdivided(points), width * layout.line_width, colour)
        for points, width, colour in curves
        if np.isfinite(points).all() and np.all(layout.camera.to_camera(points)[:, 2] > MIN_DEPTH)
    ]


def _stroke(line: Line, points: np.ndarray, layout: Layout) -> Polygon:
    """Outline (2 n, 2) of part of a line, lengthened by half a pixel at both ends."""
    pixels = layout.camera.project(points, layout.viewport)[:, :2]
    directions = np.diff(pixels, axis=0)
    directions /= np.maximum(np.hypot(directions[:, :1], directions[:, 1:]), 1e-9)
    pixels[0] -= 0.5 * directions[0]
    pixels[-1] += 0.5 * directions[-1]
    normals = np.column_stack([-directions[:, 1], directions[:, 0]])
    normals_before, normals_after = (
        np.vstack([normals[:1], normals]),
        np.vstack([normals, normals[-1:]]),
    )
    # The mean of a corner's normals, lengthened to keep the width, except in sharp bends.
    mean_normals = normals_before + normals_after
    mean_normals *= 1.0 / np.maximum(
        0.5 * np.sum(mean_normals * mean_normals, axis=1, keepdims=True), 0.6
    )
    side = 0.5 * line.width * mean_normals
    outline = np.vstack([pixels + side, (pixels - side)[::-1]])
    return Polygon(outline, (*line.colour, 1.0), TRANSPARENT, 0.0)


def _subdivided(points: np.ndarray, pieces: int = 40) -> np.ndarray:
    """The polyline with added points: no piece is longer than 1 / ``pieces`` of its length."""
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    max_length = max(float(lengths.sum()) / pieces, 1e-9)
    pieces_of_points = [points[:1]]
    for a, b, n in zip(
        points[:-1], points[1:], np.ceil(lengths / max_length).astype(int), strict=True
    ):
        pieces_of_points.append(a + np.linspace(0.0, 1.0, max(1, n) + 1)[1:, None] * (b - a))
    return np.concatenate(pieces_of_points)


def _zigzag(ends: np.ndarray, layout: Layout, turns: int = 9) -> np.ndarray:
    """Zigzag (n, 3) between two points, perpendicular to the line of sight [m]."""
    direction = ends[1] - ends[0]
    across = np.cross(direction, layout.camera.axes[2])
    size = np.linalg.norm(across)
    if size < 1e-9:
        return ends
    depth = max(float(layout.camera.to_camera(ends)[:, 2].mean()), 1e-6)
    across *= 4.0 * layout.line_width / layout.camera.scale(depth, layout.viewport) / size
    steps = np.linspace(0.12, 0.88, 2 * turns + 1)
    swing = np.where(np.arange(2 * turns + 1) % 2, 1.0, -1.0)
    swing[[0, -1]] = 0.0
    zigzag = ends[0] + steps[:, None] * direction + swing[:, None] * across
    return np.concatenate([ends[:1], zigzag, ends[1:]])
