"""Motion of a hand to its target in the least time that bounded speed and acceleration allow.

Time goes in ticks of T seconds, and the acceleration is constant over each. For a hand at the
distance d from its target with the velocity v, the distance after the next tick is
d - (v + v') T/2, with v' the velocity then. From there it can just brake, and comes to rest exactly
at its target, when v' lies on the polygon through

  d_k = k^2 a T^2/2,   v_k = k a T,   k = 0, 1, 2, ...

which full braking maps onto itself, corner k onto corner k - 1. Both together give, with
c = d - v T/2 and k the whole part of (sqrt(1 + 8 c/(a T^2)) - 1)/2,

  v' = k a T/2 + c/((k + 1) T).

v' is then bounded by the speed, and its change by a T. Several coordinates that move together (the
axes of a handle, a rotation vector) do so along c: a straight drag is a straight move. In names, K
stands for driven coordinates: ends and lengths of strings, driven joints.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, Indices, VecK

_MIN_LENGTH = 1e-300
"""Divisor for vectors of length 0 [m or rad, per s or s^2]; keeps quotients finite."""


def wanted_velocity(
    displacement: VecK, v: VecK, tick: float, group: Indices, speed: Array, acceleration: Array
) -> VecK:
    """v', the wanted velocities at the end of the next tick; their change is not yet bounded.

    Args:
        displacement: (n,) vectors from the hands to their targets [m or rad].
        v: (n,) present velocities [m/s or rad/s].
        tick: T [s].
        group: (n,) index of the group of coordinates that move together.
        speed, acceleration: (n_groups,) bounds [m/s, m/s^2 or rad/s, rad/s^2].

    Returns:
        (n,) velocities [m/s or rad/s].
    """
    c = displacement - (0.5 * tick) * v
    distance = lengths(c, group, len(speed))
    k = np.floor(0.5 * (np.sqrt(1.0 + (8.0 / (tick * tick)) * distance / acceleration) - 1.0))
    max_speed = (0.5 * tick) * k * acceleration + distance / ((k + 1.0) * tick)
    return c * (np.minimum(max_speed, speed) / np.maximum(distance, _MIN_LENGTH))[group]


def bounded_acceleration(
    wanted: VecK, v: VecK, tick: float, group: Indices, acceleration: Array
) -> VecK:
    """(n,) accelerations over a tick that lead to, or towards, wanted velocities.

    Args:
        wanted: (n,) velocities [m/s or rad/s].
        v, tick, group, acceleration: see :func:`wanted_velocity`.
    """
    change = (wanted - v) / tick
    magnitude = lengths(change, group, len(acceleration))
    return change * np.minimum(1.0, acceleration / np.maximum(magnitude, _MIN_LENGTH))[group]


def lengths(x: Array, group: Indices, n: int) -> Array:
    """(n,) Euclidean length of each group of coordinates."""
    return np.sqrt(np.bincount(group, x * x, n))
