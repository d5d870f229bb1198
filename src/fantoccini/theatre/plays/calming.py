"""Damping of swing by a small motion of all hands, before something is handled.

    min over a of  integral of |v(t; a)|^2 dt + w |a|^2,   v: velocity of the trunk, after the
    motion

All upper ends of the strings move by the same sum of a_k b_k(t) along x and along y, from rest to
rest. v is nearly linear in a, so that least squares over rollouts yield the minimum.

a_k are the unknown offsets and b_k fixed curves, piecewise polynomials with the coefficients `coef`
between the times `breaks`. A rollout is a simulation of the motion. In names, D stands for dynamic
coordinates, which move by the equations of motion, and K for driven ones: ends and lengths of
strings, driven joints.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, SimulationError, polynomial
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State
from fantoccini.theatre.gestures import Gesture

DURATION = 2.4
"""Duration of the motion [s]."""
_KNOTS = np.array([0.2, 0.4, 0.6, 0.8]) * DURATION
"""Times at which the hands' offsets are a_k [s]."""
_MEASUREMENT_TIME = 1.6
"""Time after the motion in which swing is measured [s]."""
_TIME_STEP = 0.004
"""Time step of the rollouts [s]."""
_DIFFERENCE_STEP = 0.01
"""Step of the finite differences [m]."""
_MAX_OFFSET = 0.06
"""Largest offset of the hands [m]."""
_OFFSET_WEIGHT = 0.02
"""Cost of an offset of the hands, relative to the speed that it removes [1/s]."""
_ITERATIONS = 2
"""Number of least-squares steps."""
NO_OFFSETS = (0.0,) * (2 * len(_KNOTS))
"""Offsets of hands that do not move [m]."""


def calm_gesture(marionette: Marionette, offsets: tuple[float, ...]) -> Gesture:
    """Gesture that moves all upper ends together.

    Args:
        marionette: puppet in a scene of its own.
        offsets: offsets at the knots, along x, then along y [m].
    """
    waypoints: dict[str, list[tuple[float, float]]] = {}
    for name in marionette.coordinates.q_K:
        axis = "xy".find(name[-1]) if name[-2:] in (".x", ".y") else -1
        if axis >= 0:
            axis_offsets = np.reshape(offsets, (2, -1))[axis]
            points = zip(_KNOTS.tolist(), axis_offsets.tolist(), strict=True)
            waypoints[name] = [(0.0, 0.0), *points, (DURATION, 0.0)]
    return Gesture.from_points(marionette, waypoints, name="calm")


def calming_offsets(marionette: Marionette, x: State) -> tuple[float, ...]:
    """Offsets of :func:`calm_gesture` after which the trunk of a puppet swings least.

    They are 0 if a run of the search stops; the play's own run shows whether it stops, too.

    Args:
        marionette: puppet in a scene of its own.
        x: its state, with the hands at rest.
    """
    try:
        return _least_swing(marionette, x)
    except SimulationError:
        return NO_OFFSETS


def _least_swing(marionette: Marionette, x: State) -> tuple[float, ...]:
    """Offsets with the least swing [m]; none if they do not reduce it."""
    offsets = np.array(NO_OFFSETS)
    for _ in range(_ITERATIONS):
        speeds = _speeds(marionette, x, offsets)
        columns = [
            (_speeds(marionette, x, offsets + _DIFFERENCE_STEP * unit) - speeds) / _DIFFERENCE_STEP
            for unit in np.eye(len(offsets))
        ]
        weight = _OFFSET_WEIGHT * np.sqrt(len(speeds))
        A = np.vstack([np.stack(columns, axis=1), weight * np.eye(len(offsets))])
        b = np.concatenate([speeds, weight * offsets])
        offsets = np.clip(offsets - np.linalg.lstsq(A, b, rcond=None)[0], -_MAX_OFFSET, _MAX_OFFSET)
    usual_swing = np.linalg.norm(_speeds(marionette, x, np.array(NO_OFFSETS)))
    if np.linalg.norm(_speeds(marionette, x, offsets)) >= usual_swing:
        return NO_OFFSETS
    return tuple(float(offset) for offset in np.round(offsets, 6))


def _speeds(marionette: Marionette, x: State, offsets: Array) -> Array:
    """Speeds of the trunk after the motion, concatenated [m/s]."""
    gesture = calm_gesture(marionette, tuple(offsets.tolist()))
    n = int(np.ceil((DURATION + _MEASUREMENT_TIME) / _TIME_STEP))
    t = np.minimum(_TIME_STEP * np.arange(n + 1), DURATION)
    piece = np.clip(np.searchsorted(gesture.breaks, t, side="right") - 1, 0, len(gesture.coef) - 1)
    _, rates, _ = polynomial.evaluate(gesture.coef[piece], (t - gesture.breaks[piece])[:, None])
    rates[t >= DURATION] = 0.0
    rollout = marionette.rollout(
        x.replace(t=0.0), np.diff(rates, axis=0) / _TIME_STEP, dt=_TIME_STEP
    )
    table = marionette.coordinates
    trunk_indices = [v for _, v in table.scalars_D if table.v_D[v].endswith((".x", ".y"))]
    is_after = _TIME_STEP * np.arange(n + 1) >= DURATION
    return np.array(rollout.v_D[is_after][:, trunk_indices]).ravel()
