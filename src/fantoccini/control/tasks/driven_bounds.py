"""Bounds of the driven coordinates of plans, as arrays.

A driven coordinate q_K is an end or a length of a string, or a driven joint; v_K are their
velocities.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, MaskRows, StateError
from fantoccini.control.tasks.bounds import Bounds, Magnitudes, resolve_driven
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import CoordinateTable


@dataclass(frozen=True)
class _Limits:
    """Default bounds, and limits of bounds."""

    min_length: float = 1e-3
    """Smallest length of a string on a winch [m]."""
    max_bound: float = 1e6
    """Largest bound on a speed or an acceleration [m/s or m/s^2; rad/s or rad/s^2]."""
    default_speed: float = 0.5
    """Default bound of speeds [m/s]."""
    default_acceleration: float = 2.0
    """Default bound of accelerations [m/s^2]."""


_LIMITS = _Limits()
_DEFAULT_BOUNDS = Bounds()
_UNSUPPORTED_BOUNDS = ("jerk", "tension", "joint", "force", "voltage", "current")
"""Bounds that optimisations support, and plans do not."""


@dataclass(frozen=True, eq=False)
class DrivenBounds:
    """Bounds of the driven coordinates, as arrays.

    Attributes:
        speed: (n_vK,) largest |v_K| [m/s or rad/s].
        acceleration: (n_vK,) largest |acc_K| [m/s^2 or rad/s^2].
        low, high: (n_qK,) range of the coordinates [m or rad].
    """

    speed: Array
    acceleration: Array
    low: Array
    high: Array

    @property
    def movable(self) -> MaskRows:
        """(n_vK,) bool, the driven velocities that may be nonzero."""
        return (self.speed > 0.0) & (self.acceleration > 0.0)

    def reduced(self, reserve: float) -> DrivenBounds:
        """The bounds with speeds and accelerations reduced by a share of them."""
        rest = 1.0 - reserve
        return replace(self, speed=rest * self.speed, acceleration=rest * self.acceleration)

    @classmethod
    def from_bounds(cls, marionette: Marionette, bounds: Bounds) -> DrivenBounds:
        """The bounds of a task.

        Args:
            marionette: the puppet.
            bounds: position, speed, acceleration, and velocities that stay 0. Lengths stay
                positive. A coordinate that a motor drives may have the name of its command.

        Raises:
            UnknownNameError: name that is not a driven coordinate.
            StateError: bound out of range or not supported, coordinate named twice, no coordinate
                that moves, or a puppet with driven rotations.
        """
        table = marionette.coordinates
        if table.quaternions_K:
            raise StateError("plans move points and lengths; this puppet has a driven rotation")
        if unsupported := [
            name
            for name in _UNSUPPORTED_BOUNDS
            if getattr(bounds, name) != getattr(_DEFAULT_BOUNDS, name)
        ]:
            raise StateError(
                f"plans do not support bounds of {', '.join(unsupported)}; give position, speed, "
                "acceleration, held, clearance and own_body"
            )
        magnitudes = {
            "speed": _magnitudes(table, bounds.speed, "speed", _LIMITS.default_speed),
            "acceleration": _magnitudes(
                table, bounds.acceleration, "acceleration", _LIMITS.default_acceleration
            ),
        }
        held = list(resolve_driven(table, table.q_K, dict.fromkeys(bounds.held), "held"))
        for magnitude in magnitudes.values():
            magnitude[held] = 0.0
        if not np.any((magnitudes["speed"] > 0.0) & (magnitudes["acceleration"] > 0.0)):
            raise StateError("no driven coordinate may move: speed or acceleration is 0 for all")
        low, high = np.full(table.n_qK, -np.inf), np.full(table.n_qK, np.inf)
        for string in (*marionette.tree.strings, *marionette.tree.chains):
            driven = marionette.tree.commanding_length(string)
            if driven is not None:
                low[driven[0]] = _LIMITS.min_length
        positions = resolve_driven(table, table.q_K, bounds.position, "range")
        for k, (name, (lower, upper)) in positions.items():
            if not lower < upper:
                raise StateError(f"the range of {name} is {lower} to {upper}; it must not be empty")
            low[k], high[k] = max(low[k], lower), upper
        return cls(**magnitudes, low=low, high=high)


def _magnitudes(table: CoordinateTable, bounds: Magnitudes, label: str, default: float) -> Array:
    """(n_qK,) bounds of all driven coordinates; 0 for those that a mapping does not name."""
    if not isinstance(bounds, Mapping):
        bounds = dict.fromkeys(table.q_K, default if bounds == np.inf else bounds)
    magnitudes, upper = np.zeros(table.n_qK), _LIMITS.max_bound
    for k, (name, value) in resolve_driven(table, table.q_K, bounds, label).items():
        if not 0.0 <= value <= upper:
            raise StateError(
                f"the {label} of {name} is {value}; it must be at least 0 and at most {upper:g}"
            )
        magnitudes[k] = value
    return magnitudes
