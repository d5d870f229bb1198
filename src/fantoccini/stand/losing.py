"""Steps that a stepper loses, by a simple model that gives it all the benefit of the doubt.

From the moment when the demand exceeds the pull-out torque T, the motor gives T and no more, and
what is missing turns it back with the inertia of the axis and of the whole puppet, as if all of it
hung there:

    (J_m + m / n^2) lag'' = |torque| - T,   until it catches up (lag' = 0)

Every four full steps of lag are lost, and none below two. The demand is that of a puppet whose
winches hold: one that yields is pulled less.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array

PERIOD = 4
"""Full steps of a period of a stepper's torque: it loses them together."""


@dataclass(frozen=True)
class LostSteps:
    """Where a stepper cannot follow.

    Attributes:
        since: when the demand first exceeds what it has [s].
        steps: full steps that it loses at least, 0 where it may recover.
        lag: the largest lag [full steps].
    """

    since: float
    steps: int
    lag: float


def lost_steps(
    steps: int,
    t: Array,
    demand: Array,
    available: Array,
    inertia: float,
    thrown: Sequence[float] = (),
) -> LostSteps | None:
    """The steps that a motor loses; None where it has torque enough.

    Args:
        steps: full steps of a turn.
        t: (T,) [s].
        demand, available: (T,) torque needed, and there [N m].
        inertia: of all that turns back with it, at the motor [kg m^2].
        thrown: times of catches that throw it out of step [s].
    """
    excess = demand - available
    over = np.flatnonzero(excess > 0.0)
    starts = [*thrown, *(t[over[:1]])]
    if not starts:
        return None
    lost, largest, i = PERIOD * len(thrown), 0.0, int(over[0]) if len(over) else len(t)
    step = 2.0 * math.pi / steps
    while i < len(t):
        lag, rate, own = 0.0, 0.0, 0.0
        while i + 1 < len(t):
            h = t[i + 1] - t[i]
            push = 0.5 * (excess[i] + excess[i + 1]) / inertia
            lag += h * rate + 0.5 * h * h * push
            rate += h * push
            i += 1
            own = max(own, lag / step)
            if rate <= 0.0 and excess[i] <= 0.0:
                break
        lost += PERIOD * math.floor(own / PERIOD + 0.5)
        largest = max(largest, own)
        later = over[over > i]
        i = int(later[0]) if len(later) else len(t)
    return LostSteps(float(min(starts)), lost, largest)
