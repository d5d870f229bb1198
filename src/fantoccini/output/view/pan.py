"""The path of a film's camera that follows a puppet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fantoccini.output.view.geometry import Geometry


class _Following(NamedTuple):
    """When and how smoothly a camera follows."""

    smoothing: float = 0.6  # Width of the mean over the puppet's places [s]
    distance_ratio: float = 1.25
    """The camera follows where a fixed one would be this many times as far away."""


_FOLLOWING = _Following()


def camera_path(geometry: Geometry) -> np.ndarray:
    """(T, 3) smoothed horizontal displacement of the puppet's middle from its first place [m].

    The geometry's times are evenly spaced.
    """
    places = geometry.poses[:, :, :, 3]
    good = np.isfinite(places).all(axis=2, keepdims=True)
    middle = np.where(good, places, 0.0).sum(axis=1) / np.maximum(good.sum(axis=1), 1)
    middle[:, 2] = 0.0
    n, width = len(middle), _FOLLOWING.smoothing
    step = float(geometry.t[-1] - geometry.t[0]) / max(n - 1, 1)
    half = min(n - 1, int(2.0 * width / step)) if step > 0.0 else 0
    if half == 0:
        return middle - middle[0]
    weights = np.exp(-0.5 * (np.arange(-half, half + 1) * step / (0.5 * width)) ** 2)
    # Beyond both ends the motion is continued by point reflection.
    before, after = middle[half:0:-1], middle[::-1][1 : half + 1]
    longer = np.concatenate([2.0 * middle[0] - before, middle, 2.0 * middle[-1] - after])
    smooth = [np.convolve(x, weights / weights.sum(), mode="valid") for x in longer.T]
    path = np.column_stack(smooth)
    return path - path[0]


def pays_off(fixed: float, following: float) -> bool:
    """Whether a camera follows, from the distances [m] of a fixed and of a following one."""
    return fixed > _FOLLOWING.distance_ratio * following
