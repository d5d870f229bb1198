"""Smoothing of recorded motion by a moving average over ticks.

A tick is the interval at which a performance advances; n_vK is the number of driven velocities.
"""

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
    for q_index, _ in table.quaternions_K:
        path[:, q_index : q_index + 4] = rotation.continuous(q[:, q_index : q_index + 4])
    path = _averaged(path, max(1, round(seconds / tick)))
    rate = np.empty_like(v)
    double_tick = 2.0 * tick
    for q_index, v_index in table.scalars_K:
        rate[1:-1, v_index] = (path[2:, q_index] - path[:-2, q_index]) / double_tick
    for q_index, v_index in table.quaternions_K:
        quaternions = rotation.normalised(path[:, q_index : q_index + 4])
        rate[1:-1, v_index : v_index + 3] = (
            rotation.between(quaternions[:-2], quaternions[2:]) / double_tick
        )
    rate[0], rate[-1] = v[0], v[-1]
    return np.diff(rate, axis=0) / tick


def _averaged(path: Array, max_half: int) -> Array:
    """Hann's average over up to ``max_half`` ticks to either side; at the ends, no average.

    In between the window widens smoothly: a kink in its width would be a step in velocity.
    """
    n = len(path) - 1
    averaged = path.copy()
    for i in range(1, n):
        n_near = min(i, n - i, 2 * max_half)
        # Its slope is 1 at the ends, and 0 where it is `max_half`.
        width = n_near - 0.25 * n_near**2 / max_half
        half = min(int(width) + 1, n_near)
        weight = np.cos(0.5 * np.pi * np.arange(-half, half + 1) / (width + 1.0)) ** 2
        averaged[i] = weight @ path[i - half : i + half + 1] / weight.sum()
    return averaged
