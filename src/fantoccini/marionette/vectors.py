"""Checks of numbers given by a caller: finite, positive, of the right shape."""

from __future__ import annotations

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import StateError


def check_positive(**values: float) -> None:
    """Raises ValueError unless all are finite numbers greater than 0."""
    for name, value in values.items():
        number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
        if not (number and np.isfinite(value) and value > 0):
            raise ValueError(f"{name} is {value!r}; it must be a finite number greater than 0")


def vector(name: str, values: Array | None, n: int) -> Array:
    """(n,) finite numbers, zeros when None; anything else is a StateError."""
    if values is None:
        return np.zeros(n)
    if np.shape(values) != (n,):
        raise StateError(f"{name} has the shape {np.shape(values)}; it must be {(n,)}")
    return vectors(name, values, n)


def vectors(name: str, values: Array, n: int) -> Array:
    """(..., n) finite numbers; anything else is a StateError."""
    try:
        made = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise StateError(f"{name}: found {values!r}; it takes {n} numbers") from None
    if not made.ndim or made.shape[-1] != n:
        raise StateError(f"{name} has the shape {made.shape}; it must be (..., {n})")
    if not np.all(np.isfinite(made)):
        at = tuple(int(i) for i in np.argwhere(~np.isfinite(made))[0])
        raise StateError(f"{name}[{', '.join(map(str, at))}] is {made[at]}; it must be finite")
    return made
