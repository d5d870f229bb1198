"""Perspective camera that frames a whole motion.

Camera axes are right, up and back (towards the eye); depth is the distance from the eye into the
picture. Azimuth 0 looks at the geometry from +x, azimuth 90 deg from +y; a positive elevation looks
down on it.

A ball is a centre with a radius, which covers a part of the geometry.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

PRESETS = ("auto", "front", "side", "three-quarter")
"""Names of the points of view of :func:`point_of_view`."""

_PRESET_ANGLES = {
    "front": (0.0, np.radians(5.0)),
    "side": (0.5 * np.pi, np.radians(6.0)),
    "three-quarter": (-np.radians(32.0), np.radians(9.0)),
}
"""Azimuth relative to the front, and elevation [rad]."""

Depth = TypeVar("Depth", float, np.ndarray)

MAX_FLAT_SPREAD = 1e-3
"""Spread across a plane, relative to the size, below which a motion counts as flat."""


@dataclass(frozen=True)
class Viewport:
    """A rectangle of the picture, in pixels, with y upwards.

    Attributes:
        x, y: lower left corner [px].
        width, height: size [px].
    """

    x: float
    y: float
    width: float
    height: float

    @property
    def centre(self) -> tuple[float, float]:
        """Centre of the rectangle [px]."""
        return self.x + 0.5 * self.width, self.y + 0.5 * self.height

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top of the rectangle [px]."""
        return self.x, self.x + self.width, self.y, self.y + self.height


@dataclass(frozen=True)
class Camera:
    """Pinhole camera.

    Attributes:
        eye: (3,) position of the pinhole [m].
        axes: (3, 3) rows right, up, back.
        tangent: tangent of half the vertical field of view.
    """

    eye: np.ndarray
    axes: np.ndarray
    tangent: float

    def to_camera(self, points: np.ndarray) -> np.ndarray:
        """Points in camera axes with depth instead of back: (..., 3) world -> (..., 3) [m]."""
        camera_points = (points - self.eye) @ self.axes.T
        camera_points[..., 2] *= -1.0
        return camera_points

    def scale(self, depth: Depth, viewport: Viewport) -> Depth:
        """Pixels per metre at a depth [px/m]."""
        return 0.5 * viewport.height / (self.tangent * depth)

    def to_pixels(self, camera_points: np.ndarray, viewport: Viewport) -> np.ndarray:
        """Pixels of points in camera axes: (..., 3) [m] -> (..., 2) [px]."""
        scale = self.scale(camera_points[..., 2:], viewport)
        return camera_points[..., :2] * scale + viewport.centre

    def project(self, points: np.ndarray, viewport: Viewport) -> np.ndarray:
        """Pixels and depth: (..., 3) world [m] -> (..., 3) [px, px, m]."""
        camera_points = self.to_camera(np.asarray(points, dtype=float))
        return np.concatenate(
            [self.to_pixels(camera_points, viewport), camera_points[..., 2:]], axis=-1
        )

    def rays(self, pixels: np.ndarray, viewport: Viewport) -> np.ndarray:
        """Lines of sight through pixels: (..., 2) [px] -> (..., 3), one metre deep."""
        offset = (pixels - np.array(viewport.centre)) / self.scale(1.0, viewport)
        return offset @ self.axes[:2] - self.axes[2]


def camera_axes(azimuth: float, elevation: float) -> np.ndarray:
    """(3, 3) rows right, up, back of a camera at this azimuth and elevation [rad]."""
    ca, sa = np.cos(azimuth), np.sin(azimuth)
    ce, se = np.cos(elevation), np.sin(elevation)
    return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])


def fit_camera(
    points: np.ndarray,
    radii: np.ndarray,
    azimuth: float,
    elevation: float,
    aspect: float,
    field_of_view: float = np.radians(24.0),
    margin: float = 0.04,
) -> Camera:
    """Nearest camera on a line of sight that has every ball in the picture.

    A ball is in the picture if it lies on the inner side of four planes through the eye. Each
    condition is linear in the eye's position, which gives a closed-form solution.

    Args:
        points: (n, 3) centres [m].
        radii: (n,) radii [m].
        azimuth, elevation: line of sight [rad].
        aspect: width over height of the picture.
        field_of_view: vertical field of view [rad].
        margin: share of the picture left free on each side.
    """
    camera_rows = camera_axes(azimuth, elevation)
    local = points @ camera_rows.T
    tangent = np.tan(0.5 * field_of_view)
    offsets, distances = [], []
    for k, tan in ((0, tangent * aspect), (1, tangent)):
        tan *= 1.0 - 2.0 * margin
        spread = radii * np.hypot(1.0, tan)
        high = np.max(local[:, k] + local[:, 2] * tan + spread)
        low = np.max(-local[:, k] + local[:, 2] * tan + spread)
        offsets.append(0.5 * (high - low))
        distances.append(0.5 * (high + low) / tan)
    # Stay in front of the nearest ball.
    nearest = np.max(local[:, 2] + radii)
    distance = max(*distances, nearest + 0.05 * max(1e-3, float(np.ptp(local[:, :2])), radii.max()))
    return Camera(np.array([*offsets, distance]) @ camera_rows, camera_rows, float(tangent))


def point_of_view(
    view: str | tuple[float, float], points: np.ndarray, plane: str | None
) -> tuple[float, float]:
    """Azimuth and elevation [rad] of a preset, or of a pair given in degrees.

    Args:
        view: one of ``PRESETS``, or (azimuth, elevation) in degrees.
        points: (n, 3) points of the motion [m].
        plane: the puppet's mirror plane: it faces +x for ``xz`` and ``xy``, -y for ``yz``; for
            None the widest side is the front.
    """
    if not isinstance(view, str):
        azimuth, elevation = view
        return float(np.radians(azimuth)), float(np.radians(elevation))
    if view not in PRESETS:
        raise ValueError(f"there is no view {view!r}; the views are {', '.join(PRESETS)}")
    front, flat = _front_azimuth(points, plane)
    if view == "auto":
        view = "front" if flat else "three-quarter"
    azimuth_from_front, elevation = _PRESET_ANGLES[view]
    return front + azimuth_from_front, elevation


def _front_azimuth(points: np.ndarray, plane: str | None) -> tuple[float, bool]:
    """Azimuth of the motion's front [rad], and whether the motion is flat."""
    level = points[:, :2] - points[:, :2].mean(axis=0)
    size = float(np.ptp(points, axis=0).max())
    spreads, directions = np.linalg.eigh(level.T @ level / len(points))
    flat = bool(np.sqrt(max(spreads[0], 0.0)) < MAX_FLAT_SPREAD * max(size, 1e-12))
    if plane in ("xz", "xy"):
        return 0.0, flat
    if plane == "yz":
        return -0.5 * np.pi, flat
    normal = directions[:, 0]
    if np.sqrt(max(spreads[1], 0.0)) < MAX_FLAT_SPREAD * max(size, 1e-12):
        normal = np.array([0.0, 1.0])
    # The front is the side with +x to the right, or else with +y to the right.
    sign = -1.0 if (normal[1] > 1e-6 or (abs(normal[1]) <= 1e-6 and normal[0] < 0.0)) else 1.0
    return float(np.arctan2(sign * normal[1], sign * normal[0])), flat
