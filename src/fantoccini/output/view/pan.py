"""Path of a film camera that follows a puppet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fantoccini.output.view.geometry import Geometry


class _CameraFollowing(NamedTuple):
    """Smoothing of the path, and threshold for following."""

    smoothing: float = 0.6  # Width of the moving average [s]
    distance_ratio: float = 1.25
    """Ratio of distances, fixed to following camera, above which the camera follows."""


_FOLLOWING = _CameraFollowing()


def camera_path(geometry: Geometry) -> np.ndarray:
    """(T, 3) smoothed horizontal displacement of the puppet's middle from its start [m].

    The geometry's times must be evenly spaced.
    """
    positions = geometry.poses[:, :, :, 3]
    finite = np.isfinite(positions).all(axis=2, keepdims=True)
    middle = np.where(finite, positions, 0.0).sum(axis=1) / np.maximum(finite.sum(axis=1), 1)
    middle[:, 2] = 0.0
    path = moving_average(geometry.t, middle, _FOLLOWING.smoothing)
    return path - path[0]


def moving_average(t: np.ndarray, positions: np.ndarray, width: float) -> np.ndarray:
    """(T, 3) moving average of places (T, 3) at evenly spaced times (T,), ``width`` wide [s].

    Beyond its ends, the motion is extended by point reflection.
    """
    n = len(positions)
    step = float(t[-1] - t[0]) / max(n - 1, 1)
    n_half = min(n - 1, int(2.0 * width / step)) if step > 0.0 else 0
    if n_half == 0:
        return np.array(positions)
    weights = np.exp(-0.5 * (np.arange(-n_half, n_half + 1) * step / (0.5 * width)) ** 2)
    mirrored_head, mirrored_tail = positions[n_half:0:-1], positions[::-1][1 : n_half + 1]
    extended = np.concatenate(
        [2.0 * positions[0] - mirrored_head, positions, 2.0 * positions[-1] - mirrored_tail]
    )
    smooth = [np.convolve(x, weights / weights.sum(), mode="valid") for x in extended.T]
    return np.column_stack(smooth)


def should_follow(fixed: float, following: float) -> bool:
    """Whether a camera should follow, given the distances [m] of a fixed and a following camera."""
    return fixed > _FOLLOWING.distance_ratio * following
