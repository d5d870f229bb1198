"""A point mass on a string in a vertical plane, slack and taut, integrated by SciPy's DOP853.

Taut, the angle a from the bottom obeys a'' = -g/L sin(a), and the string pulls while L a'^2 + g
cos(a) > 0. Slack, the mass falls freely until its distance from the pivot is the length; then the
radial velocity is lost. SciPy's own events end every arc.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

CLEAR = 0.01
"""Time after leaving the circle during which a mass cannot be caught [s]."""


@dataclass(frozen=True)
class Run:
    """End state and events of a run.

    Attributes:
        state: (x, z, vx, vz) at the end [m], [m/s].
        events: (time [s], "release" or "catch", radial speed lost [m/s]).
    """

    state: np.ndarray
    events: list[tuple[float, str, float]]


def simulate(state, t_end: float, length: float, gravity: float, tolerance: float = 1e-13) -> Run:
    """Motion from a state inside or on the circle about the pivot (0, 0).

    Args:
        state: (x, z, vx, vz); on the circle it moves along it, and the string pulls.
        t_end: end time [s].
        length: length of the string [m].
        gravity: gravitational acceleration [m/s^2].
        tolerance: relative tolerance; the absolute one is a tenth of it.
    """

    def swing(t, y):
        return [y[1], -gravity / length * np.sin(y[0])]

    def pull(t, y):
        return length * y[1] ** 2 + gravity * np.cos(y[0])

    def fall(t, y):
        return [y[2], y[3], 0.0, -gravity]

    def reach(t, y):
        return np.hypot(y[0], y[1]) - length

    pull.terminal, pull.direction = True, -1  # type: ignore[attr-defined]
    reach.terminal, reach.direction = True, 1  # type: ignore[attr-defined]
    # SciPy evaluates events only at the ends of steps, so steps must be short relative to an arc.
    options = {"method": "DOP853", "rtol": tolerance, "atol": tolerance / 10.0, "max_step": 0.02}
    y, t, events = np.array(state, dtype=float), 0.0, []
    taut, leaves = bool(abs(reach(t, y)) < 1e-12), False
    while t < t_end:
        if taut:
            solution = solve_ivp(swing, (t, t_end), _polar(y, length), events=pull, **options)
            y = _plane(solution.y[:, -1], length)
        else:
            if leaves:
                ahead = min(t + CLEAR, t_end)
                y, t = solve_ivp(fall, (t, ahead), y, **options).y[:, -1], ahead
                if t == t_end:
                    break
            solution = solve_ivp(fall, (t, t_end), y, events=reach, **options)
            y = solution.y[:, -1]
        t = float(solution.t[-1])
        if t == t_end:
            break
        if taut:
            events.append((t, "release", 0.0))
            taut, leaves = False, True
        else:
            polar = _polar(y, length)
            events.append((t, "catch", float(y[:2] @ y[2:] / length)))
            y = _plane(polar, length)
            taut, leaves = bool(pull(t, polar) > 0), True
    return Run(y, events)


def _polar(y: np.ndarray, length: float) -> np.ndarray:
    """Angle from the bottom and its rate; the radial velocity is dropped."""
    a = np.arctan2(y[0], -y[1])
    return np.array([a, (y[2] * np.cos(a) + y[3] * np.sin(a)) / length])


def _plane(polar: np.ndarray, length: float) -> np.ndarray:
    """Place and velocity on the circle."""
    c, s = np.cos(polar[0]), np.sin(polar[0])
    return length * np.array([s, -c, polar[1] * c, polar[1] * s])
