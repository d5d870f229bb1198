"""Exploration: random motions of the inputs, through slack and catches, as event-driven runs.

The cross-entropy method (Rubinstein, Methodol. Comput. Appl. Probab. 1, 1999) draws motions from a
normal distribution and moves it towards the best of them, those of least

    J / J_0 + price (|gap|^2 / gap_0^2 + violation)

The mean of this merit over many orders of slack and catch is a smooth function of the distribution,
whereas the cost of a single motion has kinks. As the spread falls and the price rises, the
distribution narrows to one motion and its order of events. All motions of a generation are
event-driven runs of a compiled batch.

The gap is the error at the end of the motion. A slack string does not pull; at a catch it becomes
taut again. The inputs are the accelerations acc_K of the driven coordinates q_K. In names, D stands
for dynamic coordinates, which move by the equations of motion. A node is a time at which the inputs
may change, with its state; an interval leads to the next node.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import ARRIVED, N_COEF, Array, Indices, OnProgress, Progress, Status
from fantoccini.control.optimal.dynamics import Ends
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.sqp import Iterate
from fantoccini.control.tasks import DrivenConditions, Nodes, hat_functions
from fantoccini.dynamics.simulation import simulate_batch
from fantoccini.motion import Inputs


@dataclass(frozen=True)
class ExploringSettings:
    """Parameters of an exploration."""

    n_runs: int = 192
    """Number of runs in a generation."""
    n_best: int = 24
    """Number of the best runs, to which the distribution moves."""
    n_generations: int = 30
    n_knots: int = 10
    """Number of knots of an input's acceleration."""
    first_spread: float = 0.5
    """Spread at the start, relative to the largest acceleration."""
    min_spread: float = 0.02
    """Spread at which the exploration ends, relative to the largest acceleration."""
    first_near_spread: float = 0.1
    n_near_generations: int = 10
    """First spread and number of generations near a motion that almost holds."""
    smoothing: float = 0.3
    """Share of the last generation in mean and spread of the next."""
    prices: tuple[float, float] = (1e2, 1e4)
    """Price of gaps and violated bounds, in the first generation and the last."""
    velocity_time_share: float = 0.2
    """Time by which velocity errors are multiplied in the gap, relative to the duration."""
    n_projections: int = 2
    """Number of projections of a motion onto its end, and back into its bounds."""


SETTINGS = ExploringSettings()
_MIN_UNIT = 1e-12
"""Smallest unit of a cost or a gap."""
_SAVED_QUANTITIES = ("q_D", "v_D", "tension", "limit_force")


