"""Driven coordinates over a time step, and the change of a configuration that moves."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property

import numpy as np

from fantoccini.base import Array, rotation


def carried(quaternions: Iterable[tuple[int, int]], move: Array, dmove: Array, n_dq: int) -> Array:
    """Change of the tangent vector at q moved by ``move``: Exp(-move) dq + J_r(move) dmove.

    Args:
        quaternions: (q, v) indices of rotations; the other coordinates are scalars.
        move: (n,) tangent vector.
        dmove: (n, m) change of ``move``.
        n_dq: number of columns of dq, which are the first ones.
    """
    out = dmove.copy()
    carry = np.eye(len(move), n_dq)
    for _, v in quaternions:
        here = slice(v, v + 3)
        out[here] = rotation.right_jacobian(move[here]) @ dmove[here]
        carry[here, here] = rotation.matrix(rotation.exp(-move[here]))
    out[:, :n_dq] += carry
    return out


class DrivenStep:
    """The driven coordinates over a step at constant acceleration.

    Args:
        quaternions: (q, v) indices of rotations.
        v_K, acc_K: (n_vK,) rates at the start; for rotations those of the rotation vector.
        dt: length of the step [s].
    """

    def __init__(self, quaternions: Iterable[tuple[int, int]], v_K: Array, acc_K: Array, dt: float):
        self._quaternions, self.dt = tuple(quaternions), dt
        self._move = dt * v_K + 0.5 * dt * dt * acc_K
        self._end_rates = v_K + dt * acc_K
        end = self._end_rates.copy()
        for _, v in self._quaternions:
            here = slice(v, v + 3)
            if self._move[here].any():  # most bodies keep still in most steps
                end[here] = rotation.right_jacobian(self._move[here]) @ end[here]
        self.rate = self._move / dt
        self.mean = (end - v_K) / dt

    @cached_property
    def _end_by(self) -> tuple[Array, Array]:
        """Derivatives (n_vK, n_vK) of v_K at the end by v_K and acc_K at the start."""
        dt, k = self.dt, len(self.rate)
        by_v, by_a = np.eye(k), dt * np.eye(k)
        for _, v in self._quaternions:
            here = slice(v, v + 3)
            phi, speed = self._move[here], self._end_rates[here]
            J = rotation.right_jacobian(phi)
            bend = np.stack(
                [rotation.right_jacobian_rate(phi, e) @ speed for e in np.eye(3)], axis=1
            )
            by_v[here, here] = dt * bend + J
            by_a[here, here] = 0.5 * dt * dt * bend + dt * J
        return by_v, by_a

    def mean_by(self, here: slice) -> tuple[Array, Array]:
        """Derivatives of a part of ``mean`` by the same part of v_K and acc_K."""
        by_v, by_a = (whole[here, here] for whole in self._end_by)
        return (by_v - np.eye(len(by_v))) / self.dt, by_a / self.dt

    def chain(self, n: int, n_p: int) -> Array:
        """Derivatives of (q_D, v_D, q_K, rate, mean, u_D, p) by the columns of :meth:`state`."""
        k, dt = len(self.rate), self.dt
        out = np.eye(3 * n + 3 * k + n_p)
        v, a = slice(2 * n + k, 2 * n + 2 * k), slice(2 * n + 2 * k, 2 * n + 3 * k)
        out[v, a] = 0.5 * dt * np.eye(k)
        out[a, v], out[a, a] = self.mean_by(slice(0, k))
        return out

    def state(self, n: int, n_p: int) -> Array:
        """Derivatives of (q_K, v_K) after the step by (q_D, v_D, q_K, v_K, acc_K, u_D, p)."""
        k, dt = len(self.rate), self.dt
        move, speed = np.zeros((k, 3 * n + 3 * k + n_p)), np.zeros((k, 3 * n + 3 * k + n_p))
        v, a = slice(2 * n + k, 2 * n + 2 * k), slice(2 * n + 2 * k, 2 * n + 3 * k)
        move[:, v], move[:, a] = dt * np.eye(k), 0.5 * dt * dt * np.eye(k)
        speed[:, v], speed[:, a] = self._end_by
        moved = carried(self._quaternions, self._move, move[:, 2 * n :], k)
        return np.concatenate([np.concatenate([np.zeros((k, 2 * n)), moved], axis=1), speed])
