"""Small symbolic vectors and matrices: NumPy arrays of dtype object that hold CasADi scalars.

Products with the constants 0 and 1 are simplified when they are built, so that sparse joint axes
and aligned frames need no operations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from fantoccini.base import rotation


class Regularisation(NamedTuple):
    """Numbers that keep expressions finite and differentiable at singular points.

    Attributes:
        segment: length of a segment between coincident points [m].
        square: term added to a square under a root, so that the root has the derivative 0 at 0.
        same: relative difference below which two forces are equal.
    """

    segment: float = 1e-9
    square: float = 1e-300
    same: float = 1e-12


REGULAR = Regularisation()


class Expression(ca.SX):
    """A CasADi scalar with fast operators.

    The operators of ``ca.SX`` first try the overloads of all types, which takes six times as long
    as the operation itself. A result with an Expression as an operand is an Expression.
    """

    def __neg__(self) -> Expression:
        return _expression(ca.SX.unary(ca.OP_NEG, self))


def _expression(sx: ca.SX) -> Expression:
    sx.__class__ = Expression
    assert isinstance(sx, Expression)
    return sx


def _operator(operation: int, reflected: bool) -> Callable[[Any, Any], Expression]:
    if reflected:
        return lambda a, b: _expression(ca.SX.binary(operation, b, a))
    return lambda a, b: _expression(ca.SX.binary(operation, a, b))


for _name, _code in (
    ("add", ca.OP_ADD),
    ("sub", ca.OP_SUB),
    ("mul", ca.OP_MUL),
    ("truediv", ca.OP_DIV),
):
    setattr(Expression, f"__{_name}__", _operator(_code, False))
    setattr(Expression, f"__r{_name}__", _operator(_code, True))


def symbolic(values: Any) -> np.ndarray:
    """An object array of CasADi scalars from numbers or scalars, of the same shape."""
    source = np.asarray(values, dtype=object)
    out = np.empty(source.shape, dtype=object)
    for index in np.ndindex(source.shape):
        out[index] = Expression(source[index])
    return out


def elements(vector: ca.SX) -> np.ndarray:
    """The entries of a CasADi column as an object array (n,)."""
    out = np.empty(vector.numel(), dtype=object)
    for k in range(vector.numel()):
        out[k] = Expression(vector[k])
    return out


def column(values: Iterable[Any]) -> ca.SX:
    """A dense CasADi column (n, 1) from a sequence of scalars."""
    dense: ca.SX = ca.densify(ca.vertcat(ca.SX(0, 1), *values))
    return dense


def matrix(values: np.ndarray) -> ca.SX:
    """A dense CasADi matrix from an object array (n, m)."""
    out = ca.SX(*values.shape)
    for i, j in np.ndindex(values.shape):
        out[i, j] = values[i, j]
    return ca.densify(out)


def stacked(rows: list[np.ndarray], n: int) -> ca.SX:
    """A dense CasADi matrix from rows (n,)."""
    return matrix(np.array(rows, dtype=object)) if rows else ca.SX(0, n)


def zeros(*shape: int) -> np.ndarray:
    """An object array of symbolic zeros."""
    return symbolic(np.zeros(shape))


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a x b of two 3-vectors."""
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]],
        dtype=object,
    )


def dot(a: np.ndarray, b: np.ndarray) -> ca.SX:
    """a . b of two vectors of equal length."""
    total = Expression(0)
    for x, y in zip(a, b, strict=True):
        total = total + x * y
    return total


def scaled(factor: ca.SX | float, values: np.ndarray) -> np.ndarray:
    """factor times an object array; ``factor * array`` would be CasADi's product."""
    out = np.empty(values.shape, dtype=object)
    for index in np.ndindex(values.shape):
        out[index] = values[index] * factor
    return out


def quaternion_rotation(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrix (3, 3) of a unit quaternion (w, x, y, z)."""
    return np.array(rotation.matrix_rows(*quaternion), dtype=object)
