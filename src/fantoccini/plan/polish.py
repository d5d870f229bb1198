"""Plans made shorter and brought to their goal: by Gauss and Newton on the whole of a plan.

The velocities V of the driven coordinates at the ends of its segments are varied::

    min |r + J dV|^2 + damping^2 |dV|^2,      |V + dV| <= speed

where r is what the end lacks of the goal, and what clearances lack. Steps of several dampings
are tried side by side, in lanes, and the one that comes nearest is made (Levenberg, Marquardt).
What stands in the way is looked at when the end is near enough.
"""

from __future__ import annotations

import math
import time

import numpy as np

from fantoccini.arrays import Array
from fantoccini.plan.goals import Rows
from fantoccini.plan.motions import Motions
from fantoccini.plan.problem import Problem
from fantoccini.runtime import UNKNOWN, Segments

_DAMPINGS = (1e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1.0)
"""Of steps that are tried side by side, as parts of the largest singular value of J."""

_ITERATIONS = 7

_WINDOW = 24
"""Last segments whose velocities are varied: what is changed earlier bends too much on its way."""

_CHANGE = 1e-4
"""Of a velocity, to see what comes of it [m/s or rad/s]."""

_ROOM = 0.003
"""Clearance beyond the margin that is wished for [m]."""

_CLEAR = 1.0
"""Weight of clearances beside the goal's residuals [1/m]."""

_LONGER = (1, 3, 5, 8, 12, 18, 25, 40)
"""Segments that are added until the goal can be reached."""

_FEWER = 3
"""Segments by which a plan is shortened at once, at most."""

_SLOW = 0.7
"""Part of the distance that may be left two iterations later, before a plan is given up."""


