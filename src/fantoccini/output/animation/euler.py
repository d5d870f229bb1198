"""Euler angles that are continuous over the frames: R = R_a(alpha) R_b(beta) R_c(gamma).

Every orientation has two such triples, (alpha, beta, gamma) and (alpha + pi, pi - beta,
gamma + pi), each up to full turns. The triple nearest to that of the previous frame is taken. At
gimbal lock, beta = +-90 deg, only the sum or difference of alpha and gamma is determined: gamma
keeps its value.

Gimbal lock means that the first and the last axis are parallel.
"""

from __future__ import annotations

import math
from itertools import permutations

import numpy as np

from fantoccini.base import Array, Quaternion, rotation

DEFAULT_ORDER = "ZXY"
"""Order of the axes that programs with y up expect."""

_ORDERS = tuple("".join(order) for order in permutations("XYZ"))
_AXES = {"X": 0, "Y": 1, "Z": 2}
_LOCKED_COS = 1e-8
"""cos(beta) below which an orientation counts as gimbal lock."""
_MAX_STEP_RATIO = 4.0
"""Largest angle step relative to the joint's rotation: it keeps gimbal lock 15 deg away."""
_MAX_STEP = 1e-3
"""Angle step that is always accepted [rad]."""


def order_and_angles(q: Quaternion) -> tuple[str, Array]:
    """Order of axes, and the angles about them at all frames.

    The order is :data:`DEFAULT_ORDER`. If its angles change much more from frame to frame than the
    orientation, because the motion passes close to gimbal lock, it is the order with the smallest
    steps.

    Args:
        q: (T, 4) unit quaternions.

    Returns:
        The order, and (T, 3) angles in that order [rad].
    """
    rotation_steps = np.linalg.norm(rotation.between(q[:-1], q[1:]), axis=1)
    angles = {DEFAULT_ORDER: euler_angles(q, DEFAULT_ORDER)}
    if _largest_step(angles[DEFAULT_ORDER]) > _MAX_STEP + _MAX_STEP_RATIO * rotation_steps.max(
        initial=0.0
    ):
        angles |= {order: euler_angles(q, order) for order in _ORDERS if order != DEFAULT_ORDER}
    best_order = min(angles, key=lambda order: _largest_step(angles[order]))
    return best_order, angles[best_order]


def euler_angles(q: Quaternion, order: str) -> Array:
    """(T, 3) angles of unit quaternions (T, 4), in an order of axes such as ``ZXY`` [rad]."""
    i, j, k = (_AXES[axis] for axis in order)
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    matrices = rotation.matrix(q)
    cos = np.hypot(matrices[:, i, i], matrices[:, i, j])
    b = np.arctan2(sign * matrices[:, i, k], cos)
    a = np.arctan2(-sign * matrices[:, j, k], matrices[:, k, k])
    c = np.arctan2(-sign * matrices[:, i, j], matrices[:, i, i])
    principal_angles, angles = np.stack([a, b, c], axis=1).tolist(), []
    previous = (0.0, 0.0, 0.0)
    for t, (alpha, beta, gamma) in enumerate(principal_angles):
        if cos[t] < _LOCKED_COS:
            gamma = previous[2]
            y = math.cos(gamma) * matrices[t, :, j] + sign * math.sin(gamma) * matrices[t, :, i]
            alpha = math.atan2(sign * y[k], y[j])
        first = _nearest_turn((alpha, beta, gamma), previous)
        second = _nearest_turn((alpha + math.pi, math.pi - beta, gamma + math.pi), previous)
        # At the first frame take `first`, whose beta is within 90 deg.
        previous = (
            second if t and math.dist(second, previous) < math.dist(first, previous) else first
        )
        angles.append(previous)
    return np.array(angles).reshape(-1, 3)


def _nearest_turn(
    angles: tuple[float, ...], previous: tuple[float, ...]
) -> tuple[float, float, float]:
    """The same angles up to full turns, each within half a turn of those in `previous`."""
    a, b, c = rotation.nearest_angle(np.array(angles), np.array(previous)).tolist()
    return a, b, c


def _largest_step(angles: Array) -> float:
    """The largest step of an angle [rad]."""
    return float(np.abs(np.diff(angles, axis=0)).max(initial=0.0))