@dataclass(frozen=True, eq=False)
class DrawnMotions:
    """Random motions and their results.

    Attributes:
        theta: (n, knots, k) drawn numbers: changes of the inputs' accelerations at knots.
        acc_K: (n, N, n_vK) accelerations of the inputs.
        cost, gap, violation: (n,) J, |gap|^2 at the end, and total violation of bounds; inf if the
            run ended early.
    """

    theta: Array
    acc_K: Array
    cost: Array
    gap: Array
    violation: Array

    def selected(self, indices: Indices) -> DrawnMotions:
        """The motions with these indices."""
        return DrawnMotions(*(array[indices] for array in vars(self).values()))

    def followed_by(self, other: DrawnMotions) -> DrawnMotions:
        """These motions, followed by others."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return DrawnMotions(*(np.concatenate(pair) for pair in pairs))


class Exploration:
    """A search for motions around a first one, through slack and catches.

    Args:
        initial: the motion around which others are drawn; it also sets the duration if that is
            free.
        objective: cost and bounds.
        rng: generator of the random numbers.
        threads: number of threads; all processors for None.
        deadline: end of the search, by ``time.perf_counter`` [s].
        is_near: whether the first motion almost holds.
    """

    def __init__(
        self,
        initial: Nodes,
        objective: Objective,
        rng: np.random.Generator,
        threads: int | None = None,
        deadline: float = np.inf,
        is_near: bool = False,
    ):
        self._is_near = is_near
        self._initial = initial
        self._objective = objective
        self._rng = rng
        self._deadline = deadline
        self._threads, self._driven = threads, DrivenConditions.from_task(objective.task)
        n, k, T = initial.table.n_vD, initial.table.n_vK, initial.interval * len(initial)
        self._gap_scale = np.repeat([1.0, SETTINGS.velocity_time_share * T] * 2, [n, n, k, k])
        self._basis = hat_functions(len(initial), min(SETTINGS.n_knots, len(initial)))

    def run(self, progress: OnProgress | None = None) -> Iterate | None:
        """The best motion of all generations; None if no run arrived at its end.

        Args:
            progress: called after every generation with the best motion so far.

        Raises:
            KeyboardInterrupt: Ctrl-C, also during a batch.
        """
        moves = self._driven.movable
        max_acceleration = self._driven.scale[moves]
        mean = np.zeros((self._basis.shape[1], len(moves)))
        first_spread = SETTINGS.first_near_spread if self._is_near else SETTINGS.first_spread
        generations = SETTINGS.n_near_generations if self._is_near else SETTINGS.n_generations
        spread = first_spread * max_acceleration + 0.0 * mean
        units: tuple[float, float] | None = None
        best: DrawnMotions | None = None
        first_price, last_price = SETTINGS.prices
        for g in range(generations):
            if time.perf_counter() > self._deadline:
                break
            noise = self._rng.standard_normal((SETTINGS.n_runs, *mean.shape))
            noise[0] = 0.0
            motions = self._simulate(mean + spread * noise)
            motions = motions if best is None else best.followed_by(motions)
            arrived = np.flatnonzero(np.isfinite(motions.cost))
            if not len(arrived):
                spread = 0.5 * spread  # more of the slower motions arrive
                continue
            if units is None:
                J, gap = np.median(motions.cost[arrived]), np.median(motions.gap[arrived])
                units = max(float(J), _MIN_UNIT), max(float(gap), _MIN_UNIT)
            price = first_price * (last_price / first_price) ** (
                1.0 if self._is_near else g / (generations - 1)
            )
            merit = motions.cost / units[0] + price * (motions.gap / units[1] + motions.violation)
            order = np.argsort(merit, kind="stable")[: min(SETTINGS.n_best, len(arrived))]
            best = motions.selected(order)
            smoothing = SETTINGS.smoothing
            mean = smoothing * mean + (1.0 - smoothing) * np.mean(best.theta, axis=0)
            spread = smoothing * spread + (1.0 - smoothing) * np.std(best.theta, axis=0)
            if progress is not None:
                progress(Progress(done=g + 1, total=generations, best=self._iterate(best)))
            if np.mean(spread / max_acceleration) < SETTINGS.min_spread:
                break
        return None if best is None else self._iterate(best)

    def _simulate(self, theta: Array) -> DrawnMotions:
        """The motions of drawn numbers."""
        driven, initial, h = self._driven, self._initial, self._initial.interval
        acc_K = np.repeat(initial.acc_K[None], len(theta), axis=0)
        acc_K[:, :, driven.movable] += self._basis @ theta
        acc_K = driven.clipped(acc_K, h)
        for _ in range(SETTINGS.n_projections):
            acc_K = driven.clipped(driven.projected_onto_end(acc_K, h), h)
        runs = self._motions(acc_K)
        cost, gap, violation = (np.full(len(theta), np.inf) for _ in range(3))
        for i, motion in enumerate(runs):
            if motion is not None:
                nodes, ends = motion
                scaled_gap = self._gap_scale * self._objective.end_gap(nodes)
                cost[i], gap[i] = self._objective.cost(nodes, ends), float(scaled_gap @ scaled_gap)
                violation[i] = float(np.sum(self._objective.rows.violation(nodes, ends)))
        return DrawnMotions(theta, acc_K, cost, gap, violation)

    def _motions(self, acc_K: Array) -> list[tuple[Nodes, Ends] | None]:
        """The nodes of runs, and their intervals; None for a run that did not arrive."""
        initial, task, N = self._initial, self._objective.task, len(self._initial)
        inputs, q_K, v_K = _inputs(initial, acc_K)
        runs = simulate_batch(
            task.marionette,
            task.x0,
            inputs,
            initial.t[-1],
            save_at=initial.t,
            save=_SAVED_QUANTITIES,
            threads=self._threads,
        )
        if np.any(runs.status == Status.STOPPED):
            raise KeyboardInterrupt
        assert runs.tension is not None and runs.limit_force is not None
        force = np.concatenate([runs.tension.values, runs.limit_force.values], axis=2)[:, :-1]
        motions: list[tuple[Nodes, Ends] | None] = [None] * len(acc_K)
        for i in np.flatnonzero(np.isin(runs.status, ARRIVED)):
            assert runs.q_D is not None and runs.v_D is not None
            nodes = replace(
                initial, q_D=runs.q_D[i], v_D=runs.v_D[i], q_K=q_K[i], v_K=v_K[i], acc_K=acc_K[i]
            )
            e, pull = np.zeros((N, nodes.n_z)), force[i]
            motions[i] = nodes, Ends(e, pull, pull > 0.0, np.ones(N, dtype=bool))
        return motions

    def _iterate(self, best: DrawnMotions) -> Iterate:
        """The first of these motions, as an iterate for a search."""
        motion = self._motions(best.acc_K[:1])[0]
        assert motion is not None  # its run arrived before
        nodes, ends = motion
        gap = self._objective.end_gap(nodes)
        return Iterate(nodes, ends, float(best.cost[0]), defect=float(np.max(np.abs(gap))))


def _inputs(initial: Nodes, acc_K: Array) -> tuple[Inputs, Array, Array]:
    """Inputs with constant accelerations, and their (n, N + 1, ...) values and velocities.

    All driven coordinates are scalars.
    """
    table, h = initial.table, initial.interval
    n, N, k = acc_K.shape
    v_K = (
        np.concatenate([np.zeros((n, 1, k)), np.cumsum(h * acc_K, axis=1)], axis=1) + initial.v_K[0]
    )
    q_K = np.tile(initial.q_K[0], (n, N + 1, 1))
    coefficients = np.zeros((n, N, k, N_COEF))
    coefficients[..., 1], coefficients[..., 2] = v_K[:, :-1], 0.5 * acc_K
    for q, v in table.scalars_K:
        q_K[:, 1:, q] += np.cumsum(0.5 * h * (v_K[:, 1:, v] + v_K[:, :-1, v]), axis=1)
        coefficients[..., v, 0] = q_K[:, :-1, q]
    named = np.ones((1, k), dtype=bool)
    return Inputs(table, initial.t[None], coefficients, q_K[:, :-1], named), q_K, v_K
