"""Edits of recordings: other inputs for the same puppet, tick by tick, velocities continuous."""

from __future__ import annotations

import math

import numpy as np

from fantoccini.arrays import Array
from fantoccini.motion import rotation
from fantoccini.perform import change
from fantoccini.perform.recording import Recording


def trimmed(recording: Recording, a: float, b: float) -> Recording:
    """The ticks between two times; see :meth:`Recording.trimmed`."""
    if not 0.0 <= a < b <= recording.duration * (1.0 + 1e-9):
        raise ValueError(
            f"found {a} s to {b} s; it must be a part of 0 s to {recording.duration:g} s"
        )
    trajectory = recording.trajectory
    first, last = (round(t / recording.tick) for t in (a, b))
    last = min(last, len(trajectory) - 1)
    if last <= first:
        raise ValueError(f"there is no tick of {recording.tick:g} s from {a} s to {b} s")
    start = recording.start
    if first:
        x = trajectory.state(first).replace(t=0.0)
        start = change.permitted(recording.marionette, x)
    return recording.edited(start=start, acc_K=recording.acc_K[first:last])


def stretched(recording: Recording, factor: float) -> Recording:
    """Ticks that are longer, with as many more steps; see :meth:`Recording.stretched`.

    q_K(t / factor) has 1/factor of the velocity and 1/factor^2 of the acceleration.
    """
    if not (np.isfinite(factor) and factor > 0):
        raise ValueError(f"factor is {factor}; it must be positive")
    x = recording.start
    return recording.edited(
        start=x.replace(v_D=x.v_D / factor, v_K=x.v_K / factor),
        acc_K=recording.acc_K / factor / factor,
        tick=recording.tick * factor,
        steps=max(1, math.ceil(recording.steps * factor - 1e-9)),
    )


def smoothed(recording: Recording, seconds: float) -> Recording:
    """Hands on averaged paths; see :meth:`Recording.smoothed`.

    Each driven coordinate is averaged with Hann's window, which narrows towards the ends so that
    position and velocity stay there as they were. The velocities of the averaged path, by central
    differences, are joined by constant accelerations.
    """
    if not (np.isfinite(seconds) and seconds > 0):
        raise ValueError(f"seconds is {seconds}; it must be positive")
    table = recording.marionette.coordinates
    q, v, _ = recording.inputs.evaluate(recording.times)
    v[-1] = _last_velocity(recording)
    path = q.copy()
    for place, _ in table.quaternions_K:
        path[:, place : place + 4] = rotation.continuous(q[:, place : place + 4])
    path = _averaged(path, max(1, round(seconds / recording.tick)))
    rate = np.empty_like(v)
    two = 2.0 * recording.tick
    for place, at in table.scalars_K:
        rate[1:-1, at] = (path[2:, place] - path[:-2, place]) / two
    for place, at in table.quaternions_K:
        turn = rotation.normalised(path[:, place : place + 4])
        rate[1:-1, at : at + 3] = rotation.between(turn[:-2], turn[2:]) / two
    rate[0], rate[-1] = v[0], v[-1]
    acc_K = np.diff(rate, axis=0) / recording.tick
    return recording.edited(acc_K=acc_K)


def _last_velocity(recording: Recording) -> Array:
    """Velocity at the very end, which an input has only before it."""
    inputs = recording.inputs
    return inputs.evaluate(np.nextafter(inputs.end, 0.0))[1]


def _averaged(path: Array, most: int) -> Array:
    """Hann's average over up to ``most`` ticks to either side; at an end over nothing.

    In between the window widens smoothly: a kink in its width would be a step in velocity.
    """
    n = len(path) - 1
    out = path.copy()
    for i in range(1, n):
        near = min(i, n - i, 2 * most)
        wide = near - 0.25 * near**2 / most  # 1 : 1 at first, level where it is `most`
        half = min(int(wide) + 1, near)
        weight = np.cos(0.5 * np.pi * np.arange(-half, half + 1) / (wide + 1.0)) ** 2
        out[i] = weight @ path[i - half : i + half + 1] / weight.sum()
    return out
