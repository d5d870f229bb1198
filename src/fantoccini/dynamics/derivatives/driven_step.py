"""Driven coordinates over a time step, and the change of a configuration that moves.

q_K are the driven coordinates (ends and lengths of strings, driven joints), v_K and acc_K their
velocities and accelerations. In names, D stands for dynamic coordinates, which move by the
equations of motion.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property

import numpy as np

from fantoccini.base import Array, rotation


def transported_change(
    quaternions: Iterable[tuple[int, int]], move: Array, dmove: Array, n_columns: int
) -> Array:
    """Change of the tangent vector at q moved by ``move``: Exp(-move) dq + J_r(move) dmove.

    Args:
        quaternions: (q, v) indices of rotations; the other coordinates are scalars.
        move: (n,) tangent vector.
        dmove: (n, m) change of ``move``.
        n_columns: number of columns of dq, which are the first ones.
    """
    change = dmove.copy()
    transport = np.eye(len(move), n_columns)
    for _, v in quaternions:
        block = slice(v, v + 3)
        change[block] = rotation.right_jacobian(move[block]) @ dmove[block]
        transport[block, block] = rotation.matrix(rotation.exp(-move[block]))
    change[:, :n_columns] += transport
    return change


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
            block = slice(v, v + 3)
            if self._move[block].any():  # most bodies keep still in most steps
                end[block] = rotation.right_jacobian(self._move[block]) @ end[block]
        self.rate = self._move / dt
        self.mean = (end - v_K) / dt

    @cached_property
    def _end_speed_derivatives(self) -> tuple[Array, Array]:
        """Derivatives (n_vK, n_vK) of v_K at the end by v_K and acc_K at the start."""
        dt, k = self.dt, len(self.rate)
        by_v, by_a = np.eye(k), dt * np.eye(k)
        for _, v in self._quaternions:
            block = slice(v, v + 3)
            phi, speed = self._move[block], self._end_rates[block]
            J = rotation.right_jacobian(phi)
            curvature = np.stack(
                [rotation.right_jacobian_rate(phi, e) @ speed for e in np.eye(3)], axis=1
            )
            by_v[block, block] = dt * curvature + J
            by_a[block, block] = 0.5 * dt * dt * curvature + dt * J
        return by_v, by_a

    def mean_by(self, columns: slice) -> tuple[Array, Array]:
        """Derivatives of a part of ``mean`` by the same part of v_K and acc_K."""
        by_v, by_a = (derivative[columns, columns] for derivative in self._end_speed_derivatives)
        return (by_v - np.eye(len(by_v))) / self.dt, by_a / self.dt

    def chain_rule(self, n: int, n_p: int) -> Array:
        """Derivatives of q_D, v_D, q_K, rate, mean, u_D and p, as in :meth:`end_derivatives`."""
        k, dt = len(self.rate), self.dt
        out = np.eye(3 * n + 3 * k + n_p)
        v, a = slice(2 * n + k, 2 * n + 2 * k), slice(2 * n + 2 * k, 2 * n + 3 * k)
        out[v, a] = 0.5 * dt * np.eye(k)
        out[a, v], out[a, a] = self.mean_by(slice(0, k))
        return out

    def end_derivatives(self, n: int, n_p: int) -> Array:
        """Derivatives of (q_K, v_K) after the step by (q_D, v_D, q_K, v_K, acc_K, u_D, p)."""
        k, dt = len(self.rate), self.dt
        move_derivatives, speed_derivatives = (
            np.zeros((k, 3 * n + 3 * k + n_p)),
            np.zeros((k, 3 * n + 3 * k + n_p)),
        )
        v, a = slice(2 * n + k, 2 * n + 2 * k), slice(2 * n + 2 * k, 2 * n + 3 * k)
        move_derivatives[:, v], move_derivatives[:, a] = dt * np.eye(k), 0.5 * dt * dt * np.eye(k)
        speed_derivatives[:, v], speed_derivatives[:, a] = self._end_speed_derivatives
        q_K_derivatives = transported_change(
            self._quaternions, self._move, move_derivatives[:, 2 * n :], k
        )
        return np.concatenate(
            [np.concatenate([np.zeros((k, 2 * n)), q_K_derivatives], axis=1), speed_derivatives]
        )
