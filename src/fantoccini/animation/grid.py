"""The samples among which keys are chosen: dense, on both sides of every impact."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fantoccini.arrays import Array, Times
from fantoccini.motion import Trajectory

RATE = 480.0
"""Samples of a second."""
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
