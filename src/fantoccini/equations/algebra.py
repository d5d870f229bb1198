"""Small symbolic vectors and matrices.

Plain NumPy arrays of dtype object hold CasADi scalars: products with the constants 0 and 1 vanish
while the expressions are built, so sparse joint axes and aligned frames cost nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np


class Regularisation(NamedTuple):
    """Numbers that keep expressions finite and differentiable at singular points.

    Attributes:
        segment: length of a segment between coincident points [m].
        square: added to a square under a root, so that the root has the derivative 0 at 0.
        same: relative difference below which two forces count as equal.
    """

    segment: float = 1e-9
    square: float = 1e-300
    same: float = 1e-12


REGULAR = Regularisation()


class Expression(ca.SX):
    """A CasADi expression with quick sums and products, entry by entry as those of ``ca.SX``.

    Those try the overloads of all types first, for six times as long as the operation takes. What
    an Expression is combined with becomes one.
    """

    def __add__(self, other):
        return _binary(ca.OP_ADD, self, other)

    def __radd__(self, other):
        return _binary(ca.OP_ADD, other, self)

    def __sub__(self, other):
        return _binary(ca.OP_SUB, self, other)

    def __rsub__(self, other):
        return _binary(ca.OP_SUB, other, self)

    def __mul__(self, other):
        return _binary(ca.OP_MUL, self, other)

    def __rmul__(self, other):
        return _binary(ca.OP_MUL, other, self)

    def __truediv__(self, other):
        return _binary(ca.OP_DIV, self, other)

    def __rtruediv__(self, other):
        return _binary(ca.OP_DIV, other, self)

    def __neg__(self):
        return _taken(ca.SX.unary(ca.OP_NEG, self))


def _binary(operation: int, a, b) -> Expression:
    return _taken(ca.SX.binary(operation, a, b))


def _taken(made: ca.SX) -> Expression:
    made.__class__ = Expression
    return made


def symbolic(values) -> np.ndarray:
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


def column(values) -> ca.SX:
    """A dense CasADi column (n, 1) from a sequence of scalars."""
    values = list(values)
    return ca.densify(ca.vertcat(*values)) if values else ca.SX(0, 1)


def matrix(values: np.ndarray) -> ca.SX:
    """A dense CasADi matrix from an object array (n, m)."""
    out = ca.SX(*values.shape)
    for i, j in np.ndindex(values.shape):
        out[i, j] = values[i, j]
    return ca.densify(out)


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


def scaled(factor, values: np.ndarray) -> np.ndarray:
    """factor times an object array. CasADi takes the product over where it meets an array."""
    out = np.empty(values.shape, dtype=object)
    for index in np.ndindex(values.shape):
        out[index] = values[index] * factor
    return out


def axis_rotation(axis: np.ndarray, angle: ca.SX) -> np.ndarray:
    """R = c 1 + s [a] + (1 - c) a a^T: rotation by an angle about a constant unit axis (3, 3)."""
    c, s = ca.cos(angle), ca.sin(angle)
    out = zeros(3, 3)
    skew = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    for i, j in np.ndindex(3, 3):
        outer = float(axis[i] * axis[j])
        diagonal = 1.0 if i == j else 0.0
        out[i, j] = (diagonal - outer) * c + float(skew[i, j]) * s + outer
    return out


def quaternion_rotation(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrix (3, 3) of a unit quaternion (w, x, y, z)."""
    w, x, y, z = quaternion
    X, Y, Z = 2 * x, 2 * y, 2 * z
    xx, yy, zz, xy, xz, yz = x * X, y * Y, z * Z, x * Y, x * Z, y * Z
    wx, wy, wz = w * X, w * Y, w * Z
    return np.array(
        [
            [1 - (yy + zz), xy - wz, xz + wy],
            [xy + wz, 1 - (xx + zz), yz - wx],
            [xz - wy, yz + wx, 1 - (xx + yy)],
        ],
        dtype=object,
    )
