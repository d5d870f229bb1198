"""Samples from which keys are chosen: dense, with one on each side of every impact.

A key is a value at a time, between which players interpolate. q_D and q_K are the dynamic and
driven coordinates, v and acc their velocities and accelerations. A taut string pulls, a slack one
does not.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, IndexPairs, Times, rotation
from fantoccini.motion import Trajectory

SAMPLE_RATE = 480.0
"""Samples per second."""
_MAX_STEP_ERROR = 1e-6
"""Error of a step above which the step is sampled more densely [m or rad]."""
_MIN_TIME_FROM_IMPACT = 1e-6
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
    def from_run(cls, run: Trajectory, rate: float = SAMPLE_RATE) -> Grid:
        """Grid of a run: evenly spaced times, every impact twice, and the end."""
        start, duration = run.t[0], run.duration
        impacts = np.unique(run.t[1:][np.diff(run.t) <= 0.0]) - start
        even_times = _to_single_precision(np.arange(int(duration * rate) + 1) / rate)
        even_times = np.union1d(
            even_times, _to_single_precision(_extra_times(run, 3.0 / rate) - start)
        )
        fixed_times = np.append(impacts, duration)
        neighbour = np.searchsorted(fixed_times, even_times)
        gaps = np.abs(
            fixed_times[np.clip([neighbour - 1, neighbour], 0, len(fixed_times) - 1)] - even_times
        )
        even_times = even_times[gaps.min(axis=0) > _MIN_TIME_FROM_IMPACT]
        distinct = np.union1d(np.append(even_times, 0.0), fixed_times)
        times = np.sort(np.concatenate([distinct, impacts]))
        grid_run = run.resample(np.minimum(start + times, run.t[-1]))
        is_before_impact = np.append(np.diff(times) <= 0.0, False)
        if is_before_impact.any():
            run_before = run.resample(np.minimum(start + times, run.t[-1]), side="left")
            grid_run = _merge_sides(run_before, grid_run, is_before_impact)
        return cls(_to_single_precision(times), grid_run)


def _extra_times(run: Trajectory, max_step: float) -> Times:
    """Additional times inside short steps whose motion is not smooth.

    With fixed steps, positions and velocities agree only to the order of the step, and impacts are
    spread over a step, so the run must also be sampled between its own samples.
    """
    h, coordinates = np.diff(run.t), run.coordinates
    errors = np.zeros(len(h))
    coordinate_groups = (
        (run.q_D, run.v_D, run.acc_D, coordinates.scalars_D, coordinates.quaternions_D),
        (run.q_K, run.v_K, run.acc_K, coordinates.scalars_K, coordinates.quaternions_K),
    )
    for q, v, acc, scalars, quaternions in coordinate_groups:
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
        yield np.diff(q[:, [first for first, _ in scalars]], axis=0), [rate for _, rate in scalars]
    for first, rate in quaternions:
        quaternion = q[:, first : first + 4]
        yield rotation.between(quaternion[:-1], quaternion[1:]), slice(rate, rate + 3)


def _merge_sides(
    run_before: Trajectory, run_after: Trajectory, is_before_impact: Array
) -> Trajectory:
    """Run with samples of `run_before` where `is_before_impact`, otherwise of `run_after`."""
    mask = is_before_impact[:, None]
    changes = {
        name: np.where(mask, getattr(run_before, name), getattr(run_after, name))
        for name in ("q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K")
    }
    taut = run_after.taut.like(np.where(mask, run_before.taut.values, run_after.taut.values))
    return replace(run_after, taut=taut, **changes)


def _to_single_precision(t: Times) -> Times:
    return t.astype(np.float32).astype(float)
