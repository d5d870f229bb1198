"""Rotations as unit quaternions (w, x, y, z) and rotation vectors, vectorised over leading axes.

R(t) = R_0 exp([phi(t)]x) turns with the angular velocity (in the turning frame)

  w = J_r(phi) phidot,      J_r = I - a Phi + b Phi^2,     Phi = [phi]x,
  a = (1 - cos x)/x^2,  b = (x - sin x)/x^3,  x = |phi|.

The coefficients lose digits near x = 0, where their series are used instead.

A rotation vector is axis times angle, and [phi]x the matrix of the cross product with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fantoccini.base.arrays import Array, Quaternion, Vec3
from fantoccini.base.vectors import cross, perpendicular

Rows = list[list[Any]]
"""Three rows of three entries."""

_MAX_OPPOSITE = 1e-9
"""1 + cos(angle) below which two directions are opposite."""

_MAX_SERIES_ANGLE = 1.0  # rad
"""Angle below which the series are used; 10 terms reach the last bit there."""

_TERMS = range(10)
_A = [(-1.0) ** k / factorial(2 * k + 2) for k in _TERMS]
_B = [(-1.0) ** k / factorial(2 * k + 3) for k in _TERMS]
_A_RATE = [2.0 * (k + 1) * (-1.0) ** (k + 1) / factorial(2 * k + 4) for k in _TERMS]
_B_RATE = [2.0 * (k + 1) * (-1.0) ** (k + 1) / factorial(2 * k + 5) for k in _TERMS]
# |B_2k| / (2k)! with the Bernoulli numbers B_2k.
_C = [
    1 / 12,
    1 / 720,
    1 / 30240,
    1 / 1209600,
    1 / 47900160,
    691 / 1307674368000,
    1 / 74724249600,
    3617 / 10670622842880000,
    43867 / 5109094217170944000,
    174611 / 802857662698291200000,
]


def multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """Quaternion product p q: R(p q) = R(p) R(q)."""
    p, q = np.asarray(p, dtype=float), np.asarray(q, dtype=float)
    p_w, p_v = p[..., :1], p[..., 1:]
    q_w, q_v = q[..., :1], q[..., 1:]
    w = p_w * q_w - np.sum(p_v * q_v, axis=-1, keepdims=True)
    return np.concatenate([w, p_w * q_v + q_w * p_v + cross(p_v, q_v)], axis=-1)


def conjugate(q: Quaternion) -> Quaternion:
    """The inverse of a unit quaternion."""
    return np.asarray(q, dtype=float) * np.array([1.0, -1.0, -1.0, -1.0])


def normalised(q: Quaternion) -> Quaternion:
    """The unit quaternion q / |q|; q must not be zero."""
    q = np.asarray(q, dtype=float)
    q = q / np.max(np.abs(q), axis=-1, keepdims=True)
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def exp(phi: Vec3) -> Quaternion:
    """Unit quaternion (cos(x/2), sin(x/2)/x phi) of a rotation vector phi, x = |phi|.

    Args:
        phi: (..., 3) rotation vector [rad].

    Returns:
        (..., 4) unit quaternion [1].
    """
    phi = np.asarray(phi, dtype=float)
    x = np.linalg.norm(phi, axis=-1, keepdims=True)
    return np.concatenate([np.cos(x / 2), 0.5 * np.sinc(x / (2 * np.pi)) * phi], axis=-1)


def log(q: Quaternion) -> Vec3:
    """Shortest rotation vector of a unit quaternion; q and -q give the same, |phi| <= pi.

    Args:
        q: (..., 4) unit quaternion [1].

    Returns:
        (..., 3) rotation vector [rad].
    """
    q = np.asarray(q, dtype=float)
    q = np.where(q[..., :1] < 0, -q, q)
    w, vector = q[..., :1], q[..., 1:]
    n = np.linalg.norm(vector, axis=-1, keepdims=True)
    scale = np.where(n > 0, np.arctan2(n, w) / np.where(n > 0, n, 1.0), 1.0)
    return 2.0 * scale * vector


def between(p: Quaternion, q: Quaternion) -> Vec3:
    """(..., 3) rotation vector [rad] from p to q, in the frame of p (and of q)."""
    return log(multiply(conjugate(p), q))


def continuous(q: Quaternion) -> Quaternion:
    """(n, 4) quaternions of the same rotations, with signs that make neighbours closest."""
    q = np.asarray(q, dtype=float)
    signs = np.where(np.sum(q[1:] * q[:-1], axis=-1) < 0, -1.0, 1.0)
    return q * np.concatenate([[1.0], np.cumprod(signs)])[:, None]


def shortest(a: Vec3, b: Vec3) -> Quaternion:
    """The smallest rotations that turn unit vectors a into unit vectors b.

    Args:
        a, b: (..., 3) [1].

    Returns:
        (..., 4) unit quaternions [1]; opposite vectors turn about a perpendicular axis.
    """
    a, b = np.broadcast_arrays(a, b)
    w = 1.0 + np.sum(a * b, axis=-1, keepdims=True)
    half_turns = np.concatenate([np.zeros_like(w), perpendicular(a)], axis=-1)
    quaternions = np.concatenate([w, cross(a, b)], axis=-1)
    return normalised(np.where(w < _MAX_OPPOSITE, half_turns, quaternions))


def quaternion(R: Array) -> Quaternion:
    """(..., 4) unit quaternions of rotation matrices (..., 3, 3).

    Rows of 4 q q^T are multiples of q; the one of the largest w^2, x^2, y^2 or z^2 is taken.
    """
    R = np.asarray(R, dtype=float)
    a, b, c, d, e, f, g, h, i = R.reshape(-1, 9).T
    rows = [
        [1.0 + a + e + i, h - f, c - g, d - b],
        [h - f, 1.0 + a - e - i, b + d, c + g],
        [c - g, b + d, 1.0 - a + e - i, f + h],
        [d - b, c + g, f + h, 1.0 - a - e + i],
    ]
    products = np.array(rows)
    largest = products[range(4), range(4)].argmax(axis=0)
    q = products[largest, :, np.arange(len(largest))]
    return (q / np.sqrt((q * q).sum(axis=-1, keepdims=True))).reshape(*R.shape[:-2], 4)


def matrix(q: Quaternion) -> Array:
    """(..., 3, 3) rotation matrix of a unit quaternion."""
    q = np.asarray(q, dtype=float)
    return _matrix(matrix_rows(q[..., 0], q[..., 1], q[..., 2], q[..., 3]))


def matrix_rows(w: Any, x: Any, y: Any, z: Any) -> Rows:
    """Rows of the rotation matrix of a unit quaternion of numbers, arrays or symbols."""
    X, Y, Z = 2 * x, 2 * y, 2 * z
    xx, yy, zz, xy, xz, yz = x * X, y * Y, z * Z, x * Y, x * Z, y * Z
    wx, wy, wz = w * X, w * Y, w * Z
    return [
        [1 - (yy + zz), xy - wz, xz + wy],
        [xy + wz, 1 - (xx + zz), yz - wx],
        [xz - wy, yz + wx, 1 - (xx + yy)],
    ]


def about(axis: Vec3, c: ArrayLike, s: ArrayLike) -> Array:
    """(..., 3, 3) R = 1 + s [a]x + (1 - c) [a]x^2 about unit axes, c = cos, s = sin of the angle.

    Quarter turns about x, y and z have entries 0, which make expressions of a puppet shorter.

    Args:
        axis: (..., 3) [1].
        c, s: (...) cosine and sine of the angle.
    """
    a, c, s = skew(axis), np.asarray(c)[..., None, None], np.asarray(s)[..., None, None]
    return np.eye(3) + s * a + (1 - c) * a @ a


def about_rows(axis: Sequence[float], c: Any, s: Any) -> Rows:
    """Rows of R = c 1 + s [a]x + (1 - c) a a^T about a unit axis; c and s may be symbols.

    An axis x, y or z leaves the fewest operations.
    """
    a_cross = skew_rows(*axis)
    return [
        [((i == j) - a * b) * c + a_cross[i][j] * s + a * b for j, b in enumerate(axis)]
        for i, a in enumerate(axis)
    ]


def skew(phi: Vec3) -> Array:
    """(..., 3, 3) matrix [phi]x with [phi]x u = phi x u."""
    phi = np.asarray(phi, dtype=float)
    return _matrix(skew_rows(phi[..., 0], phi[..., 1], phi[..., 2]))


def skew_rows(x: Any, y: Any, z: Any) -> Rows:
    """Rows of [phi]x, of numbers, arrays or symbols."""
    return [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]


def nearest_angle(angle: Any, reference: Any) -> Any:
    """An angle shifted by whole turns to within half a turn of another [rad]."""
    return angle - math.tau * np.round((angle - reference) / math.tau)


def right_jacobian(phi: Vec3) -> Array:
    """J_r(phi) = I - a Phi + b Phi^2, for which w = J_r phidot.

    Args:
        phi: (..., 3) rotation vector [rad].

    Returns:
        (..., 3, 3) [1].
    """
    a, b, _, _ = _coefficients(phi)
    cross = skew(phi)
    return np.eye(3) - a * cross + b * (cross @ cross)


def right_jacobian_inverse(phi: Vec3) -> Array:
    """J_r^-1(phi) = I + Phi/2 + c Phi^2, c = (1 - x/2 cot(x/2))/x^2; singular at 2 pi.

    Args:
        phi: (..., 3) rotation vector [rad].

    Returns:
        (..., 3, 3) [1].
    """
    xx = np.sum(np.square(phi), axis=-1)[..., None, None]
    is_small = xx < _MAX_SERIES_ANGLE**2
    x = np.sqrt(np.where(is_small, 1.0, xx))
    c = np.where(
        is_small, _sum(_C, np.where(is_small, xx, 0.0)), (1 - x / 2 / np.tan(x / 2)) / x**2
    )
    cross = skew(phi)
    return np.eye(3) + 0.5 * cross + c * (cross @ cross)


def right_jacobian_rate(phi: Vec3, rate: Vec3) -> Array:
    """d/dt J_r(phi(t)), the chain rule through a, b and Phi.

    Args:
        phi: (..., 3) rotation vector [rad].
        rate: (..., 3) phidot [rad/s].

    Returns:
        (..., 3, 3) [1/s].
    """
    a, b, a_rate, b_rate = _coefficients(phi)
    phi_rate = np.sum(np.asarray(phi) * rate, axis=-1)[..., None, None]
    cross, rate_cross = skew(phi), skew(rate)
    return (
        -a_rate * phi_rate * cross
        - a * rate_cross
        + b_rate * phi_rate * (cross @ cross)
        + b * (cross @ rate_cross + rate_cross @ cross)
    )


def body_motion(phi: Vec3, rate: Vec3, second_rate: Vec3) -> tuple[Vec3, Vec3]:
    """w = J_r phidot and wdot = J_r phiddot + (dJ_r/dt) phidot, in the turning frame.

    Args:
        phi: (..., 3) rotation vector [rad].
        rate: (..., 3) phidot [rad/s].
        second_rate: (..., 3) phiddot [rad/s^2].

    Returns:
        Angular velocity (..., 3) [rad/s] and acceleration (..., 3) [rad/s^2].
    """
    jacobian = right_jacobian(phi)
    return apply(jacobian, rate), apply(jacobian, second_rate) + apply(
        right_jacobian_rate(phi, rate), rate
    )


def tangent_motion(phi: Vec3, w: Vec3, wdot: Vec3) -> tuple[Vec3, Vec3]:
    """The inverse of :func:`body_motion`: phidot and phiddot from w and wdot.

    Args:
        phi: (..., 3) rotation vector [rad], shorter than 2 pi.
        w: (..., 3) angular velocity in the turning frame [rad/s].
        wdot: (..., 3) its rate [rad/s^2].

    Returns:
        phidot (..., 3) [rad/s] and phiddot (..., 3) [rad/s^2].
    """
    inverse = right_jacobian_inverse(phi)
    rate = apply(inverse, w)
    return rate, apply(inverse, wdot - apply(right_jacobian_rate(phi, rate), rate))


def apply(matrices: Array, vectors: Vec3) -> Vec3:
    """(..., 3, 3) matrices times (..., 3) vectors."""
    return (matrices @ np.asarray(vectors)[..., None])[..., 0]


def _coefficients(phi: Vec3) -> tuple[Array, Array, Array, Array]:
    """a, b and their derivatives by x divided by x, each (..., 1, 1)."""
    xx = np.sum(np.square(phi), axis=-1)[..., None, None]
    is_small = xx < _MAX_SERIES_ANGLE**2
    small, x = np.where(is_small, xx, 0.0), np.sqrt(np.where(is_small, 1.0, xx))
    s, v = np.sin(x), 2 * np.sin(x / 2) ** 2
    return (
        np.where(is_small, _sum(_A, small), v / x**2),
        np.where(is_small, _sum(_B, small), (x - s) / x**3),
        np.where(is_small, _sum(_A_RATE, small), (x * s - 2 * v) / x**4),
        np.where(is_small, _sum(_B_RATE, small), (x * v - 3 * (x - s)) / x**5),
    )


def _matrix(rows: Rows) -> Array:
    """(..., 3, 3) matrices from rows of arrays (...); entries on the diagonal may be constants."""
    out = np.empty((*np.shape(rows[0][1]), 3, 3))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            out[..., i, j] = entry
    return out


def _sum(series: list[float], xx: Array) -> Array:
    total = np.zeros_like(xx)
    for term in reversed(series):
        total = total * xx + term
    return total
