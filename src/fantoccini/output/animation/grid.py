"""Samples from which keys are chosen: dense, with one on each side of every impact."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, IndexPairs, Times, rotation
from fantoccini.motion import Trajectory

RATE = 480.0
"""Samples per second."""
_MAX_STEP_ERROR = 1e-6
"""Error of a step above which the step is sampled more densely [m or rad]."""
_MIN_DISTANCE = 1e-6
"""Distance from an impact below which samples are dropped, for single precision [s]."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Run resampled on a dense grid.

    Attributes:
        t: (T,) times since the start [s], rounded to single precision as in files; not decreasing.
        run: the run at these times; the first of two samples at an impact is the state before it.
    """

    t: Times
    run: Trajectory

    @classmethod
    def of(cls, run: Trajectory, rate: float = RATE) -> Grid:
        """Grid of a run: evenly spaced times, every impact twice, and the end."""
        start, span = run.t[0], run.duration
        impacts = np.unique(run.t[1:][np.diff(run.t) <= 0.0]) - start
        even = _single(np.arange(int(span * rate) + 1) / rate)
        even = np.union1d(even, _single(_rough_times(run, 3.0 / rate) - start))
        fixed = np.append(impacts, span)
        near = np.searchsorted(fixed, even)
        gaps = np.abs(fixed[np.clip([near - 1, near], 0, len(fixed) - 1)] - even)
        even = even[gaps.min(axis=0) > _MIN_DISTANCE]
        distinct = np.union1d(np.append(even, 0.0), fixed)
        times = np.sort(np.concatenate([distinct, impacts]))
        right = run.resample(np.minimum(start + times, run.t[-1]))
        first = np.append(np.diff(times) <= 0.0, False)
        if first.any():
            left = run.resample(np.minimum(start + times, run.t[-1]), side="left")
            right = _joined(left, right, first)
        return cls(_single(times), right)


def _rough_times(run: Trajectory, max_step: float) -> Times:
    """Additional times inside short steps whose motion is not smooth.

    With fixed steps, positions and velocities agree only to the order of the step, and impacts are
    spread over a step, so the run must also be sampled between its own samples.
    """
    h, table = np.diff(run.t), run.coordinates
    errors = np.zeros(len(h))
    parts = (
        (run.q_D, run.v_D, run.acc_D, table.scalars_D, table.quaternions_D),
        (run.q_K, run.v_K, run.acc_K, table.scalars_K, table.quaternions_K),
    )
    for q, v, acc, scalars, quaternions in parts:
        for change, rates in _changes(q, scalars, quaternions):
            v0, v1, a0, a1 = v[:-1, rates], v[1:, rates], acc[:-1, rates], acc[1:, rates]
            step = h[:, None]
            position_error = change - step * (v0 + v1) / 2.0 + step**2 * (a1 - a0) / 12.0
            velocity_error = step * (v1 - v0 - step * (a0 + a1) / 2.0)
            errors = np.maximum(
                errors, np.abs(np.hstack([position_error, velocity_error])).max(axis=1, initial=0.0)
            )
    steps = np.flatnonzero((h > 0.0) & (h < max_step) & (errors > _MAX_STEP_ERROR))
    times: Times = run.t[steps, None] + h[steps, None] * np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    return times.ravel()


def _changes(
    q: Array, scalars: IndexPairs, quaternions: IndexPairs
) -> Iterator[tuple[Array, list[int] | slice]]:
    """Changes of coordinates from sample to sample, each with the index of its rates."""
    if scalars:
        yield np.diff(q[:, [at for at, _ in scalars]], axis=0), [rate for _, rate in scalars]
    for at, rate in quaternions:
        turns = q[:, at : at + 4]
        yield rotation.between(turns[:-1], turns[1:]), slice(rate, rate + 3)


def _joined(left: Trajectory, right: Trajectory, first: Array) -> Trajectory:
    """Run with the samples of `left` where `first` is true, and those of `right` elsewhere."""
    which = first[:, None]
    changes = {
        name: np.where(which, getattr(left, name), getattr(right, name))
        for name in ("q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K")
    }
    taut = right.taut.like(np.where(which, left.taut.values, right.taut.values))
    return replace(right, taut=taut, **changes)


def _single(t: Times) -> Times:
    return t.astype(np.float32).astype(float)
