"""Parameters of a puppet that are chosen along with its motion."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError, tangent
from fantoccini.dynamics.derivatives import motion_at
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State

_AT_REST = 1e-6
"""Accelerations of a start that hangs at rest [m/s^2 or rad/s^2]."""
_STEP = 1e-5
"""Of differences by parameters, relative to what they may be."""


class Chosen:
    """What parameters may be, and where the puppet starts with them.

    A puppet that hangs at rest with its own parameters does so with the others, its driven
    coordinates unmoved. Any other start is projected onto the strings.

    Attributes:
        names: of the parameters.
        low, high: (n,) their least and largest values.
        first: (n,) the puppet's own.

    Args:
        marionette, x0: the puppet, and where it starts.
        parameters: name -> lowest and highest value.

    Raises:
        UnknownNameError: a name that is none.
        StateError: bounds that the puppet's own value does not lie between.
    """

    def __init__(
        self, marionette: Marionette, x0: State, parameters: Mapping[str, tuple[float, float]]
    ):
        index, p = marionette.parameter_index, marionette.p
        self.names = tuple(parameters)
        for name, (low, high) in parameters.items():
            if name not in index:
                raise UnknownNameError("parameter", name, list(index))
            own = p[index[name]]
            if not low <= own <= high or not low < high or not np.isfinite(low + high):
                raise StateError(
                    f"the parameter {name} is {own:g} and is to lie from {low:g} to {high:g}; "
                    "needed: finite bounds that it lies between"
                )
            for end in (low, high):
                marionette.with_parameters({name: end})
        self.columns = [index[name] for name in self.names]
        ends = np.array(list(parameters.values()), dtype=float).reshape(-1, 2)
        self.low, self.high, self.first = ends[:, 0], ends[:, 1], p[self.columns]
        self._marionette, self._x0 = marionette, x0
        # One motion is looked at several times with the same parameters, and their neighbours.
        self._with = lru_cache(maxsize=4 * len(self.names) + 2)(self._made)

    def __len__(self) -> int:
        return len(self.names)

    def marionette(self, values: Array) -> Marionette:
        """The puppet with these values."""
        return self._with(tuple(values.tolist()))[0]

    def start(self, values: Array) -> State:
        """Where it starts with these values.

        Raises:
            StateError: the puppet cannot start with them.
        """
        return self._with(tuple(values.tolist()))[1]

    def neighbours(self, values: Array) -> list[tuple[Array, Array]]:
        """For every parameter, values a little below and above; equal to them at a bound."""
        step = _STEP * (self.high - self.low)
        found = []
        for i in range(len(self)):
            below, above = values.copy(), values.copy()
            below[i] = max(values[i] - step[i], self.low[i])
            above[i] = min(values[i] + step[i], self.high[i])
            found.append((below, above))
        return found

    def start_by(self, values: Array) -> Array:
        """(n_z, n) derivatives of the start, by differences."""
        t = self._marionette.coordinates
        n = t.n_vD
        out = np.zeros((2 * (n + t.n_vK), len(self)))
        for i, (below, above) in enumerate(self.neighbours(values)):
            a, b, over = self.start(below), self.start(above), above[i] - below[i]
            moved = tangent.between(t.scalars_D, t.quaternions_D, a.q_D[None], b.q_D[None], n)[0]
            out[:n, i], out[n : 2 * n, i] = moved / over, (b.v_D - a.v_D) / over
        return out

    def _made(self, values: tuple[float, ...]) -> tuple[Marionette, State]:
        if not values:
            return self._marionette, self._x0
        made = self._marionette.with_parameters(dict(zip(self.names, values, strict=True)))
        if np.array_equal(values, self.first):
            return made, self._x0
        if self._rests:
            return made, made.rest(self._x0)
        return made, made.project(self._x0)

    @property
    def _rests(self) -> bool:
        x0 = self._x0
        if np.any(x0.v_D) or np.any(x0.v_K):
            return False
        try:
            return bool(np.max(np.abs(motion_at(self._marionette, x0).acc_D)) < _AT_REST)
        except StateError:  # an impact, after which it moves
            return False
