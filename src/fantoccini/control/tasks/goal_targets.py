"""Checked targets and weights of goals; their coordinates by name.

q_D are the dynamic coordinates, n_vD is the number of their velocities.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fantoccini.base import Array, StateError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import CoordinateTable

Target = float | Sequence[float]
"""A value, the ends of an interval, or a rotation of three or four numbers."""


def interval_ends(name: str, value: Target, is_rotation: bool) -> tuple[Target, Target]:
    """The ends of the interval of a target."""
    if is_rotation or isinstance(value, (float, int)) or np.ndim(value) == 0:
        return value, value
    if np.shape(value) != (2,):
        raise StateError(f"{name}: found {value!r}; needed: a number or two")
    low, high = value
    if not low <= high:
        raise StateError(f"{name}: {low} to {high}; the first end must not be above the second")
    return low, high


def coordinate_weights(marionette: Marionette, by_name: Mapping[str, float]) -> Array:
    """(n_vD,) the weight of every coordinate, at its first velocity."""
    table, weights = marionette.coordinates, np.zeros(marionette.coordinates.n_vD)
    first_velocity = dict((*table.scalars_D, *table.quaternions_D))
    for name, (q, _) in goal_coordinates(table).items():
        weights[first_velocity[q]] = by_name.get(name, 0.0)
    return weights


def checked_weight(speed_weight: float) -> float:
    if not 0.0 <= speed_weight < np.inf:
        raise StateError(f"a speed's weight is {speed_weight}; it must be at least 0 [s]")
    return float(speed_weight)


def checked_vector(label: str, vector: Sequence[float]) -> Array:
    array = np.asarray(vector, dtype=float)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise StateError(f"a point's {label} is {vector!r}; needed: three numbers")
    return array


def goal_coordinates(table: CoordinateTable) -> dict[str, tuple[int, bool]]:
    """Names of dynamic coordinates -> (index in q_D, whether it is a quaternion)."""
    indices = {table.q_D[q]: (q, False) for q, _ in table.scalars_D}
    for q, _ in table.quaternions_D:
        indices[table.q_D[q].rsplit(".", 1)[0] + ".rotation"] = (q, True)
    return indices
