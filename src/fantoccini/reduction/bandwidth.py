"""Part (c): real tracking. How near the mixed model is as the drives' bandwidth grows.

Every drive has a computed-torque control of bandwidth w, which knows the drive's inertia and not
the strings: e'' + 2 w e' + w^2 e = pull / J. Under a steady pull it lags by e = pull / (J w^2), so
that the puppet's motion differs from the mixed model's by a multiple of 1 / w^2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.marionette import Event, Marionette
from fantoccini.motion import Trajectory
from fantoccini.reduction.mechanism import Mechanism
from fantoccini.reduction.motions import Motion
from fantoccini.simulation import simulate

BANDWIDTHS = tuple(10.0 * 2.0**k for k in range(8))
"""Bandwidths over the frequency sqrt(g/l) of a pendulum as long as the strings."""
_RTOL = 1e-10


@dataclass(frozen=True, eq=False)
class Tracked:
    """The full model under control beside the mixed one.

    Attributes:
        bandwidth: of all drives [rad/s].
        t: (T,) times [s].
        puppet, mechanism: (T,) largest difference of a coordinate of the puppet, of the drives
            from the mixed model's [m or rad].
        status: how the run ended, where it stopped before its end; else empty.
    """

    bandwidth: float
    t: Array
    puppet: Array
    mechanism: Array
    status: str = ""

    @property
    def worst(self) -> tuple[float, float]:
        """Largest differences of the puppet and of the mechanism."""
        return float(np.max(self.puppet)), float(np.max(self.mechanism))


def tracked(
    mechanism: Mechanism, full: Marionette, motion: Motion, bandwidth: float, ratio: float = 1.0
) -> Tracked:
    """The full model follows a motion's inputs with some bandwidth.

    Args:
        mechanism: the puppet.
        full: it on drives with control.
        motion: of the mixed model.
        bandwidth: [rad/s].
        ratio: mass of a drive over that of the puppet.
    """
    tuned = mechanism.tuned(full, ratio, bandwidth)
    run = simulate(
        tuned, mechanism.state(tuned, motion.x0), mechanism.commanded(tuned, motion.inputs),
        motion.inputs.end, method=Event(rtol=_RTOL, atol=_RTOL), effort=False, throw=False,
    )  # fmt: skip
    return beside(mechanism, motion.run, run, bandwidth)


def beside(
    mechanism: Mechanism,
    mixed: Trajectory,
    run: Trajectory,
    bandwidth: float,
    from_rest: bool = False,
) -> Tracked:
    """How far a run is from the mixed model's.

    Args:
        mechanism: the puppet.
        mixed: the mixed model's motion.
        run: the other one.
        bandwidth: of the drives [rad/s].
        from_rest: less how far they are apart at the start.
    """
    times = np.linspace(mixed.t[0], min(mixed.t[-1], run.t[-1]), 300)
    away = mechanism.away(mixed.resample(times), run.resample(times))
    puppet, drives = (
        np.max(np.abs(part - from_rest * part[0]), axis=1, initial=0.0) for part in away
    )
    status = "" if run.t[-1] >= mixed.t[-1] - 1e-9 else run.status.message
    return Tracked(bandwidth, times, puppet, drives, status)


def bandwidths(mechanism: Mechanism, full: Marionette, motion: Motion) -> list[Tracked]:
    """The same motion with larger and larger bandwidths."""
    return [tracked(mechanism, full, motion, w / mechanism.pace) for w in BANDWIDTHS]


def order(x: Array, y: Array) -> float:
    """The power of x that y goes with, over the last three points; nan where there are none."""
    x, y = np.asarray(x, dtype=float)[-3:], np.asarray(y, dtype=float)[-3:]
    if len(y) < 2 or not np.all(np.isfinite(y) & (y > 0)):
        return float("nan")
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
