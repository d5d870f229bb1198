"""Rotations as unit quaternions (w, x, y, z) and rotation vectors, vectorised over leading axes.

R(t) = R_0 exp([phi(t)]x) turns with the angular velocity (in the turning frame)

  w = J_r(phi) phidot,      J_r = I - a Phi + b Phi^2,     Phi = [phi]x,
  a = (1 - cos x)/x^2,  b = (x - sin x)/x^3,  x = |phi|.

The coefficients lose digits near x = 0, where their series are used instead.
"""

from __future__ import annotations

from math import factorial

import numpy as np

from fantoccini.base.arrays import Array, Quaternion, Vec3

_SERIES = 1.0
"""Angle [rad] below which the series are used; 10 terms reach the last bit there."""

_NEXT, _LAST = [1, 2, 0], [2, 0, 1]
"""Axes after and before x, y and z."""

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
    pw, pv = p[..., :1], p[..., 1:]
    qw, qv = q[..., :1], q[..., 1:]
    w = pw * qw - np.sum(pv * qv, axis=-1, keepdims=True)
    # NumPy's own cross product takes longer than all else here.
    cross = pv[..., _NEXT] * qv[..., _LAST] - pv[..., _LAST] * qv[..., _NEXT]
    return np.concatenate([w, pw * qv + qw * pv + cross], axis=-1)


def conjugate(q: Quaternion) -> Quaternion:
    """The inverse of a unit quaternion."""
    return np.asarray(q, dtype=float) * np.array([1.0, -1.0, -1.0, -1.0])


def normalised(q: Quaternion) -> Quaternion:
    """q / |q|; the quaternion must not be zero."""
    q = np.asarray(q, dtype=float)
    q = q / np.max(np.abs(q), axis=-1, keepdims=True)
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def exp(phi: Vec3) -> Quaternion:
    """Unit quaternion of exp([phi]x): (cos(x/2), sin(x/2)/x phi), x = |phi|.

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
    """The same rotations (n, 4) with signs such that neighbours lie less than 180 deg apart."""
    q = np.asarray(q, dtype=float)
    turn = np.where(np.sum(q[1:] * q[:-1], axis=-1) < 0, -1.0, 1.0)
    return q * np.concatenate([[1.0], np.cumprod(turn)])[:, None]


def matrix(q: Quaternion) -> Array:
    """(..., 3, 3) rotation matrix of a unit quaternion."""
    q = np.asarray(q, dtype=float)
    cross = skew(q[..., 1:])
    return np.eye(3) + 2 * (q[..., :1, None] * cross + cross @ cross)


def skew(phi: Vec3) -> Array:
    """(..., 3, 3) matrix [phi]x with [phi]x u = phi x u."""
    phi = np.asarray(phi, dtype=float)
    x, y, z = phi[..., 0], phi[..., 1], phi[..., 2]
    o = np.zeros_like(x)
    return np.stack(
        [np.stack([o, -z, y], -1), np.stack([z, o, -x], -1), np.stack([-y, x, o], -1)], -2
    )


def right_jacobian(phi: Vec3) -> Array:
    """J_r(phi) = I - a Phi + b Phi^2: w = J_r phidot.

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
    near = xx < _SERIES**2
    x = np.sqrt(np.where(near, 1.0, xx))
    c = np.where(near, _sum(_C, np.where(near, xx, 0.0)), (1 - x / 2 / np.tan(x / 2)) / x**2)
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
    along = np.sum(np.asarray(phi) * rate, axis=-1)[..., None, None]
    cross, turn = skew(phi), skew(rate)
    return (
        -a_rate * along * cross
        - a * turn
        + b_rate * along * (cross @ cross)
        + b * (cross @ turn + turn @ cross)
    )


def body_motion(phi: Vec3, rate: Vec3, curve: Vec3) -> tuple[Vec3, Vec3]:
    """w = J_r phidot and wdot = J_r phiddot + (dJ_r/dt) phidot, in the turning frame.

    Args:
        phi: (..., 3) rotation vector [rad].
        rate: (..., 3) phidot [rad/s].
        curve: (..., 3) phiddot [rad/s^2].

    Returns:
        Angular velocity (..., 3) [rad/s] and acceleration (..., 3) [rad/s^2].
    """
    jacobian = right_jacobian(phi)
    return apply(jacobian, rate), apply(jacobian, curve) + apply(
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
    near = xx < _SERIES**2
    small, x = np.where(near, xx, 0.0), np.sqrt(np.where(near, 1.0, xx))
    s, v = np.sin(x), 2 * np.sin(x / 2) ** 2
    return (
        np.where(near, _sum(_A, small), v / x**2),
        np.where(near, _sum(_B, small), (x - s) / x**3),
        np.where(near, _sum(_A_RATE, small), (x * s - 2 * v) / x**4),
        np.where(near, _sum(_B_RATE, small), (x * v - 3 * (x - s)) / x**5),
    )


def _sum(series: list[float], xx: Array) -> Array:
    total = np.zeros_like(xx)
    for term in reversed(series):
        total = total * xx + term
    return total
