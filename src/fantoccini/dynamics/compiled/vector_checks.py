"""Checks of arrays given by a caller: finite, of the right shape."""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, StateError, floats


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
        made = floats(values)
    except (TypeError, ValueError):
        raise StateError(f"{name}: found {values!r}; it takes {n} real numbers") from None
    if not made.ndim or made.shape[-1] != n:
        raise StateError(f"{name} has the shape {made.shape}; it must be (..., {n})")
    if not np.isfinite(made).all():
        at = tuple(int(i) for i in np.argwhere(~np.isfinite(made))[0])
        raise StateError(f"{name}[{', '.join(map(str, at))}] is {made[at]}; it must be finite")
    return made
