"""How a film's camera goes along with a puppet that walks."""

from __future__ import annotations

import numpy as np

from fantoccini.view.scene import Scene

_SMOOTH = 0.6
"""The camera follows a mean over about so long [s]."""
_SMALLER = 1.25
"""A still camera that has to be so many times as far away, to frame all of a motion, goes along."""


def pan(scene: Scene) -> np.ndarray:
    """Where the middle of a puppet goes, smoothly.

    Args:
        scene: at even times.

    Returns:
        (T, 3) from where it is at first, level [m].
    """
    places = scene.poses[:, :, :, 3]
    good = np.isfinite(places).all(axis=2, keepdims=True)
    middle = np.where(good, places, 0.0).sum(axis=1) / np.maximum(good.sum(axis=1), 1)
    middle[:, 2] = 0.0
    n = len(middle)
    step = float(scene.t[-1] - scene.t[0]) / max(n - 1, 1)
    half = min(n - 1, int(2.0 * _SMOOTH / step)) if step > 0.0 else 0
    if half == 0:
        return middle - middle[0]
    weights = np.exp(-0.5 * (np.arange(-half, half + 1) * step / (0.5 * _SMOOTH)) ** 2)
    # Beyond both ends it goes on as it came, turned about its end.
    before, after = middle[half:0:-1], middle[::-1][1 : half + 1]
    longer = np.concatenate([2.0 * middle[0] - before, middle, 2.0 * middle[-1] - after])
    smooth = [np.convolve(x, weights / weights.sum(), mode="valid") for x in longer.T]
    path = np.column_stack(smooth)
    return path - path[0]


def walks(still: float, along: float) -> bool:
    """Whether a camera goes along.

    Args:
        still: distance from which a still camera frames all of the motion [m].
        along: distance from which one does that goes along [m].
    """
    return still > _SMALLER * along
