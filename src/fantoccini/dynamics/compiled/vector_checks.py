"""Checks of a caller's arrays: finite numbers of the right shape."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fantoccini.base import Array, StateError, floats


def vector(name: str, values: ArrayLike | None, n: int) -> Array:
    """Finite numbers (n,), zeros for None; anything else is a StateError."""
    if values is None:
        return np.zeros(n)
    if np.shape(values) != (n,):
        raise StateError(f"{name} has the shape {np.shape(values)}; it must be {(n,)}")
    return vectors(name, values, n)


def vectors(name: str, values: ArrayLike, n: int) -> Array:
    """Finite numbers (..., n); anything else is a StateError."""
    try:
        array = floats(values)
    except (TypeError, ValueError):
        raise StateError(f"{name}: found {values!r}; it takes {n} real numbers") from None
    if not array.ndim or array.shape[-1] != n:
        raise StateError(f"{name} has the shape {array.shape}; it must be (..., {n})")
    if not np.isfinite(array).all():
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise StateError(
            f"{name}[{', '.join(map(str, index))}] is {array[index]}; it must be finite"
        )
    return array
