"""Random motions of the driven coordinates within their bounds.

    acc_i = clip(sum over knots of  W_ij theta_j),   theta ~ N(mean, spread^2)

Accelerations are linear between knots. Each is clipped so that its interval ends within the bounds
of speed, and at a place from which the coordinate can still stop within those of position.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.control.tasks.nodes import Nodes
from fantoccini.control.tasks.task import Task

MOST = 10.0
"""Spread of accelerations without a bound [m/s^2 or rad/s^2]: about that of gravity."""


@dataclass(frozen=True, eq=False)
class Driven:
    """The driven coordinates that move, their start, bounds and end.

    Attributes:
        moves: (k,) places of those that are not held.
        start: (2, n_vK) numbers and velocities at the start.
        most: (n_vK,) largest accelerations.
        low, high: (2, n_vK) bounds of numbers and velocities.
        end: (2, n_vK) numbers and velocities asked for at the end; NaN where none are.
    """

    moves: Indices
    start: Array
    most: Array
    low: Array
    high: Array
    end: Array

    @classmethod
    def of(cls, task: Task) -> Driven:
        """Those of a task."""
        marionette = task.marionette
        table = marionette.coordinates
        n, k = table.n_vD, table.n_vK
        most = task.bounds.magnitudes(marionette, "acceleration")
        low, high = (a[2 * n :].reshape(2, k) for a in task.bounds.intervals(marionette))
        start, end = (
            np.full((2, k), np.nan)
            if x is None
            else Nodes.still(marionette, x, 1.0, 1).numbers[0, 2 * n :].reshape(2, k)
            for x in (task.x0, task.goal if task.periodic is None else None)
        )
        return cls(np.flatnonzero(most > 0.0), start, most, low, high, end)

    @property
    def scale(self) -> Array:
        """(n_vK,) the largest accelerations; :data:`MOST` without a bound."""
        return np.where(np.isfinite(self.most), self.most, MOST)

    def within(self, acc: Array, h: float) -> Array:
        """(n, N, n_vK) accelerations as near to the given ones as the bounds let them be.

        The coordinate can stop within v^2 / (2 most) + |v| h / 2 by accelerations that are constant
        over intervals, so a velocity v+ after an interval may be as large as

            v+^2 / (2 most) + v+ h <= high - q - v h / 2
        """
        out, h2 = np.empty_like(acc), 0.5 * h
        q, v = (np.broadcast_to(a, (len(acc), acc.shape[2])).copy() for a in self.start)
        for i in range(acc.shape[1]):
            upper = np.minimum(self.high[1], self._stops(self.high[0] - q - h2 * v, h))
            lower = np.maximum(self.low[1], -self._stops(q + h2 * v - self.low[0], h))
            wanted = np.clip(v + h * acc[:, i], np.minimum(lower, upper), upper)
            out[:, i] = np.clip((wanted - v) / h, -self.most, self.most)
            v_next = v + h * out[:, i]
            q, v = q + h2 * (v + v_next), v_next
        return out

    def _stops(self, room: Array, h: float) -> Array:
        """The largest velocity after an interval from which there is room to stop."""
        free = ~np.isfinite(self.most)
        braking = np.where(free | (self.most == 0.0), 1.0, self.most)
        room = np.maximum(room, 0.0)
        bounded = braking * (np.sqrt(h * h + 2.0 * room / braking) - h)
        bounded[:, free] = room[:, free] / h
        return bounded

    def ending(self, acc: Array, h: float) -> Array:
        """(n, N, n_vK) the nearest accelerations that end as asked for; bounds do not count."""
        N = acc.shape[1]
        known = np.flatnonzero(np.isfinite(self.end[0]) & (self.most > 0.0))
        if not len(known):
            return acc
        G = np.stack([h * h * (N - 0.5 - np.arange(N)), np.full(N, h)])
        free = self.start + np.stack([N * h * self.start[1], 0.0 * self.start[1]])
        left = (self.end - free)[:, known] - np.einsum("ei,nik->nek", G, acc[:, :, known])
        out = acc.copy()
        out[:, :, known] += np.einsum("ei,nek->nik", np.linalg.solve(G @ G.T, G), left)
        return out


def hats(N: int, knots: int) -> Array:
    """(N, knots) values in the middles of N intervals of what is linear between the knots."""
    at = (np.arange(N) + 0.5) / N * (knots - 1)
    return np.maximum(1.0 - np.abs(at[:, None] - np.arange(knots)), 0.0)
