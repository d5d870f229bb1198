"""One time of a scene as polygons in the order of painting: shadows, then solids and strings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.tree import WORLD
from fantoccini.view.camera import Camera, Viewport
from fantoccini.view.order import Occluder, Run, Sides, painting_order
from fantoccini.view.scene import Scene, Thread
from fantoccini.view.silhouettes import Polygon, Solid, paint, shadow
from fantoccini.view.theme import Theme, mix

_CLEAR = (0.0, 0.0, 0.0, 0.0)
_SHADOW_LAYERS = (9.0, 6.0, 3.5, 1.2, 0.0)
"""Widths of the nested outlines that soften a shadow's edge, in pens."""


@dataclass(frozen=True)
class Stage:
    """How scenes are put into pixels.

    Attributes:
        camera, viewport: the view, and the rectangle of the picture it fills.
        theme: the look.
        pen: width of an outline [px].
        top: upper end of the tension scale [N].
        colours: (256, 3) of the tension scale.
        handles: beads and hooks on held string ends.
    """

    camera: Camera
    viewport: Viewport
    theme: Theme
    pen: float
    top: float
    colours: np.ndarray
    handles: tuple[Solid, ...]

    def thread_colour(self, thread: Thread) -> np.ndarray:
        """Colour (3,) of a string by its mode and tension."""
        if not thread.taut:
            return self.theme.slack
        if thread.tension is None or not np.isfinite(thread.tension):
            return self.theme.ink if thread.colour is None else thread.colour
        share = np.clip(abs(thread.tension) / self.top, 0.0, 1.0)
        return self.colours[int(share * (len(self.colours) - 1))]


def compose(scene: Scene, k: int, stage: Stage) -> list[Polygon]:
    """The polygons of the scene at time ``t[k]``, in the order of painting.

    Args:
        scene: what to draw.
        k: index of the time.
        stage: how.
    """
    camera, viewport = stage.camera, stage.viewport
    poses = scene.poses[k]
    solids = [*scene.solids, *stage.handles]
    placed = [_placed(solid, poses) for solid in solids]
    kept = [i for i, pose in enumerate(placed) if np.isfinite(pose).all()]
    painted = [paint(solids[i], placed[i], camera, viewport, stage.theme, stage.pen) for i in kept]
    kept = [(i, p) for i, p in zip(kept, painted, strict=True) if p]

    occluders = [occluder(solids[i], placed[i], polygons) for i, polygons in kept]
    hung = lines(scene, k, stage)
    out = shadows(scene, k, stage)
    for item in painting_order(camera, viewport, occluders, [line.points for line in hung]):
        if isinstance(item, Run):
            line = hung[item.thread]
            out.append(_stroke(line, line.points[item.start : item.stop + 1], stage))
        else:
            out += kept[item][1]
    return out


def occluder(solid: Solid, pose: np.ndarray, polygons: list[Polygon]) -> Occluder:
    """What the order needs to know of a solid on a link's pose (3, 4), painted so."""
    # The first polygon of a round solid holds all the others.
    shown = polygons if solid.kind == "faces" else polygons[:1]
    corners = np.concatenate([p.outline for p in shown])
    turn = pose[:, :3]
    half = solid.radius * np.eye(3) if solid.kind == "capsule" else solid.half
    return Occluder(
        axis=solid.axis @ turn.T + pose[:, 3],
        girth=solid.girth,
        unit=np.linalg.inv(half) @ turn.T,
        slides=solid.kind == "capsule",
        bounds=np.concatenate([corners.min(axis=0), corners.max(axis=0)]),
        link=solid.link,
        sides=_sides(solid, pose),
    )


