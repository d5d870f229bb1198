"""Parameters of a puppet that are chosen along with its motion.

A parameter is a number that the puppet file names, such as a length. v_D and v_K are dynamic and
driven velocities.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError, tangent
from fantoccini.dynamics.derivatives import motion_at
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State

_MAX_REST_ACCELERATION = 1e-6
"""Largest acceleration of a start that counts as hanging at rest [m/s^2 or rad/s^2]."""
_RELATIVE_STEP = 1e-5
"""Step of differences with respect to parameters, relative to their intervals."""


class ChosenParameters:
    """Intervals of chosen parameters, and the start of the puppet for given values.

    If the puppet hangs at rest with its own parameters, it also starts at rest with other values,
    with the same driven coordinates. Other starts are projected onto the strings.

    Attributes:
        names: names of the parameters.
        low, high: (n,) their lowest and highest values.
        default_values: (n,) the puppet's own values.

    Args:
        marionette, x0: the puppet and its start.
        parameters: name -> lowest and highest value.

    Raises:
        UnknownNameError: unknown name of a parameter.
        StateError: interval without the puppet's own value.
    """

    def __init__(
        self, marionette: Marionette, x0: State, parameters: Mapping[str, tuple[float, float]]
    ):
        index, p = marionette.parameter_index, marionette.p
        self.names = tuple(parameters)
        for name, (low, high) in parameters.items():
            if name not in index:
                raise UnknownNameError("parameter", name, list(index))
            value = p[index[name]]
            if not low <= value <= high or not low < high or not np.isfinite(low + high):
                raise StateError(
                    f"the parameter {name} is {value:g}, with bounds {low:g} to {high:g}; "
                    "needed: finite bounds on both sides of it"
                )
            for bound in (low, high):
                marionette.with_parameters({name: bound})
        self.columns = [index[name] for name in self.names]
        bounds = np.array(list(parameters.values()), dtype=float).reshape(-1, 2)
        self.low, self.high, self.default_values = bounds[:, 0], bounds[:, 1], p[self.columns]
        self._marionette, self._x0 = marionette, x0
        # A search evaluates a motion several times with the same parameters and their neighbours.
        self._cached = lru_cache(maxsize=4 * len(self.names) + 2)(self._start_with)

    def __len__(self) -> int:
        return len(self.names)

    def marionette(self, values: Array) -> Marionette:
        """The puppet with these values."""
        return self._cached(tuple(values.tolist()))[0]

    def start(self, values: Array) -> State:
        """The start with these values.

        Raises:
            StateError: values with which the puppet cannot start.
        """
        return self._cached(tuple(values.tolist()))[1]

    def neighbours(self, values: Array) -> list[tuple[Array, Array]]:
        """For every parameter, values slightly below and above, within its bounds."""
        step = _RELATIVE_STEP * (self.high - self.low)
        pairs = []
        for i in range(len(self)):
            below, above = values.copy(), values.copy()
            below[i] = max(values[i] - step[i], self.low[i])
            above[i] = min(values[i] + step[i], self.high[i])
            pairs.append((below, above))
        return pairs

    def start_derivatives(self, values: Array) -> Array:
        """(n_z, n) derivatives of the start with respect to the parameters, by differences."""
        table = self._marionette.coordinates
        n = table.n_vD
        derivatives = np.zeros((2 * (n + table.n_vK), len(self)))
        for i, (below, above) in enumerate(self.neighbours(values)):
            start_below = self.start(below)
            start_above = self.start(above)
            difference = above[i] - below[i]
            change = tangent.between(
                table.scalars_D,
                table.quaternions_D,
                start_below.q_D[None],
                start_above.q_D[None],
                n,
            )[0]
            derivatives[:n, i] = change / difference
            derivatives[n : 2 * n, i] = (start_above.v_D - start_below.v_D) / difference
        return derivatives

    def _start_with(self, values: tuple[float, ...]) -> tuple[Marionette, State]:
        if not values:
            return self._marionette, self._x0
        marionette = self._marionette.with_parameters(dict(zip(self.names, values, strict=True)))
        if np.array_equal(values, self.default_values):
            return marionette, self._x0
        if self._hangs_at_rest:
            return marionette, marionette.rest(self._x0)
        return marionette, marionette.project(self._x0)

    @property
    def _hangs_at_rest(self) -> bool:
        x0 = self._x0
        if np.any(x0.v_D) or np.any(x0.v_K):
            return False
        try:
            return bool(
                np.max(np.abs(motion_at(self._marionette, x0).acc_D)) < _MAX_REST_ACCELERATION
            )
        except StateError:  # an impact, after which it moves
            return False
