"""Targets over time: the values that costs ask for.

A target is the path of a quantity: a constant, samples at times, or a function of time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

from fantoccini.base import Array, StateError, Times
from fantoccini.control.tasks.clip import Clip

Values: TypeAlias = float | Sequence[Any] | Array | Callable[[float], Any] | tuple[Any, Any]
"""A constant, a function of time, or a pair of times (T,) and values (T, ...)."""
Target: TypeAlias = Values | Clip
"""The same, or a clip of a run."""


def values_at(label: str, target: Values, t: Times, width: int) -> Array:
    """(len(t), width) values of a target: linear between samples, constant beyond them.

    Args:
        label: name of the target, for errors.
        target: see :data:`Values`.
        t: times [s].
        width: length of one value.

    Raises:
        StateError: values of another width, or not finite.
    """
    if callable(target):
        rows = np.array([np.ravel(target(float(time))) for time in t], dtype=float)
    elif isinstance(target, tuple) and len(target) == 2 and np.ndim(target[0]) == 1:
        times, values = np.asarray(target[0], float), np.asarray(target[1], float)
        values = values.reshape(len(values), -1)
        if len(times) != len(values) or len(times) == 0 or np.any(np.diff(times) <= 0.0):
            raise StateError(
                f"{label}: {len(times)} times and {len(values)} values; needed: as many rising "
                "times as values"
            )
        rows = np.stack([np.interp(t, times, column) for column in values.T], axis=1)
    else:
        rows = np.repeat(np.asarray(target, float).reshape(1, -1), len(t), axis=0)
    if rows.ndim != 2 or rows.shape[1] != width or not np.all(np.isfinite(rows)):
        raise StateError(
            f"{label}: the target has values of {rows.shape[-1]} numbers; needed: {width} finite "
            f"number{'s' if width > 1 else ''}"
        )
    return rows
