"""Smoothing of recorded motion by a moving average over ticks."""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, check_positive, rotation
from fantoccini.motion import Input


def smoothed(inputs: Input, n: int, tick: float, seconds: float) -> Array:
    """(n, n_vK) accelerations of hands on averaged paths; see :meth:`Recording.smoothed`.

    Each driven coordinate is averaged with Hann's window, which narrows towards the ends, where
    position and velocity are unchanged. The velocities of the averaged path, by central
    differences, are joined by constant accelerations.

    Args:
        inputs: motion of the hands.
        n: number of ticks.
        tick: duration of a tick [s].
        seconds: width of the average [s].
    """
    check_positive(seconds=seconds)
    table = inputs.coordinates
    q, v, _ = inputs.evaluate(inputs.start + tick * np.arange(n + 1, dtype=float))
    # An input is at rest from its end on; take the velocity just before.
    v[-1] = inputs.evaluate(np.nextafter(inputs.end, 0.0))[1]
    path = q.copy()
    for place, _ in table.quaternions_K:
        path[:, place : place + 4] = rotation.continuous(q[:, place : place + 4])
    path = _averaged(path, max(1, round(seconds / tick)))
    rate = np.empty_like(v)
    two = 2.0 * tick
    for place, at in table.scalars_K:
        rate[1:-1, at] = (path[2:, place] - path[:-2, place]) / two
    for place, at in table.quaternions_K:
        turn = rotation.normalised(path[:, place : place + 4])
        rate[1:-1, at : at + 3] = rotation.between(turn[:-2], turn[2:]) / two
    rate[0], rate[-1] = v[0], v[-1]
    return np.diff(rate, axis=0) / tick


def _averaged(path: Array, max_half: int) -> Array:
    """Hann's average over up to ``max_half`` ticks to either side; at the ends, no average.

    In between the window widens smoothly: a kink in its width would be a step in velocity.
    """
    n = len(path) - 1
    out = path.copy()
    for i in range(1, n):
        near = min(i, n - i, 2 * max_half)
        width = near - 0.25 * near**2 / max_half  # slope 1 at the ends, 0 where it is `max_half`
        half = min(int(width) + 1, near)
        weight = np.cos(0.5 * np.pi * np.arange(-half, half + 1) / (width + 1.0)) ** 2
        out[i] = weight @ path[i - half : i + half + 1] / weight.sum()
    return out
