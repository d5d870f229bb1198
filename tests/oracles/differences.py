"""Derivatives by differences, and small changes of configurations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fantoccini.base import rotation


def difference(f: Callable[[np.ndarray], np.ndarray], n: int, step: float) -> np.ndarray:
    """df(d)/dd at d = 0, (m, n): a central difference of sixth order in each of n directions."""
    columns = []
    for e in np.eye(n):
        first, second, third = (
            (f(k * step * e) - f(-k * step * e)) / (2.0 * k * step) for k in (1, 2, 3)
        )
        columns.append(1.5 * first - 0.6 * second + 0.1 * third)
    return np.array(columns).T.reshape(-1, n)


def moved(q: np.ndarray, d: np.ndarray, scalars, quaternions) -> np.ndarray:
    """A configuration moved by a tangent vector: scalars add, quaternions turn."""
    q = np.array(q)
    for at, v in scalars:
        q[at] += d[v]
    for at, v in quaternions:
        q[at : at + 4] = rotation.multiply(q[at : at + 4], rotation.exp(d[v : v + 3]))
    return q


def apart(q: np.ndarray, other: np.ndarray, n: int, scalars, quaternions) -> np.ndarray:
    """The tangent vector (n,) that moves one configuration to another."""
    d = np.zeros(n)
    for at, v in scalars:
        d[v] = other[at] - q[at]
    for at, v in quaternions:
        d[v : v + 3] = rotation.between(q[at : at + 4], other[at : at + 4])
    return d


def worst(result: np.ndarray, wanted: np.ndarray) -> float:
    """Largest difference, relative to the largest entry of `wanted`, or to 1e-3."""
    size = max(1e-3, float(np.max(np.abs(wanted), initial=0.0)))
    return float(np.max(np.abs(result - wanted), initial=0.0)) / size
