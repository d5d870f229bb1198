"""Euler angles that go on from frame to frame: R = R_a(alpha) R_b(beta) R_c(gamma).

Every orientation has two such triples, (alpha, beta, gamma) and (alpha + pi, pi - beta,
gamma + pi), and each angle whole turns. The one nearest to the frame before is taken. At gimbal
lock, beta = +-90 deg, only a sum of alpha and gamma is given: gamma stays there.
"""

from __future__ import annotations

import math
from itertools import permutations

import numpy as np

from fantoccini.base import Array, Quaternion, rotation

USUAL = "ZXY"
"""The order that programs for y up expect."""

_ORDERS = tuple("".join(order) for order in permutations("XYZ"))
_AXES = {"X": 0, "Y": 1, "Z": 2}
_LOCKED = 1e-8
"""cos(beta) below which only a sum of angles is given."""
_MUCH = 4.0
"""How many times farther angles may step than the joint turns; gimbal lock is 15 deg away then."""
_LEAST = 1e-3
"""Steps up to this are always good [rad]."""


def euler(q: Quaternion) -> tuple[str, Array]:
    """An order of axes, and the angles about them at all frames.

    The order is :data:`USUAL`, unless its angles step much farther from frame to frame than the
    joint turns, because it passes close to gimbal lock; then the order of the smallest steps.

    Args:
        q: (T, 4) unit quaternions.

    Returns:
        The order, and (T, 3) angles in that order [rad].
    """
    turns = np.linalg.norm(rotation.between(q[:-1], q[1:]), axis=1)
    angles = {USUAL: angles_of(q, USUAL)}
    if _step(angles[USUAL]) > _LEAST + _MUCH * turns.max(initial=0.0):
        angles |= {order: angles_of(q, order) for order in _ORDERS if order != USUAL}
    best = min(angles, key=lambda order: _step(angles[order]))
    return best, angles[best]


def angles_of(q: Quaternion, order: str) -> Array:
    """(T, 3) angles in an order such as ``ZXY`` [rad], of unit quaternions (T, 4)."""
    i, j, k = (_AXES[axis] for axis in order)
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    matrices = rotation.matrix(q)
    cos = np.hypot(matrices[:, i, i], matrices[:, i, j])
    b = np.arctan2(sign * matrices[:, i, k], cos)
    a = np.arctan2(-sign * matrices[:, j, k], matrices[:, k, k])
    c = np.arctan2(-sign * matrices[:, i, j], matrices[:, i, i])
    raw, found = np.stack([a, b, c], axis=1).tolist(), []
    last = (0.0, 0.0, 0.0)
    for t, (alpha, beta, gamma) in enumerate(raw):
        if cos[t] < _LOCKED:
            gamma = last[2]
            y = math.cos(gamma) * matrices[t, :, j] + sign * math.sin(gamma) * matrices[t, :, i]
            alpha = math.atan2(sign * y[k], y[j])
        one = _near((alpha, beta, gamma), last)
        other = _near((alpha + math.pi, math.pi - beta, gamma + math.pi), last)
        # The first frame has no other before it: beta within 90 deg.
        last = other if t and math.dist(other, last) < math.dist(one, last) else one
        found.append(last)
    return np.array(found).reshape(-1, 3)


def _near(angles: tuple[float, ...], last: tuple[float, ...]) -> tuple[float, float, float]:
    """The same angles up to whole turns, within half a turn of others."""
    a, b, c = rotation.nearest_angle(np.array(angles), np.array(last)).tolist()
    return a, b, c


def _step(angles: Array) -> float:
    """The largest step of an angle [rad]."""
    return float(np.abs(np.diff(angles, axis=0)).max(initial=0.0))
