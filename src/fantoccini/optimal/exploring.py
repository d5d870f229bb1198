"""Exploration: random motions through slack strings and catches, by the exact law.

The cross-entropy method (Rubinstein, 1999) lowers the mean of the cost over random motions of the
inputs: what begins as a mean over many orders of events, and so is smooth in the distribution's
mean and spread, tightens to one motion as the spread falls:

    mean, spread  <-  those of the best motions of   J / J_0 + price |gap|^2 / gap_0^2 + ...

Every motion is an event-driven run, in a batch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import ARRIVED
from fantoccini.optimal.drawn_inputs import MOST, Driven, hats
from fantoccini.optimal.dynamics import Ends
from fantoccini.optimal.nodes import Nodes
from fantoccini.optimal.objective import Objective
from fantoccini.optimal.task import Task
from fantoccini.motion import Inputs
from fantoccini.simulation import simulate_batch


@dataclass(frozen=True)
class Settings:
    """Numbers of an exploration."""

    runs: int = 192
    """In a generation."""
    best: int = 24
    """Of them, from which the next is drawn."""
    generations: int = 30
    knots: int = 10
    spread: float = 0.5
    """At the start, relative to the largest acceleration."""
    least_spread: float = 0.02
    """Below which there is nothing left to explore, likewise."""
    kept: float = 0.3
    """Of the spread and of the mean, from one generation to the next."""
    price: tuple[float, float] = (1.0, 100.0)
    """Of gaps and of passed bounds, in the first generation and the last."""


TAU = 0.1
SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class Drawn:
    """Random motions with their merits.

    Attributes:
        acc: (n, N, n_vK).
        theta: (n, knots, k).
        cost, gap, passed: (n,) J, |gap|^2 and what bounds are passed by; inf where a run ended early.
    """

    theta: Array
    acc: Array
    cost: Array
    gap: Array
    passed: Array


class Exploration:
    def __init__(self, task: Task, first: Nodes, objective: Objective, seed: int, threads: int | None = None):
        self._task, self._first, self._objective = task, first, objective
        self._rng, self._threads = np.random.default_rng(seed), threads
        self._driven = Driven.of(task)
        n, k, T = first.table.n_vD, first.table.n_vK, first.interval * len(first)
        self._scale = np.concatenate([np.ones(n), np.full(n, TAU * T), np.ones(k), np.full(k, TAU * T)])
        self._hats = hats(len(first), SETTINGS.knots)

    def run(self, verbose=False):
        S, driven = SETTINGS, self._driven
        most = np.where(np.isfinite(driven.most), driven.most, MOST)[driven.moves]
        mean = np.zeros((S.knots, len(driven.moves)))
        spread = np.broadcast_to(S.spread * most, mean.shape)
        units = None
        elite = None
        for g in range(S.generations):
            drawn = self._drawn(mean + spread * self._rng.standard_normal((S.runs, *mean.shape)))
            if elite is not None:
                drawn = Drawn(*(np.concatenate([getattr(elite, f), getattr(drawn, f)]) for f in ("theta", "acc", "cost", "gap", "passed")))
            if units is None:
                ok = np.isfinite(drawn.cost)
                units = [max(float(np.median(a[ok])), 1e-12) for a in (drawn.cost, drawn.gap)]
            price = S.price[0] * (S.price[1] / S.price[0]) ** (g / (S.generations - 1))
            merit = drawn.cost / units[0] + price * (drawn.gap / units[1] + drawn.passed)
            order = np.argsort(merit, kind="stable")[: S.best]
            elite = Drawn(*(getattr(drawn, f)[order] for f in ("theta", "acc", "cost", "gap", "passed")))
            new_mean, new_spread = elite.theta.mean(0), elite.theta.std(0)
            mean = S.kept * mean + (1 - S.kept) * new_mean
            spread = S.kept * spread + (1 - S.kept) * new_spread
            if verbose:
                print(g, np.isfinite(drawn.cost).mean().round(2), "J %.4g gap %.4g passed %.3g spread %.3g" % (elite.cost[0], elite.gap[0] ** 0.5, elite.passed[0], np.mean(spread / most)))
            if np.mean(spread / most) < S.least_spread:
                break
        return elite

    def _drawn(self, theta: Array) -> Drawn:
        task, driven, first = self._task, self._driven, self._first
        n, N, h = len(theta), len(first), first.interval
        acc = np.zeros((n, N, len(driven.most)))
        acc[:, :, driven.moves] = self._hats @ theta
        for _ in range(2):
            acc = driven.within(driven.ending(driven.within(acc, h), h), h)
        inputs, q, v = self._inputs(acc)
        runs = simulate_batch(task.marionette, task.x0, inputs, first.t[-1], save_at=first.t, save=("q_D", "v_D", "tension", "limit_force"), threads=self._threads)
        ok = np.array([s in ARRIVED for s in runs.status]) & (runs.reached >= first.t[-1] - 1e-9)
        cost, gap, passed = (np.full(n, np.inf) for _ in range(3))
        for i in np.flatnonzero(ok):
            nodes = replace(first, q_D=runs.q_D[i], v_D=runs.v_D[i], q_K=q[i], v_K=v[i], acc_K=acc[i])
            tension = np.concatenate([runs.tension.values[i], runs.limit_force.values[i]], axis=1)[:-1]
            ends = Ends(np.zeros((N, nodes.n_z)), tension, tension > 0, np.ones(N, bool))
            cost[i] = self._objective.cost(nodes, ends)
            gap[i] = np.sum((self._scale*self._objective.end_gap(nodes)) ** 2)
            passed[i] = np.sum(self._objective.rows.violation(nodes, ends))
        return Drawn(theta, acc, cost, gap, passed)

    def _inputs(self, acc):
        """Motions of the inputs, and their (n, N + 1, ...) values and velocities at the nodes."""
        first, table, h = self._first, self._first.table, self._first.interval
        n, N, k = acc.shape
        v = np.concatenate([np.zeros((n, 1, k)), np.cumsum(h * acc, axis=1)], axis=1) + first.v_K[0]
        q = np.repeat(np.repeat(first.q_K[:1][None], N + 1, axis=1), n, axis=0)
        for at, j in table.scalars_K:
            q[:, 1:, at] += np.cumsum(h * 0.5 * (v[:, 1:, j] + v[:, :-1, j]), axis=1)
        coef = np.zeros((n, N, k, 6))
        coef[..., 1], coef[..., 2] = v[:, :-1], 0.5 * acc
        for at, j in table.scalars_K:
            coef[..., j, 0] = q[:, :-1, at]
        return Inputs(table, first.t[None], coef, q[:, :-1], np.ones((1, k), bool)), q, v
