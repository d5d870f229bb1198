"""Soft shadows on the floor of a stage, as one picture: overlapping shadows do not add up.

A sample is one saved instant of the motion. A solid is a shape of a body or an obstacle.
"""

from __future__ import annotations

import numpy as np

from fantoccini.output.view.camera import Viewport
from fantoccini.output.view.compose import MIN_DEPTH, Layout, solid_pose
from fantoccini.output.view.geometry import Geometry
from fantoccini.output.view.silhouettes import shadow_outline

_PIXEL_SPACING = 2.0
"""Distance between the pixels of shadows [px]."""
_LEVELS = (0.0, 0.12, 0.35, 0.7)
"""Heights above the floor, relative to that of the motion, from which shadows are softer."""
_STRENGTH, _FADE = 0.72, 1.5
"""Opacity of shadows on the floor, and their decrease with the relative height."""
_SOFTNESS = (0.006, 0.035)
"""Standard deviation of a shadow's edge on the floor, and its increase with the relative height,
relative to the height of the motion."""
_BLANK = np.zeros((1, 1, 4))


def stage_shadows(geometry: Geometry, k: int, layout: Layout, frame: Viewport) -> np.ndarray:
    """(rows, columns, 4) pixels of all shadows of sample k in a frame, from the bottom up.

    A single clear pixel if nothing has a shadow in front of the camera.
    """
    from PIL import Image, ImageDraw
    from scipy.ndimage import gaussian_filter

    stage = layout.stage
    assert stage is not None
    size = max(1, round(frame.width / _PIXEL_SPACING)), max(1, round(frame.height / _PIXEL_SPACING))
    outlines: dict[int, list[np.ndarray]] = {}
    for solid in geometry.solids:
        pose = solid_pose(solid, geometry.poses[k])
        height = float(pose[2, :3] @ solid.axis.mean(axis=0) + pose[2, 3] - stage.floor)
        if not np.isfinite(height) or height <= 0.0:
            continue
        outline = shadow_outline(solid, pose, stage.floor, stage.light_direction)
        projected = layout.camera.project(outline, layout.viewport)
        if np.all(projected[:, 2] > MIN_DEPTH):
            level = int(np.searchsorted(_LEVELS, height / stage.height, side="right")) - 1
            outlines.setdefault(level, []).append(
                (projected[:, :2] - [frame.x, frame.y]) / _PIXEL_SPACING
            )
    if not outlines:
        return _BLANK
    depth = float(layout.camera.to_camera(np.append(stage.middle, stage.floor))[2])
    pixels_per_height = layout.camera.scale(max(depth, MIN_DEPTH), layout.viewport) / _PIXEL_SPACING
    pixels_per_height *= stage.height
    light = np.ones(size[::-1])
    for level, polygons in outlines.items():
        picture = Image.new("L", size)
        draw = ImageDraw.Draw(picture)
        for polygon in polygons:
            draw.polygon([tuple(corner) for corner in polygon.tolist()], fill=255)
        level_height = _LEVELS[level]
        softness = (_SOFTNESS[0] + _SOFTNESS[1] * level_height) * pixels_per_height
        mask = gaussian_filter(np.asarray(picture, dtype=np.float32) / 255.0, softness)
        light *= 1.0 - _STRENGTH / (1.0 + _FADE * level_height) * mask
    pixels = np.zeros((*light.shape, 4))
    pixels[..., :3], pixels[..., 3] = layout.theme.shadow, 1.0 - light
    return pixels
