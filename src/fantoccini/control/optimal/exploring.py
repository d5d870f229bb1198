"""Exploration: random motions of the inputs, through whatever strings do, by the exact law.

The cross-entropy method (Rubinstein, Methodol. Comput. Appl. Probab. 1, 1999) draws motions from a
normal distribution and moves it to the best of them, by

    J / J_0 + price (|gap|^2 / gap_0^2 + passed)

What it lowers is a mean over many orders of slack and catch, a smooth function of the distribution
where the cost of one motion has kinks; as the spread falls and the price rises, it tightens to one
motion and its order of events. Every motion is an event-driven run, of a compiled batch.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import ARRIVED, N_COEF, Array, Indices, OnProgress, Progress, Status
from fantoccini.control.optimal.dynamics import Ends
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.sqp import Iterate
from fantoccini.control.tasks import Driven, Nodes, hats
from fantoccini.dynamics.simulation import simulate_batch
from fantoccini.motion import Inputs


@dataclass(frozen=True)
class ExploringSettings:
    """Numbers of an exploration."""

    runs: int = 192
    """In a generation."""
    best: int = 24
    """Of them, to which the distribution moves."""
    generations: int = 30
    knots: int = 10
    """Of an input's acceleration."""
    spread: float = 0.5
    """At the start, relative to the largest acceleration."""
    least_spread: float = 0.02
    """Below which there is nothing left to explore, likewise."""
    near_spread: float = 0.1
    near_generations: int = 10
    """The same of an exploration near a motion that is almost one."""
    kept: float = 0.3
    """Of mean and spread, from one generation to the next."""
    price: tuple[float, float] = (1e2, 1e4)
    """Of gaps and of passed bounds, in the first generation and the last."""
    moment: float = 0.2
    """Share of the duration over which a velocity that is left counts as a way."""
    endings: int = 2
    """How often in turns a motion is led to its end, and back into its bounds."""


SETTINGS = ExploringSettings()
_LEAST = 1e-12
"""Unit of a cost or a gap that is 0."""
_SAVED = ("q_D", "v_D", "tension", "limit_force")


