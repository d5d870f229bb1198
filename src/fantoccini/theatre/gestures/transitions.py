"""Transitions: quintics from one offset and rate to another, as short as the bounds allow.

An offset is the difference of a driven coordinate from its value at rest; n_vK is the number of
driven velocities, and `coef` are coefficients of a polynomial in ascending powers.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError, check_positive, polynomial
from fantoccini.motion import pieces
from fantoccini.theatre.gestures import piecewise
from fantoccini.theatre.gestures.moves import names_and_units

if TYPE_CHECKING:
    from fantoccini.model.tree import CoordinateTable

MAX_SPEED = 1.0
"""Default bound on the speed of driven coordinates [m/s]."""
MAX_ACCELERATION = 6.0
"""Default bound on the acceleration of driven coordinates [m/s^2]."""
TURN_RADIUS = 0.4
"""Distance from the axis at which a bound for all coordinates applies to a turn [m]."""

MotionBound = float | Mapping[str, float]
"""A bound for all driven coordinates [m/s or m/s^2], or by name in the coordinate's own unit."""

_MIN_BOUND = 1e-6
"""Least bound of a speed or an acceleration [m/s, m/s^2]."""
_MIN_DURATION = 0.04
"""Shortest transition [s]."""
_DURATION_GROWTH = 1.1
"""Ratio of one trial duration to the one before."""
OFFSET_TOLERANCE = 1e-12
"""Tolerance for equal offsets and rates [m or rad, s]."""
_MAX_TRIALS = 200
"""Number of durations to try; the last one is 10^8 times the first."""


def motion_bounds(table: CoordinateTable, speed: MotionBound, acceleration: MotionBound) -> Array:
    """(2, n_vK) bounds of speeds and accelerations, each in its coordinate's unit.

    A bound for all coordinates is divided by :data:`TURN_RADIUS` for turns.

    Raises:
        UnknownNameError: a name is not that of a driven coordinate.
        ValueError: a bound is below 1e-6.
    """
    channels = pieces.channel_names(table)
    bounds = np.empty((2, table.n_vK))
    turn_radii = np.array(
        [TURN_RADIUS if unit == "rad" else 1.0 for _, unit in names_and_units(table)]
    )
    for i, (quantity, bound, default) in enumerate(
        (("speed", speed, MAX_SPEED), ("acceleration", acceleration, MAX_ACCELERATION))
    ):
        if not isinstance(bound, Mapping):
            check_positive(**{quantity: bound})
            bounds[i] = bound / turn_radii
            continue
        bounds[i] = default / turn_radii
        for name, value in bound.items():
            channel = table.commands.get(name, name)
            if channel not in channels:
                raise UnknownNameError("driven coordinate", name, list(channels))
            check_positive(**{f"{quantity} of {name}": value})
            bounds[i, channels[channel][1]] = value
    if np.any(bounds < _MIN_BOUND):
        raise ValueError(
            f"a bound of speed or acceleration is {bounds.min():g}; it must be at least "
            f"{_MIN_BOUND:g}"
        )
    return bounds


def transition(
    d: Array, rate: Array, target: Array, target_rate: Array, bounds: Array
) -> tuple[tuple[float, Array] | None, Array]:
    """Quintic from (d, rate) to (target, target_rate), and its end.

    Args:
        d, rate: (n_vK,) offsets and their rates.
        target: (n_vK,) offsets at the end; NaN for coordinates that only stop.
        target_rate: (n_vK,) rates at the end.
        bounds: (2, n_vK) bounds of speeds and accelerations.

    Returns:
        Its duration and coefficients (n_vK, 6), or None if nothing differs; and its end (n_vK,).

    Raises:
        StateError: no duration keeps the bounds.
    """
    is_stopping = np.isnan(target)
    goal = np.where(is_stopping, d, target)
    distance, change = np.abs(goal - d), np.abs(target_rate - rate)
    if max(np.max(distance, initial=0.0), np.max(change, initial=0.0)) <= OFFSET_TOLERANCE:
        return None, d
    duration = max(
        _MIN_DURATION,
        polynomial.minimum_jerk_duration(distance, bounds[0], bounds[1]),
        float(np.max(1.5 * change / bounds[1])),
    )
    zero_acceleration, tolerant_bounds = np.zeros(len(d)), bounds * (1.0 + 1e-9)
    end_speed = np.maximum(np.abs(rate), np.abs(target_rate))
    for _ in range(_MAX_TRIALS):
        # A coordinate that only stops covers half the distance of its first rate.
        end = np.where(is_stopping, d + 0.5 * duration * rate, goal)
        coef = polynomial.hermite(
            np.full(len(d), duration),
            (d, rate, zero_acceleration),
            (end, target_rate, zero_acceleration),
        )
        speed, acceleration = piecewise.peaks(np.array([0.0, duration]), coef[None])[0]
        if np.all(speed <= np.maximum(tolerant_bounds[0], end_speed * 1.01)) and np.all(
            acceleration <= tolerant_bounds[1]
        ):
            return (duration, coef), end
        duration *= _DURATION_GROWTH
    raise StateError(
        f"no transition shorter than {duration:.3g} s between two gestures keeps the bounds of "
        f"{bounds[0].min():g} m/s and {bounds[1].min():g} m/s^2"
    )
