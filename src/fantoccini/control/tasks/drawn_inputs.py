"""Random motions of the driven coordinates within their bounds.

    acc_i = clip(sum_j W_ij theta_j),   theta_j ~ N(mean, spread^2) at knot j

Accelerations are linear between knots. Each is clipped so that its interval ends within the bounds
of speed, at a position from which the coordinate can still stop within its bounds.

A driven coordinate is an end or a length of a string, or a driven joint; acc_i is its acceleration
in interval i. W_ij is the value of the hat function of knot j there: 1 at the knot, linear to 0 at
its neighbours. In names, D stands for dynamic coordinates, which move by the equations of motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.control.tasks.nodes import Nodes
from fantoccini.control.tasks.task import Task

_DEFAULT_ACCELERATION = 10.0
"""Spread of accelerations without a bound, about that of gravity [m/s^2 or rad/s^2]."""


@dataclass(frozen=True, eq=False)
class DrivenConditions:
    """The driven coordinates that move, their start, bounds and end.

    Attributes:
        movable: (k,) indices of the driven coordinates that are not held.
        start: (2, n_vK) numbers and velocities at the start.
        max_acceleration: (n_vK,) largest accelerations.
        low, high: (2, n_vK) bounds of numbers and velocities.
        end: (2, n_vK) required numbers and velocities at the end; NaN where they are free.
    """

    movable: Indices
    start: Array
    max_acceleration: Array
    low: Array
    high: Array
    end: Array

    @classmethod
    def from_task(cls, task: Task) -> DrivenConditions:
        """The driven coordinates of a task."""
        marionette = task.marionette
        table = marionette.coordinates
        n, k = table.n_vD, table.n_vK
        max_acceleration = task.bounds.magnitudes(marionette, "acceleration")
        low, high = (array[2 * n :].reshape(2, k) for array in task.bounds.intervals(marionette))
        start = Nodes.constant(marionette, task.x0, 1.0, 1).scalars[0, 2 * n :].reshape(2, k)
        end = np.full((2, k), np.nan)
        if task.periodic is None and (required_end := task.required_end) is not None:
            numbers = Nodes.constant(marionette, required_end.state, 1.0, 1).scalars[0, 2 * n :]
            end = np.where(required_end.required[2 * n :], numbers, np.nan).reshape(2, k)
        return cls(np.flatnonzero(max_acceleration > 0.0), start, max_acceleration, low, high, end)

    @property
    def scale(self) -> Array:
        """(n_vK,) the largest accelerations; :data:`_DEFAULT_ACCELERATION` without a bound."""
        return np.where(
            np.isfinite(self.max_acceleration), self.max_acceleration, _DEFAULT_ACCELERATION
        )

    def clipped(self, acc: Array, h: float) -> Array:
        """(n, N, n_vK) accelerations clipped to the bounds.

        With a bound a, the coordinate can stop within v^2 / (2 a) + |v| h / 2 by accelerations that
        are constant over intervals, so a velocity v+ after an interval may be as large as

            v+^2 / (2 a) + v+ h <= high - q - v h / 2
        """
        clipped, half_step = np.empty_like(acc), 0.5 * h
        q, v = (np.broadcast_to(array, (len(acc), acc.shape[2])).copy() for array in self.start)
        for i in range(acc.shape[1]):
            upper = np.minimum(
                self.high[1], self._stopping_speed(self.high[0] - q - half_step * v, h)
            )
            lower = np.maximum(
                self.low[1], -self._stopping_speed(q + half_step * v - self.low[0], h)
            )
            velocity = np.clip(v + h * acc[:, i], np.minimum(lower, upper), upper)
            clipped[:, i] = np.clip(
                (velocity - v) / h, -self.max_acceleration, self.max_acceleration
            )
            v_next = v + h * clipped[:, i]
            q, v = q + half_step * (v + v_next), v_next
        return clipped

    def _stopping_speed(self, distance: Array, h: float) -> Array:
        """The largest velocity after an interval from which a coordinate stops in a distance."""
        is_unbounded = ~np.isfinite(self.max_acceleration)
        braking = np.where(
            is_unbounded | (self.max_acceleration == 0.0), 1.0, self.max_acceleration
        )
        distance = np.maximum(distance, 0.0)
        speed = braking * (np.sqrt(h * h + 2.0 * distance / braking) - h)
        speed[:, is_unbounded] = distance[:, is_unbounded] / h
        return speed

    def projected_onto_end(self, acc: Array, h: float) -> Array:
        """(n, N, n_vK) the nearest accelerations that reach the required end, ignoring bounds."""
        N = acc.shape[1]
        columns = np.flatnonzero(np.isfinite(self.end[0]) & (self.max_acceleration > 0.0))
        if not len(columns):
            return acc
        G = np.stack([h * h * (N - 0.5 - np.arange(N)), np.full(N, h)])
        unforced = self.start + np.stack([N * h * self.start[1], 0.0 * self.start[1]])
        residual = (self.end - unforced)[:, columns] - np.einsum(
            "ei,nik->nek", G, acc[:, :, columns]
        )
        corrected = acc.copy()
        corrected[:, :, columns] += np.einsum("ei,nek->nik", np.linalg.solve(G @ G.T, G), residual)
        return corrected


def hat_functions(N: int, knots: int) -> Array:
    """(N, knots) values of the hat functions of the knots in the middles of N intervals."""
    position = (np.arange(N) + 0.5) / N * (knots - 1)
    return np.maximum(1.0 - np.abs(position[:, None] - np.arange(knots)), 0.0)