def _sides(solid: Solid, pose: np.ndarray) -> Sides | None:
    if solid.kind != "faces" or solid.smooth:
        return None
    corners = solid.points @ pose[:, :3].T + pose[:, 3]
    quads = np.array([corners[f] for f in solid.faces])
    normals = np.cross(quads[:, 1] - quads[:, 0], quads[:, 2] - quads[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Sides(normals, quads.mean(axis=1))


def _placed(solid: Solid, poses: np.ndarray) -> np.ndarray:
    return np.eye(3, 4) if solid.link == WORLD else poses[solid.link]


def shadows(scene: Scene, k: int, stage: Stage) -> list[Polygon]:
    """Soft shadows on the floor: nested translucent outlines, fainter from higher solids."""
    right, _, back = stage.camera.axes
    ray = np.array([0.10 * right[0] - 0.06 * back[0], 0.10 * right[1] - 0.06 * back[1], -1.0])
    out = []
    for solid in scene.solids:
        pose = _placed(solid, scene.poses[k])
        centre = pose[2, :3] @ solid.axis.mean(axis=0) + pose[2, 3]
        height = centre - scene.floor
        if not np.isfinite(height) or height <= 0.0:
            continue
        outline = stage.camera.project(shadow(solid, pose, scene.floor, ray), stage.viewport)
        if np.any(outline[:, 2] <= 1e-6):
            continue
        strength = stage.theme.shadow_opacity / (1.0 + 2.2 * height / scene.size)
        spread = 0.6 + 1.6 * min(1.0, height / scene.size)
        colour = (*stage.theme.shadow, strength)
        out += [
            Polygon(outline[:, :2], colour, colour if w else _CLEAR, 2.0 * w * spread * stage.pen)
            for w in _SHADOW_LAYERS
        ]
    return out


@dataclass(frozen=True)
class Line:
    """A string or spring to be stroked: points (n, 3) [m], width [px], colour (3,)."""

    points: np.ndarray
    width: float
    colour: np.ndarray


def lines(scene: Scene, k: int, stage: Stage) -> list[Line]:
    """The strings and springs of the scene at time ``t[k]``; those behind the eye left out."""
    drawn = []
    for thread in scene.threads(k):
        width = (1.75 if thread.wire else 1.35) if thread.taut else 0.95
        drawn.append((thread.points, width, stage.thread_colour(thread)))
    steel = mix(stage.theme.faint, stage.theme.ink, 0.4)
    drawn += [(_coil(ends[k], stage), 1.0, steel) for ends in scene.springs]
    return [
        Line(_refined(points), width * stage.pen, colour)
        for points, width, colour in drawn
        if np.isfinite(points).all() and np.all(stage.camera.see(points)[:, 2] > 1e-6)
    ]


def _stroke(line: Line, points: np.ndarray, stage: Stage) -> Polygon:
    """The polygon (2 n, 2) of a polyline of the line's width, half a pixel longer at both ends."""
    placed = stage.camera.project(points, stage.viewport)[:, :2]
    along = np.diff(placed, axis=0)
    along /= np.maximum(np.hypot(along[:, :1], along[:, 1:]), 1e-9)
    placed[0] -= 0.5 * along[0]
    placed[-1] += 0.5 * along[-1]
    normals = np.column_stack([-along[:, 1], along[:, 0]])
    before, after = np.vstack([normals[:1], normals]), np.vstack([normals, normals[-1:]])
    # At a corner the two normals' mean, lengthened so that the width is kept; not in a hairpin.
    mean = before + after
    mean *= 1.0 / np.maximum(0.5 * np.sum(mean * mean, axis=1, keepdims=True), 0.6)
    side = 0.5 * line.width * mean
    outline = np.vstack([placed + side, (placed - side)[::-1]])
    return Polygon(outline, (*line.colour, 1.0), _CLEAR, 0.0)


def _refined(points: np.ndarray, pieces: int = 40) -> np.ndarray:
    """Adds points, so that no piece is longer than a part of the whole."""
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    limit = max(float(lengths.sum()) / pieces, 1e-9)
    parts = [points[:1]]
    for a, b, n in zip(points[:-1], points[1:], np.ceil(lengths / limit).astype(int), strict=True):
        parts.append(a + np.linspace(0.0, 1.0, max(1, n) + 1)[1:, None] * (b - a))
    return np.concatenate(parts)


def _coil(ends: np.ndarray, stage: Stage, turns: int = 9) -> np.ndarray:
    """A zigzag (n, 3) between two points, across the line of sight [m]."""
    along = ends[1] - ends[0]
    across = np.cross(along, stage.camera.axes[2])
    size = np.linalg.norm(across)
    if size < 1e-9:
        return ends
    depth = max(float(stage.camera.see(ends)[:, 2].mean()), 1e-6)
    across *= 4.0 * stage.pen / stage.camera.scale(depth, stage.viewport) / size
    steps = np.linspace(0.12, 0.88, 2 * turns + 1)
    swing = np.where(np.arange(2 * turns + 1) % 2, 1.0, -1.0)
    swing[[0, -1]] = 0.0
    middle = ends[0] + steps[:, None] * along + swing[:, None] * across
    return np.concatenate([ends[:1], middle, ends[1:]])
