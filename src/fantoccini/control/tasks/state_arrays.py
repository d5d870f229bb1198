"""Many states of a puppet as arrays.

q_D are dynamic and q_K driven coordinates, v_D and v_K their velocities; slip is the length that
each winch has let out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fantoccini.base import Array, ShortRepr
from fantoccini.kernel.runtime import STATE
from fantoccini.motion import State


@dataclass(frozen=True, eq=False, repr=False)
class StateArrays(ShortRepr):
    """Many states of a puppet, as arrays with the same leading axes.

    Attributes:
        q_D, v_D, slip, q_K, v_K: (..., n) fields of :class:`fantoccini.State`.
    """

    q_D: Array
    v_D: Array
    slip: Array
    q_K: Array
    v_K: Array

    @classmethod
    def of(cls, *states: State) -> StateArrays:
        """Single states, stacked."""
        return cls(*(np.array([getattr(x, name) for x in states]) for name in STATE))

    def __getitem__(self, index: Any) -> StateArrays:
        return StateArrays(*(getattr(self, name)[index] for name in STATE))

    @property
    def parts(self) -> dict[str, Array]:
        """Name of a field -> array."""
        return {name: getattr(self, name) for name in STATE}

    @property
    def flat(self) -> StateArrays:
        """The same with one leading axis."""
        return StateArrays(*(flattened(a) for a in self.parts.values()))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the leading axes."""
        return self.q_D.shape[:-1]


def flattened(a: Array) -> Array:
    """(..., width) as (n, width); the width may be 0."""
    return a.reshape(math.prod(a.shape[:-1]), a.shape[-1])
