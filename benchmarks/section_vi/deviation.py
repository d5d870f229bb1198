"""Difference of a run from the mixed model's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.section_vi.mechanism import Mechanism

from fantoccini.base.arrays import Array
from fantoccini.motion import Trajectory

_SAME_END = 1e-9
"""A run reached its end if it stopped no earlier than this before it [s]."""


@dataclass(frozen=True, eq=False)
class Deviation:
    """Difference of a run from the mixed model's.

    Attributes:
        t: (T,) times [s].
        puppet, mechanism: (T,) largest difference of a coordinate of the puppet, of the driven
            coordinates [m or rad].
        status: status of the run if it stopped early; otherwise empty.
    """

    t: Array
    puppet: Array
    mechanism: Array
    status: str = ""

    @property
    def max_puppet(self) -> float:
        """Largest difference of the puppet [m or rad]."""
        return float(np.max(self.puppet))

    @property
    def max_mechanism(self) -> float:
        """Largest difference of the driven coordinates [m or rad]."""
        return float(np.max(self.mechanism))


def deviation(
    mechanism: Mechanism, mixed: Trajectory, run: Trajectory, n: int = 300, from_rest: bool = False
) -> Deviation:
    """The difference of a run from the mixed model's, up to the earlier end.

    Args:
        mechanism: the puppet.
        mixed: run of the mixed model.
        run: run of the same puppet on drives or with a chain.
        n: number of times at which they are compared.
        from_rest: subtract the difference at the start.
    """
    times = np.linspace(mixed.t[0], min(mixed.t[-1], run.t[-1]), n)
    puppet, drives = (
        np.max(np.abs(part - from_rest * part[0]), axis=1, initial=0.0)
        for part in mechanism.difference(mixed.resample(times), run.resample(times))
    )
    stopped = run.t[-1] < mixed.t[-1] - _SAME_END
    return Deviation(times, puppet, drives, run.status.message if stopped else "")


def convergence_order(x: Array | list[float], y: Array | list[float]) -> float:
    """The exponent k of y ~ x^k over the last three points; NaN unless y is positive and finite."""
    x, y = np.asarray(x, dtype=float)[-3:], np.asarray(y, dtype=float)[-3:]
    if len(y) < 2 or not np.all(np.isfinite(y) & (y > 0)):
        return float("nan")
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
