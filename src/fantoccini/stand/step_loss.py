"""Lower bound of the steps that a stepper loses.

When the demand exceeds the pull-out torque T, the motor exerts T, and the missing torque turns it
back, with the inertia of the axis and of the whole puppet, as if this axis carried all its mass:

    (J_m + m / n^2) lag'' = |torque| - T,   until it catches up (lag' = 0)

The lag is lost in multiples of four full steps; a lag below two is recovered. The demand is
computed for winches that do not slip; a slipping winch is pulled with less force.

J_m is the inertia of the motor, m the mass of the puppet, and n the angle of the motor per unit of
the axis. The lag is the angle by which the motor is behind its command.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array

STEPS_PER_PERIOD = 4
"""Full steps in a period of a stepper's torque; it loses steps in multiples of this."""


@dataclass(frozen=True)
class LostSteps:
    """Steps that a stepper loses in a run.

    Attributes:
        since: first time at which the demand exceeds the available torque [s].
        steps: minimum number of full steps lost; 0 if it may recover.
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
    catch_times: Sequence[float] = (),
) -> LostSteps | None:
    """Steps that a motor loses; None if its torque suffices.

    Args:
        steps: full steps per turn.
        t: (T,) times [s].
        demand, available: (T,) required and available torque [N m].
        inertia: inertia of everything that turns back with the motor, at the motor [kg m^2].
        catch_times: times of catches at which the motor loses synchronism [s].
    """
    excess = demand - available
    exceeding = np.flatnonzero(excess > 0.0)
    starts = [*catch_times, *(t[exceeding[:1]])]
    if not starts:
        return None
    n_lost, largest_lag, i = (
        STEPS_PER_PERIOD * len(catch_times),
        0.0,
        int(exceeding[0]) if len(exceeding) else len(t),
    )
    step_angle = 2.0 * math.pi / steps
    while i < len(t):
        lag, lag_rate, peak_lag = 0.0, 0.0, 0.0
        while i + 1 < len(t):
            dt = t[i + 1] - t[i]
            acceleration = 0.5 * (excess[i] + excess[i + 1]) / inertia
            lag += dt * lag_rate + 0.5 * dt * dt * acceleration
            lag_rate += dt * acceleration
            i += 1
            peak_lag = max(peak_lag, lag / step_angle)
            if lag_rate <= 0.0 and excess[i] <= 0.0:
                break
        n_lost += STEPS_PER_PERIOD * math.floor(peak_lag / STEPS_PER_PERIOD + 0.5)
        largest_lag = max(largest_lag, peak_lag)
        next_exceeding = exceeding[exceeding > i]
        i = int(next_exceeding[0]) if len(next_exceeding) else len(t)
    return LostSteps(float(min(starts)), n_lost, largest_lag)
