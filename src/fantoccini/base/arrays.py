"""Array aliases named after their shapes, and checks of a caller's numbers.

The last axis is always the coordinate; lane and time come before it. The names are those of the
coordinate table: n_qD, n_vD, n_qK, n_vK configuration numbers and velocities of the dynamic and
the driven coordinates, n_rows one-sided rows (strings, then limits).

Dynamic coordinates move by the equations of motion; driven ones, ends and lengths of strings and
driven joints, are given as functions of time. A lane is one of several runs.
"""

from __future__ import annotations

from typing import Any, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

Array = NDArray[np.float64]
"""Any shape."""

Mask = NDArray[np.bool_]
"""Any shape, flags."""

Indices = NDArray[np.integer[Any]]
"""Any shape, indices of arrays."""

ConfigD = NDArray[np.float64]
"""(n_qD,) dynamic configuration [rad, m or 1]."""

VecD = NDArray[np.float64]
"""(n_vD,) dynamic velocity, acceleration or force."""

ConfigK = NDArray[np.float64]
"""(n_qK,) driven configuration [rad, m or 1]."""

VecK = NDArray[np.float64]
"""(n_vK,) driven velocity, acceleration or force."""

MaskRows = NDArray[np.bool_]
"""(n_rows,) flags of strings and limits."""

Times = NDArray[np.float64]
"""(T,) times [s]."""

Vec3 = NDArray[np.float64]
"""(..., 3) vector in space."""

Quaternion = NDArray[np.float64]
"""(..., 4) unit quaternion, in the order w, x, y, z."""


_MAX_FLOAT = float(np.finfo(float).max)
"""Largest finite float. Larger integers would pass a comparison with infinity."""


def check_positive(**values: object) -> None:
    """Raises ValueError unless all are finite numbers greater than 0."""
    for name, value in values.items():
        if not (is_number(value) and 0.0 < value <= _MAX_FLOAT):
            raise ValueError(f"{name} is {value!r}; it must be a finite number greater than 0")


def check_not_negative(**values: object) -> None:
    """Raises ValueError unless all are finite numbers of at least 0."""
    for name, value in values.items():
        if not (is_number(value) and 0.0 <= value <= _MAX_FLOAT):
            raise ValueError(f"{name} is {value!r}; it must be a finite number of at least 0")


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value is a real number: neither a flag nor text."""
    number = isinstance(value, (int, float, np.integer, np.floating))
    return number and not isinstance(value, bool)


def floats(values: ArrayLike) -> Array:
    """The values as floats; integers too large for a float become infinite, and checks fail.

    Raises:
        TypeError: complex numbers, whose imaginary part a conversion would drop, or text.
        ValueError: rows of different lengths.
    """
    array = np.asarray(values)
    if array.dtype.kind == "c":
        raise TypeError("found complex numbers; allowed: real ones, such as x.real")
    if array.dtype.kind in "SU":
        raise TypeError(f"found text, {array.flat[0] if array.size else ''!r}; allowed: numbers")
    try:
        return array.astype(np.float64, copy=False)
    except OverflowError:
        return np.array([_float(x) for x in array.ravel()]).reshape(array.shape)


def _float(value: Any) -> float:
    try:
        return float(value)
    except OverflowError:
        return np.inf if value > 0 else -np.inf


def read_only(values: ArrayLike, dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """:func:`frozen`, without a copy if the array is read-only already."""
    array = np.asarray(values)
    matches = array.dtype == dtype and array.flags.c_contiguous
    return array if matches and not array.flags.writeable else frozen(values, dtype)


def frozen(values: ArrayLike, dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """A read-only, C-contiguous copy of the values; complex numbers and text are a TypeError."""
    numbers = floats(values) if dtype in (float, np.float64) else values
    copy = np.array(numbers, dtype=dtype, order="C", copy=True)
    copy.setflags(write=False)
    return copy
