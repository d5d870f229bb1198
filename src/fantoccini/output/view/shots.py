"""Cameras of a film from the shots of a play: cuts, and smooth moves from one shot to the next.

A shot is a time of the film with one aim of its camera. A link is a body on its joint. A solid is a
shape of a body or an obstacle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.base import polynomial
from fantoccini.model.tree import WORLD
from fantoccini.output.view.camera import Camera, camera_axes, fit_camera
from fantoccini.output.view.compose import Layout
from fantoccini.output.view.geometry import Geometry
from fantoccini.output.view.pan import moving_average
from fantoccini.output.view.silhouettes import Solid

if TYPE_CHECKING:
    from fantoccini.theatre.plays import Shot

_SMOOTHING = 1.6
"""Width of the moving average of the place that a camera follows [s]: puppets swing."""
_TIME_TOLERANCE = 1e-9
"""Time by which a frame may precede a cut and still show the new shot [s]."""


@dataclass(frozen=True)
class _Aims:
    """Aims of cameras over time.

    Attributes:
        focus: (T, 3) point in the middle of the picture [m].
        azimuth, elevation: (T,) direction from which it is seen [rad].
        log_distance: (T,) logarithm of the distance of the eye from the focus [m].
    """

    focus: np.ndarray
    azimuth: np.ndarray
    elevation: np.ndarray
    log_distance: np.ndarray

    def blended(self, other: _Aims, share: np.ndarray) -> _Aims:
        """Aims between these (share 0) and others (share 1), for shares (T,)."""
        turn = np.remainder(other.azimuth - self.azimuth + np.pi, 2.0 * np.pi) - np.pi
        return _Aims(
            self.focus + share[:, None] * (other.focus - self.focus),
            self.azimuth + share * turn,
            self.elevation + share * (other.elevation - self.elevation),
            self.log_distance + share * (other.log_distance - self.log_distance),
        )


def shot_cameras(
    geometry: Geometry, layout: Layout, shots: Sequence[Shot], strings: bool
) -> list[Camera]:
    """Camera of every sample of a motion; equal ones in a row are the same object.

    Args:
        geometry: motion, at evenly spaced times.
        layout: layout of the shot before the first one, which shows the whole motion.
        shots: shots in order of their times.
        strings: whether strings must be in the picture of the whole motion.
    """
    n, motion_balls = len(geometry.t), geometry.with_shadows(*geometry.balls(strings))
    aims = _fixed_aims(layout.camera, motion_balls[0].mean(axis=0), n)
    ends = [*(shot.t + shot.over for shot in shots[1:]), float(geometry.t[-1])]
    for shot, end in zip(shots, ends, strict=True):
        share = _progress(geometry.t, shot.t, shot.over)
        if np.any(share):
            aims = aims.blended(_shot_aims(geometry, layout, shot, end, motion_balls), share)
    cameras = [_camera(aims, k, layout.camera) for k in range(n)]
    for k, (before, camera) in enumerate(pairwise([layout.camera, *cameras])):
        same = np.allclose(before.eye, camera.eye, rtol=0.0, atol=1e-9) and np.allclose(
            before.axes, camera.axes, rtol=0.0, atol=1e-9
        )
        cameras[k] = cameras[k - 1] if same and k else layout.camera if same else camera
    return cameras


def _progress(t: np.ndarray, begin: float, duration: float) -> np.ndarray:
    """(T,) completed share of a move at times (T,); 0 or 1 for a cut, which takes no time."""
    if duration <= 0.0:
        return np.where(t >= begin - _TIME_TOLERANCE, 1.0, 0.0)
    s = np.clip((t - begin) / duration, 0.0, 1.0)
    return polynomial.minimum_jerk(s)[0]


def _shot_aims(
    geometry: Geometry,
    layout: Layout,
    shot: Shot,
    end: float,
    motion_balls: tuple[np.ndarray, np.ndarray],
) -> _Aims:
    """Aims of a shot; at zoom 1 its target just fills the picture until the time ``end`` [s].

    The balls ``motion_balls`` cover the whole motion.
    """
    t = geometry.t
    samples = np.flatnonzero((t >= shot.t - _TIME_TOLERANCE) & (t <= end + _TIME_TOLERANCE))
    samples = samples if len(samples) else np.array([int(np.argmin(np.abs(t - shot.t)))])
    solids = _shot_solids(geometry, shot)
    if solids:
        path = _smoothed_path(geometry, solids, samples)
        shot_geometry = replace(
            geometry, solids=solids, t=t[samples], poses=geometry.poses[samples], guides=()
        )
        centres, radii = shot_geometry.balls(strings=False, pan=path[samples])
    elif shot.place is None:
        path = np.zeros((len(t), 3))
        centres, radii = motion_balls
    else:
        size = 0.5 * _height(geometry)
        x, y, *z = shot.place
        path = np.tile([x, y, z[0] if z else geometry.floor + size], (len(t), 1))
        centres, radii = np.zeros((1, 3)), np.array([size])
    aspect = layout.viewport.width / layout.viewport.height
    camera = fit_camera(centres, radii, shot.azimuth, shot.elevation, aspect)
    aims = _fixed_aims(camera, centres.mean(axis=0), len(t))
    return replace(
        aims, focus=path + aims.focus, log_distance=aims.log_distance - np.log(shot.zoom)
    )


def _fixed_aims(camera: Camera, target: np.ndarray, n: int) -> _Aims:
    """Aims of a fixed camera for n samples; the focus is at the depth of a point (3,)."""
    back = camera.axes[2]
    distance = max(float((camera.eye - target) @ back), 1e-6)
    azimuth, elevation = np.arctan2(back[1], back[0]), np.arcsin(np.clip(back[2], -1.0, 1.0))
    if np.hypot(back[0], back[1]) < 1e-9:  # seen from straight above or below
        azimuth = np.arctan2(-camera.axes[0, 0], camera.axes[0, 1])
    return _Aims(
        np.tile(camera.eye - distance * back, (n, 1)),
        np.full(n, azimuth),
        np.full(n, elevation),
        np.full(n, np.log(distance)),
    )


def _camera(aims: _Aims, k: int, template: Camera) -> Camera:
    rows = camera_axes(float(aims.azimuth[k]), float(aims.elevation[k]))
    return replace(template, eye=aims.focus[k] + np.exp(aims.log_distance[k]) * rows[2], axes=rows)


def _shot_solids(geometry: Geometry, shot: Shot) -> tuple[Solid, ...]:
    """Solids of the bodies in a shot; () for the whole motion or a place."""
    links = {k for k, link in enumerate(geometry.tree.links) if link.name in shot.bodies}
    return tuple(solid for solid in geometry.solids if solid.link in links)


def _smoothed_path(
    geometry: Geometry, solids: tuple[Solid, ...], samples: np.ndarray
) -> np.ndarray:
    """(T, 3) smoothed middle of solids [m], at its mean height over the samples ``samples``."""
    middles = []
    for solid in solids:
        pose = geometry.poses[:, solid.link]
        middles.append(pose[..., :3] @ solid.axis.mean(axis=0) + pose[..., 3])
    finite = np.isfinite(middles).all(axis=2, keepdims=True)
    n_finite = np.maximum(finite.sum(axis=0), 1)
    middle = np.where(finite, middles, 0.0).sum(axis=0) / n_finite
    path = moving_average(geometry.t, middle, _SMOOTHING)
    path[:, 2] = np.mean(middle[samples, 2])
    return path


def _height(geometry: Geometry) -> float:
    """Height of the motion above the floor, without obstacles and strings [m]."""
    moving = tuple(solid for solid in geometry.solids if solid.link != WORLD)
    centres, radii = replace(geometry, solids=moving).balls(strings=False)
    return max(float(np.max(centres[:, 2] + radii)) - geometry.floor, 1e-6)
