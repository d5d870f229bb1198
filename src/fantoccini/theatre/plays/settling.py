"""Pauses before free cues, in which the swing of earlier cues decays or is used.

    min over p in [0, P] of  (1/T) integral of |v|^2 after the cue dt + c p,   v: trunk's velocity

A cue that is delayed by p moves the hands by u(t - p); the gradient is that of the rollout:

    dJ/dp = sum over steps of (dJ/da_k) . da_k/dp,   da_k/dp = -(u''(t_k+1 - p) - u''(t_k - p)) / dt

u is the motion of the hands, with the acceleration a_k in step k of length dt; T is the time of
measurement, P the longest pause, and c the cost of a second of pause. v_D are the dynamic
velocities. A rollout is a simulation. In names, K stands for driven coordinates: ends and lengths
of strings, driven joints. Breaks are the times at which the pieces of a motion meet, and `coef`
their coefficients.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from fantoccini.base import Array, polynomial
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State
from fantoccini.theatre.gestures import Motion

MAX_FREE_PAUSE = 1.0
"""Longest delay of a free cue without `may wait` [s]."""
_MEASUREMENT_TIME = 1.2
"""Time after the cue in which swing is measured [s]."""
_TIME_STEP = 0.004
"""Time step of the rollouts [s]."""
_MAX_INVISIBLE_SPEED = 0.015
"""Largest speed of the trunk that is not visible [m/s]."""
_PAUSE_COST = 4e-4
"""Cost of a second of pause [m^2/s^2]."""
_N_STARTS = 12
"""Number of pauses to try as starts of the search."""


def best_pause(
    marionette: Marionette, x: State, motion: Motion, max_pause: float
) -> tuple[float, float, float]:
    """Pause before a motion with the least swing after the motion.

    Args:
        marionette: puppet in a scene of its own.
        x: state at the earliest beginning of the motion.
        motion: motion of the hands, as offsets from their places; at rest at both ends.
        max_pause: longest pause [s].

    Returns:
        Pause [s], and speeds of the trunk after the motion without and with the pause [m/s].
    """
    swing = Swing(marionette, x, motion, max_pause)
    starts = np.linspace(0.0, max_pause, _N_STARTS)
    costs = [swing.cost(p)[0] for p in starts]
    if not np.isfinite(costs[0]):
        return 0.0, 0.0, 0.0
    speed_before = np.sqrt(costs[0])
    if speed_before <= _MAX_INVISIBLE_SPEED:
        return 0.0, float(speed_before), float(speed_before)
    best_start = starts[int(np.argmin(costs))]
    minimum = minimize(
        lambda p: swing.cost(float(p[0]), gradient=True),
        [best_start],
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.0, max_pause)],
        options={"maxiter": 12, "ftol": 1e-3},
    )
    p = float(minimum.x[0]) if minimum.fun < costs[0] else 0.0
    speed_after = np.sqrt(max(swing.cost(p)[0] - _PAUSE_COST * p, 0.0))
    return p, float(speed_before), float(speed_after)


class Swing:
    """Swing of a puppet after a motion that begins after a pause; see :func:`pause`."""

    def __init__(self, marionette: Marionette, x: State, motion: Motion, max_pause: float):
        self._marionette, self._x, self._motion = marionette, x, motion
        self._duration = float(motion.breaks[-1])
        self._n_steps = int(np.ceil((max_pause + self._duration + _MEASUREMENT_TIME) / _TIME_STEP))
        table = marionette.coordinates
        trunk_indices = [v for _, v in table.scalars_D if table.v_D[v].endswith((".x", ".y", ".z"))]
        self._weights = np.zeros(table.n_vD)
        self._weights[trunk_indices or slice(None)] = 1.0

    def cost(self, p: float, gradient: bool = False) -> tuple[float, Array]:
        """Cost of a pause p [s], and its derivative (1,), which is 0 without ``gradient``.

        The cost is infinite if the rollout stops.
        """
        t = np.asarray(_TIME_STEP * np.arange(self._n_steps + 1) - p, dtype=float)
        rates, accelerations = self._hand_rates(t)
        acc = np.diff(rates, axis=0) / _TIME_STEP
        rollout = self._marionette.rollout(self._x, acc, dt=_TIME_STEP, throw=False)
        if rollout.steps < len(acc):
            return np.inf, np.zeros(1)
        # The window begins and ends between two steps, so that it moves smoothly with p.
        steps_since, steps_until = (
            (t - self._duration) / _TIME_STEP,
            (self._duration + _MEASUREMENT_TIME - t) / _TIME_STEP,
        )
        weight = np.clip(np.minimum(steps_since, steps_until), 0.0, 1.0)
        weight_rate = (
            np.where(steps_since < steps_until, 1.0, -1.0)
            * ((weight > 0.0) & (weight < 1.0))
            / _TIME_STEP
        )
        squared_speeds = rollout.v_D * rollout.v_D @ self._weights * _TIME_STEP / _MEASUREMENT_TIME
        value = float(weight @ squared_speeds) + _PAUSE_COST * p
        if not gradient:
            return value, np.zeros(1)
        gradient_v = (
            2.0 * self._weights * rollout.v_D * weight[:, None] * _TIME_STEP / _MEASUREMENT_TIME
        )
        gradient_acc = rollout.gradient(v_D=gradient_v).acc_K
        acc_by_pause = -np.diff(accelerations, axis=0) / _TIME_STEP
        slope = (
            float(np.sum(gradient_acc * acc_by_pause))
            - float(weight_rate @ squared_speeds)
            + _PAUSE_COST
        )
        return value, np.array([slope])

    def _hand_rates(self, t: Array) -> tuple[Array, Array]:
        """(T, n_vK) rates of the hands and their derivatives, at times since the beginning (T,)."""
        breaks, coef = self._motion.breaks, self._motion.coef
        clipped = np.clip(t, 0.0, self._duration)
        piece = np.clip(np.searchsorted(breaks, clipped, side="right") - 1, 0, len(coef) - 1)
        _, rates, accelerations = polynomial.evaluate(
            coef[piece], (clipped - breaks[piece])[:, None]
        )
        is_outside = ((t < 0.0) | (t > self._duration))[:, None]
        return np.where(is_outside, 0.0, rates), np.where(is_outside, 0.0, accelerations)