class Polisher:
    """Makes plans of a problem shorter, and ends them at the goal.

    Args:
        problem: what was planned.

    Raises:
        ValueError: the goal is a function, of which nothing is known.
    """

    def __init__(self, problem: Problem):
        if problem.goal.numbers.kind == UNKNOWN:
            raise ValueError("a plan to a goal that is a function cannot be polished")
        self._problem = problem
        self._strict = problem.motions.where(tolerance=-1.0)
        self._free = problem.motions.where(tolerance=-1.0, free=True)

    def __call__(
        self, acceleration: Array, looks: Array, distance: float, seconds: float
    ) -> Segments | None:
        """A plan that ends nearer to the goal, and is shorter where time allows.

        Args:
            acceleration: (m, n_vK) of a plan's segments.
            looks: (m,) that they last.
            distance: that is near enough.
            seconds: how long to look for shorter ones.

        Returns:
            The plan, one motion; None where none comes so near.
        """
        until = time.perf_counter() + seconds
        acceleration = self._whole(acceleration, looks)
        tries = (self._ended(self._longer(acceleration, more), distance) for more in _LONGER)
        best = next((found for found in tries if found is not None), None)
        if best is None:
            return None
        fewer = _FEWER
        while time.perf_counter() < until and fewer and len(best[0]) > fewer:
            found = self._ended(self._hurried(best[0], len(best[0]) - fewer), distance)
            if found is None:
                fewer -= 1
            else:
                best = found
        return best[1]

    def _whole(self, acceleration: Array, looks: Array) -> Array:
        """The same ways in segments of the usual duration; the last one may last longer."""
        motions, root = self._problem.motions, self._problem.root
        times = np.concatenate([[0.0], np.cumsum(looks * motions.interval)])
        V = np.cumsum(acceleration * (looks * motions.interval)[:, None], axis=0)
        V = np.concatenate([root.v_K, root.v_K + V])
        at = self._segment * np.arange(1, math.ceil(times[-1] / self._segment - 1e-9) + 1)
        return self._within(np.stack([np.interp(at, times, column) for column in V.T], axis=1))

    def _longer(self, acceleration: Array, more: int) -> Array:
        """The same, and then led to the goal for some segments; standing still without a law."""
        m, n_K = acceleration.shape
        whole = np.zeros((1, m + more, n_K))
        whole[0, :m] = acceleration
        if not self._problem.motions.funnels:
            whole[0, m:] = self._within(np.zeros((m + more, n_K)))[m:]
            return whole[0]
        given = np.array([m])
        return self._free.sweep(self._problem.root, np.zeros(1), whole, given=given).acc_K[0]

    def _hurried(self, acceleration: Array, m: int) -> Array:
        """The same ways in m segments, as far as the bounds allow."""
        V = self._velocities(acceleration)
        scale = len(acceleration) / m
        at = scale * np.arange(1, m + 1)
        there = np.arange(len(V))
        wanted = scale * np.stack([np.interp(at, there, column) for column in V.T], axis=1)
        return self._within(wanted)

    def _ended(self, acceleration: Array, distance: float) -> tuple[Array, Segments] | None:
        """These segments, changed so that they end at the goal with nothing in the way."""
        made = self._made(self._free, acceleration[None])
        if made is None:
            return None
        left = [float(made.distance[0, -1])]
        while left[-1] > distance and len(left) <= _ITERATIONS:
            if len(left) > 3 and left[-1] > _SLOW * left[-3]:
                return None
            tried = np.stack([self._within(V) for V in self._steps(acceleration, made)])
            made = self._made(self._free, tried)
            if made is None:
                return None
            nearest = int(np.argmin(made.distance[:, -1]))
            acceleration, made = tried[nearest], made.of(nearest)
            left.append(float(made.distance[0, -1]))
        if made.distance[0, -1] > distance:
            return None
        strict = self._made(self._strict, acceleration[None])
        return None if strict is None or strict.looks[0, -1] == 0 else (acceleration, strict)

    def _made(self, motions: Motions, acceleration: Array) -> Segments | None:
        """Motions (n, m, n_vK) from the start; None where none was made whole."""
        n = len(acceleration)
        made = motions.sweep(self._problem.root, np.zeros(n), acceleration)
        whole = made.looks[:, -1] > 0
        made.distance[~whole] = np.inf
        return made if np.any(whole) else None

    def _velocities(self, acceleration: Array) -> Array:
        """(m + 1, n_vK) from the start to the ends of the segments."""
        first = self._problem.root.v_K
        return first + np.concatenate(
            [np.zeros_like(first), self._segment * np.cumsum(acceleration, axis=0)]
        )

    @property
    def _segment(self) -> float:
        motions = self._problem.motions
        return motions.looks * motions.interval

    def _within(self, V: Array) -> Array:
        """(m, n_vK) accelerations by which velocities are followed as the bounds allow."""
        bounds, T = self._problem.motions.bounds, self._segment
        v, made = self._problem.root.v_K[0], np.empty_like(V)
        for k, wanted in enumerate(np.clip(V, -bounds.speed, bounds.speed)):
            made[k] = np.clip((wanted - v) / T, -bounds.acceleration, bounds.acceleration)
            v = v + T * made[k]
        return made

    def _steps(self, acceleration: Array, made: Segments) -> Array:
        """Velocities (n, m, n_vK) that are worth a try."""
        bounds, (m, n_K) = self._problem.motions.bounds, acceleration.shape
        lacks, J = self._answers(acceleration, made)
        V = self._velocities(acceleration)[1:].ravel()
        most, free = np.tile(bounds.speed, m), np.tile(bounds.moves, m)
        tried = []
        for damping in _DAMPINGS:
            still, r, held = ~free, lacks, np.zeros_like(V)
            for _ in range(3):
                U, s, W = np.linalg.svd(np.where(still, 0.0, J), full_matrices=False)
                size = damping * s[0] + 1e-30
                dV = -W.T @ (s / (s**2 + size**2) * (U.T @ r))
                out = ~still & (np.abs(V + dV) > most)
                if not np.any(out):
                    break
                # What is at its bound stays there, and the others do its part.
                held[out] = (np.clip(V + dV, -most, most) - V)[out]
                r, still = r + J[:, out] @ held[out], still | out
            tried.append(V + np.where(still & free, held, dV))
        return np.array(tried).reshape(-1, m, n_K)

    def _answers(self, acceleration: Array, made: Segments) -> tuple[Array, Array]:
        """What is lacking of the goal and of clearances, (r,), and its slopes by V (r, m n_vK).

        Every velocity of the last segments is changed by itself, and what follows made again.
        """
        root, T = self._problem.root, self._segment
        m, n_K = acceleration.shape
        nodes = Rows(
            *(
                np.concatenate([first, a[0]])
                for first, a in zip(root.parts.values(), made.states.values(), strict=True)
            )
        )
        first = max(0, m - _WINDOW)
        chosen, length = np.repeat(np.arange(first, m), n_K), m - first
        changed = np.zeros((length, n_K, length, n_K))
        for k in range(length):
            changed[k, :, : length - k] = acceleration[first + k :]
            changed[k, :, 0] += np.eye(n_K) * (_CHANGE / T)
            if k + 1 < length:
                changed[k, :, 1] -= np.eye(n_K) * (_CHANGE / T)
        again = self._free.sweep(nodes, chosen, changed.reshape(-1, length, n_K), made=m - chosen)
        ends = Rows(*(a[np.arange(len(chosen)), m - 1 - chosen] for a in again.states.values()))
        r, varied = self._lacking(nodes[-1:]), slice(first * n_K, m * n_K)
        J = np.zeros((r.shape[1], m * n_K))
        J[:, varied] = (self._lacking(ends) - r).T / _CHANGE
        # What could not be made again says nothing.
        J[:, ~np.isfinite(J).all(axis=0)] = 0.0
        parts, slopes = [r[0]], [J]
        clear, wanted = self._clear(nodes[1:]), self._problem.motions.margin + _ROOM
        for i in np.flatnonzero(clear < wanted):
            # Those that were changed before or in this segment.
            early = np.flatnonzero(chosen <= i)
            if not len(early):
                continue
            there = Rows(*(a[early, i - chosen[early]] for a in again.states.values()))
            slope = np.zeros((1, m * n_K))
            change = (self._clear(there) - clear[i]) / _CHANGE
            slope[0, first * n_K + early] = np.where(np.isfinite(change), change, 0.0)
            parts.append(_CLEAR * (clear[i : i + 1] - wanted))
            slopes.append(_CLEAR * slope)
        return np.concatenate(parts), np.concatenate(slopes)

    def _clear(self, rows: Rows) -> Array:
        return self._problem.motions.clearance.at(rows.q_D, rows.q_K)

    def _lacking(self, rows: Rows) -> Array:
        """(n, r) what states lack of the goal, and their speeds."""
        goal, numbers = self._problem.goal, self._problem.goal.numbers
        speeds = numbers.speed_weight * rows.v_D, numbers.driven_weight * rows.v_K
        return np.concatenate([goal.residuals(rows), *speeds], axis=1)
