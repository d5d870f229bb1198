"""The samples among which keys are chosen: dense, on both sides of every impact."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, Places, Times, rotation
from fantoccini.motion import Trajectory

RATE = 480.0
"""Samples of a second."""
_ROUGH = 1e-6
"""What a step is off, to be looked at more closely [m or rad]."""
_APART = 1e-6
"""Samples this close to an impact are left out [s]: single precision hardly tells them apart."""


@dataclass(frozen=True, eq=False)
class Grid:
    """A run on a dense grid.

    Attributes:
        t: (T,) times since the start [s], single precision as in files; not decreasing.
        run: at these times; of the samples at an impact the first is before it.
    """

    t: Times
    run: Trajectory

    @classmethod
    def of(cls, run: Trajectory, rate: float = RATE) -> Grid:
        """The grid of a run: even times, impacts twice, and its end."""
        start, span = run.t[0], run.duration
        impacts = np.unique(run.t[1:][np.diff(run.t) <= 0.0]) - start
        even = _single(np.arange(int(span * rate) + 1) / rate)
        even = np.union1d(even, _single(_rough(run, 3.0 / rate) - start))
        fixed = np.append(impacts, span)
        near = np.searchsorted(fixed, even)
        gaps = np.abs(fixed[np.clip([near - 1, near], 0, len(fixed) - 1)] - even)
        even = even[gaps.min(axis=0) > _APART]
        once = np.union1d(np.append(even, 0.0), fixed)
        times = np.sort(np.concatenate([once, impacts]))
        right = run.resample(np.minimum(start + times, run.t[-1]))
        first = np.append(np.diff(times) <= 0.0, False)
        if first.any():
            left = run.resample(np.minimum(start + times, run.t[-1]), side="left")
            right = _joined(left, right, first)
        return cls(_single(times), right)


def _rough(run: Trajectory, shorter: float) -> Times:
    """Times inside of short steps that the run does not cross smoothly.

    In runs of fixed steps positions and velocities belong together to the order of the step only,
    and impacts are smeared out: what the run is between its samples then has to be looked at.
    """
    h, table = np.diff(run.t), run.coordinates
    off = np.zeros(len(h))
    parts = (
        (run.q_D, run.v_D, run.acc_D, table.scalars_D, table.quaternions_D),
        (run.q_K, run.v_K, run.acc_K, table.scalars_K, table.quaternions_K),
    )
    for q, v, acc, scalars, quaternions in parts:
        for change, rates in _changes(q, scalars, quaternions):
            v0, v1, a0, a1 = v[:-1, rates], v[1:, rates], acc[:-1, rates], acc[1:, rates]
            step = h[:, None]
            slip = change - step * (v0 + v1) / 2.0 + step**2 * (a1 - a0) / 12.0
            jump = step * (v1 - v0 - step * (a0 + a1) / 2.0)
            off = np.maximum(off, np.abs(np.hstack([slip, jump])).max(axis=1, initial=0.0))
    steps = np.flatnonzero((h > 0.0) & (h < shorter) & (off > _ROUGH))
    times: Times = run.t[steps, None] + h[steps, None] * np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    return times.ravel()


def _changes(
    q: Array, scalars: Places, quaternions: Places
) -> Iterator[tuple[Array, list[int] | slice]]:
    """By how much coordinates change from sample to sample, and where their rates are."""
    if scalars:
        yield np.diff(q[:, [at for at, _ in scalars]], axis=0), [rate for _, rate in scalars]
    for at, rate in quaternions:
        turns = q[:, at : at + 4]
        yield rotation.between(turns[:-1], turns[1:]), slice(rate, rate + 3)


def _joined(left: Trajectory, right: Trajectory, first: Array) -> Trajectory:
    """The samples of one run where ``first``, of the other elsewhere."""
    which = first[:, None]
    changes = {
        name: np.where(which, getattr(left, name), getattr(right, name))
        for name in ("q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K")
    }
    taut = right.taut.like(np.where(which, left.taut.values, right.taut.values))
    return replace(right, taut=taut, **changes)


def _single(t: Times) -> Times:
    return t.astype(np.float32).astype(float)
