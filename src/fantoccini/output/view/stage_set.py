"""Look of a theatre: a curtain around the stage, a lit floor of boards, and darkness at the edges.

The curtain is a vertical cylinder around the motion, so that every camera sees it behind the
puppets.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fantoccini.output.view.camera import Camera, Viewport
from fantoccini.output.view.geometry import Geometry
from fantoccini.output.view.theme import DARK, mix_colours, rgb

LOOKS = ("diagram", "stage")
"""Looks of pictures: with title, time and tension scale, or as in a theatre."""

STAGE_THEME = replace(
    DARK,
    name="stage",
    upper_background=rgb("#0d0f14"),
    lower_background=rgb("#0d0f14"),
    shadow=rgb("#120a05"),
    shadow_opacity=0.085,
    text=rgb("#f3ead8"),
    outline=0.34,
    thread=rgb("#d9d0bf"),
)
"""Theme of the stage."""

_CURTAIN_COLOUR, _BOARD_COLOUR = rgb("#27505a"), rgb("#a8794c")
_PIXEL_SPACING = 3.0
"""Distance between the pixels for which the set is computed [px]."""
_HEIGHT_MARGIN, _WIDTH_MARGIN = 1.25, 0.6
"""Terms of the curtain's distance from the motion: shares of the height and of the width of the
motion."""
_FOLD_WIDTH, _BOARD_WIDTH = 0.16, 0.15
"""Width of a fold of the curtain and of a board, relative to the height of the motion."""
_SHADOW_OFFSET = (0.20, -0.30)
"""Displacement of shadows to the right and towards the first camera, relative to the height."""
_FOLD_DEPTH, _BOARD_CONTRAST = 0.30, 0.07
"""Darkening in the folds, and difference between boards, relative to the brightness."""


@dataclass(frozen=True, eq=False)
class StageSet:
    """Curtain and floor of a stage.

    Attributes:
        middle: (2,) middle of the stage [m].
        floor: height of the floor [m].
        height: height of the puppets above it [m].
        radius: distance of the curtain from the middle [m].
        across_boards: (2,) direction across the boards.
        light_direction: (3,) direction of the light.
    """

    middle: np.ndarray
    floor: float
    height: float
    radius: float
    across_boards: np.ndarray
    light_direction: np.ndarray

    @classmethod
    def around_motion(cls, geometry: Geometry, camera: Camera) -> StageSet:
        """Set around a whole motion, with boards that run towards a camera."""
        centres, radii = geometry.balls(strings=False)
        low, high = centres.min(axis=0), centres.max(axis=0)
        height = max(float(np.max(centres[:, 2] + radii)) - geometry.floor, 1e-6)
        width = float(np.hypot(*(high - low)[:2]))
        radius = 0.5 * width + _HEIGHT_MARGIN * height + _WIDTH_MARGIN * width
        right = camera.axes[0]
        back = np.array([right[1], -right[0], 0.0])  # level, towards the camera
        ray = _SHADOW_OFFSET[0] * right + _SHADOW_OFFSET[1] * back - [0.0, 0.0, 1.0]
        return cls(0.5 * (low + high)[:2], geometry.floor, height, radius, right[:2], ray)

    def pixels(self, camera: Camera, viewport: Viewport, frame: Viewport) -> np.ndarray:
        """(rows, columns, 3) pixels of the empty set in a frame, from the bottom up.

        Args:
            camera, viewport: the view.
            frame: rectangle of the picture to fill.
        """
        x = frame.x + np.linspace(0.0, frame.width, 2 + int(frame.width / _PIXEL_SPACING))
        y = frame.y + np.linspace(0.0, frame.height, 2 + int(frame.height / _PIXEL_SPACING))
        rays = camera.rays(np.stack(np.meshgrid(x, y), axis=-1), viewport)
        with np.errstate(divide="ignore", invalid="ignore"):
            to_floor = (self.floor - camera.eye[2]) / rays[..., 2]
        to_curtain = self.curtain_depth(camera.eye, rays)
        is_floor = (to_floor > 0.0) & (to_floor < to_curtain)
        points = camera.eye + np.where(is_floor, to_floor, to_curtain)[..., None] * rays
        colours = np.where(is_floor[..., None], self._boards(points), self._curtain(points))
        return np.clip(colours, 0.0, 1.0)

    def curtain_depth(self, eye: np.ndarray, rays: np.ndarray) -> np.ndarray:
        """Depth (...) at which rays (..., 3) meet the far side of the cylinder [m].

        A ray that misses the cylinder gets the depth of its point nearest to the axis.
        """
        start, level = eye[:2] - self.middle, rays[..., :2]
        a = np.maximum(np.sum(level * level, axis=-1), 1e-12)
        b = level @ start
        discriminant = np.maximum(b * b - a * (start @ start - self.radius**2), 0.0)
        return np.asarray((-b + np.sqrt(discriminant)) / a)

    def _boards(self, points: np.ndarray) -> np.ndarray:
        """Colours (..., 3) of points (..., 3) of the floor: boards in a pool of light."""
        offset = points[..., :2] - self.middle
        distance = np.linalg.norm(offset, axis=-1) / self.radius
        board = np.floor(offset @ self.across_boards / (_BOARD_WIDTH * self.height))
        shade = np.modf(np.sin(12.9898 * board) * 43758.5453)[0]
        light = 0.10 + 1.02 * np.exp(-((distance / 0.62) ** 2))
        light *= 1.0 - _BOARD_CONTRAST * shade
        # The floor is dark at the foot of the curtain, which hides the edge between the two.
        light *= _smooth_step((1.0 - distance) / 0.22) * 0.9 + 0.1
        return light[..., None] * _BOARD_COLOUR

    def _curtain(self, points: np.ndarray) -> np.ndarray:
        """Colours (..., 3) of points (..., 3) of the curtain: folds, lit from in front."""
        offset = points[..., :2] - self.middle
        angle = np.arctan2(offset[..., 1], offset[..., 0])
        count = max(3, round(2.0 * np.pi * self.radius / (_FOLD_WIDTH * self.height)))
        phase = count * angle + 1.3 * np.sin(np.round(0.29 * count) * angle)
        fold = 0.5 + 0.5 * np.cos(phase)
        up = (points[..., 2] - self.floor) / self.height
        light = 0.08 + 0.92 * _smooth_step(up / 0.75) * np.exp(
            -((np.maximum(up - 0.75, 0.0) / 1.1) ** 2)
        )
        light *= 1.0 - _FOLD_DEPTH * (1.0 - fold)
        # Folds catch the warm light of the stage on their ridges.
        warm = mix_colours(_CURTAIN_COLOUR, rgb("#8a7f6a"), 0.18 * fold[..., None] ** 3)
        return light[..., None] * warm


def puppet_viewport(frame: Viewport, captions_height: float = 0.0) -> Viewport:
    """Rectangle for the puppets in a frame, with room for their strings above.

    Args:
        frame: the whole picture.
        captions_height: height to leave free below, for captions [px].
    """
    side, bottom_margin, top_margin = (
        0.05 * frame.width,
        0.07 * frame.height + captions_height,
        0.16 * frame.height,
    )
    height = frame.height - bottom_margin - top_margin
    return Viewport(frame.x + side, frame.y + bottom_margin, frame.width - 2.0 * side, height)


def vignette(frame: Viewport) -> np.ndarray:
    """(rows, columns, 4) black pixels, opaque at the top and in the corners of a frame."""
    x = np.linspace(-1.0, 1.0, 2 + int(frame.width / _PIXEL_SPACING))
    y = np.linspace(-1.0, 1.0, 2 + int(frame.height / _PIXEL_SPACING))[:, None]
    corners = 0.55 * _smooth_step((np.hypot(x, y) - 0.75) / 0.75)
    top = 0.92 * _smooth_step((y - 0.62) / 0.40)
    pixels = np.zeros((len(y), len(x), 4))
    pixels[..., :3] = STAGE_THEME.upper_background
    pixels[..., 3] = 1.0 - (1.0 - corners) * (1.0 - top)
    return pixels


def _smooth_step(share: np.ndarray) -> np.ndarray:
    """Smooth step from 0 (below 0) to 1 (above 1)."""
    s = np.clip(share, 0.0, 1.0)
    return np.asarray(s * s * (3.0 - 2.0 * s))