@dataclass(frozen=True, eq=False)
class Drawn:
    """Random motions and what they come to.

    Attributes:
        theta: (n, knots, k) numbers that were drawn: accelerations of the inputs at knots.
        acc_K: (n, N, n_vK) accelerations of the inputs.
        cost, gap, passed: (n,) J, |gap|^2 at the end and what bounds are passed by; inf where a run
            ended early.
    """

    theta: Array
    acc_K: Array
    cost: Array
    gap: Array
    passed: Array

    def part(self, places: Indices) -> Drawn:
        """Some of them."""
        return Drawn(*(a[places] for a in vars(self).values()))

    def beside(self, other: Drawn) -> Drawn:
        """These and others."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Drawn(*(np.concatenate(pair) for pair in pairs))


class Exploration:
    """Looks for a motion, whatever strings do on the way, around a first one.

    Args:
        first: the motion around which others are drawn; where the duration is free, it is that of
            this one.
        objective: cost and bounds.
        rng: of the random numbers.
        threads: that simulate; as many as there are processors when None.
        until: time of ``time.perf_counter`` at which it ends [s].
        near: whether the first motion is almost one that holds.
    """

    def __init__(
        self,
        first: Nodes,
        objective: Objective,
        rng: np.random.Generator,
        threads: int | None = None,
        until: float = np.inf,
        near: bool = False,
    ):
        self._near = near
        self._first, self._objective, self._rng, self._until = first, objective, rng, until
        self._threads, self._driven = threads, Driven.of(objective.task)
        n, k, T = first.table.n_vD, first.table.n_vK, first.interval * len(first)
        self._ways = np.repeat([1.0, SETTINGS.moment * T] * 2, [n, n, k, k])
        self._hats = hats(len(first), min(SETTINGS.knots, len(first)))

    def run(self, progress: OnProgress | None = None) -> Iterate | None:
        """The best motion of all generations; None where no run arrived at its end.

        Args:
            progress: called after every generation with the best motion so far.

        Raises:
            KeyboardInterrupt: Ctrl-C, also where a batch has swallowed it.
        """
        moves = self._driven.moves
        most = self._driven.scale[moves]
        mean = np.zeros((self._hats.shape[1], len(moves)))
        widest = SETTINGS.near_spread if self._near else SETTINGS.spread
        generations = SETTINGS.near_generations if self._near else SETTINGS.generations
        spread = widest * most + 0.0 * mean
        units: tuple[float, float] | None = None
        best: Drawn | None = None
        low, high = SETTINGS.price
        for g in range(generations):
            if time.perf_counter() > self._until:
                break
            noise = self._rng.standard_normal((SETTINGS.runs, *mean.shape))
            noise[0] = 0.0
            drawn = self._simulated(mean + spread * noise)
            drawn = drawn if best is None else best.beside(drawn)
            arrived = np.flatnonzero(np.isfinite(drawn.cost))
            if not len(arrived):
                spread = 0.5 * spread  # of slower motions more are possible
                continue
            if units is None:
                J, gap = np.median(drawn.cost[arrived]), np.median(drawn.gap[arrived])
                units = max(float(J), _LEAST), max(float(gap), _LEAST)
            price = low * (high / low) ** (1.0 if self._near else g / (generations - 1))
            merit = drawn.cost / units[0] + price * (drawn.gap / units[1] + drawn.passed)
            order = np.argsort(merit, kind="stable")[: min(SETTINGS.best, len(arrived))]
            best = drawn.part(order)
            kept = SETTINGS.kept
            mean = kept * mean + (1.0 - kept) * np.mean(best.theta, axis=0)
            spread = kept * spread + (1.0 - kept) * np.std(best.theta, axis=0)
            if progress is not None:
                progress(Progress(done=g + 1, total=generations, best=self._iterate(best)))
            if np.mean(spread / most) < SETTINGS.least_spread:
                break
        return None if best is None else self._iterate(best)

    def _simulated(self, theta: Array) -> Drawn:
        """Motions of drawn numbers."""
        driven, first, h = self._driven, self._first, self._first.interval
        acc_K = np.repeat(first.acc_K[None], len(theta), axis=0)
        acc_K[:, :, driven.moves] += self._hats @ theta
        acc_K = driven.within(acc_K, h)
        for _ in range(SETTINGS.endings):
            acc_K = driven.within(driven.ending(acc_K, h), h)
        motions = self._motions(acc_K)
        cost, gap, passed = (np.full(len(theta), np.inf) for _ in range(3))
        for i, made in enumerate(motions):
            if made is not None:
                nodes, ends = made
                left = self._ways * self._objective.end_gap(nodes)
                cost[i], gap[i] = self._objective.cost(nodes, ends), float(left @ left)
                passed[i] = float(np.sum(self._objective.rows.violation(nodes, ends)))
        return Drawn(theta, acc_K, cost, gap, passed)

    def _motions(self, acc_K: Array) -> list[tuple[Nodes, Ends] | None]:
        """The nodes of runs, and their intervals; None where a run did not arrive."""
        first, task, N = self._first, self._objective.task, len(self._first)
        inputs, q_K, v_K = _inputs(first, acc_K)
        runs = simulate_batch(
            task.marionette,
            task.x0,
            inputs,
            first.t[-1],
            save_at=first.t,
            save=_SAVED,
            threads=self._threads,
        )
        if np.any(runs.status == Status.STOPPED):
            raise KeyboardInterrupt
        assert runs.tension is not None and runs.limit_force is not None
        force = np.concatenate([runs.tension.values, runs.limit_force.values], axis=2)[:, :-1]
        made: list[tuple[Nodes, Ends] | None] = [None] * len(acc_K)
        for i in np.flatnonzero(np.isin(runs.status, ARRIVED)):
            assert runs.q_D is not None and runs.v_D is not None
            nodes = replace(
                first, q_D=runs.q_D[i], v_D=runs.v_D[i], q_K=q_K[i], v_K=v_K[i], acc_K=acc_K[i]
            )
            e, pull = np.zeros((N, nodes.n_z)), force[i]
            made[i] = nodes, Ends(e, pull, pull > 0.0, np.ones(N, dtype=bool))
        return made

    def _iterate(self, best: Drawn) -> Iterate:
        """The first of some motions, as a search begins with one."""
        made = self._motions(best.acc_K[:1])[0]
        assert made is not None  # its run arrived before
        nodes, ends = made
        gap = self._objective.end_gap(nodes)
        return Iterate(nodes, ends, float(best.cost[0]), defect=float(np.max(np.abs(gap))))


def _inputs(first: Nodes, acc_K: Array) -> tuple[Inputs, Array, Array]:
    """Inputs of constant accelerations, and their (n, N + 1, ...) values and velocities.

    All are scalars.
    """
    table, h = first.table, first.interval
    n, N, k = acc_K.shape
    v_K = np.concatenate([np.zeros((n, 1, k)), np.cumsum(h * acc_K, axis=1)], axis=1) + first.v_K[0]
    q_K = np.tile(first.q_K[0], (n, N + 1, 1))
    coef = np.zeros((n, N, k, N_COEF))
    coef[..., 1], coef[..., 2] = v_K[:, :-1], 0.5 * acc_K
    for q, v in table.scalars_K:
        q_K[:, 1:, q] += np.cumsum(0.5 * h * (v_K[:, 1:, v] + v_K[:, :-1, v]), axis=1)
        coef[..., v, 0] = q_K[:, :-1, q]
    named = np.ones((1, k), dtype=bool)
    return Inputs(table, first.t[None], coef, q_K[:, :-1], named), q_K, v_K
