"""Planners: which nodes to extend, with which inputs, and which ends to keep.

``est-2007`` is the paper's expansive-space tree (Sec. VII): nodes are chosen with a probability
that falls with their distance from the goal, each gets a random input, and the ends are kept.

``explore`` extends many nodes at once, in lanes on all threads, preferring those in sparse regions
of the tree. A rollout begins with a random exploration phase, with random velocities of the driven
coordinates. Then a linear-quadratic regulator leads it to where the puppet hangs at the goal. The
ends of all its segments are kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.control.planning.search_tree import SearchTree
from fantoccini.control.problems import Rollouts


@dataclass(frozen=True)
class _Sampling:
    """Numbers of the random choices."""

    extra_ends: float = 1.5
    """String ends that explore in addition to the first, on average."""
    min_distance: float = 1e-9
    """Distance from the goal below which nodes are equally likely."""
    min_weight: float = 1e-300
    """Weight of the root, so that there is always a node to choose."""


_SAMPLING = _Sampling()


@dataclass(frozen=True)
class PlannerRound:
    """What one round has added.

    Attributes:
        rollouts: number simulated.
        nodes: numbers of the nodes that were kept.
    """

    rollouts: int
    nodes: range


Planner = Callable[[SearchTree, Rollouts, np.random.Generator], PlannerRound]
"""One round of a planner: grows the tree."""


class EST2007:
    """The paper's planner.

    Args:
        bias: power with which the probability of a node falls with its distance from the goal; 0
            chooses uniformly.
        lasts: least and greatest duration of a rollout, in segments of the problem. Shorter than a
            segment, random inputs cancel one another.
        batch: nodes that are extended at once, in lanes; 1 is the paper's own order.
    """

    def __init__(self, bias: float = 4.0, lasts: tuple[float, float] = (1.0, 5.0), batch: int = 64):
        self.bias, self.lasts, self.batch = bias, lasts, batch

    def __call__(
        self, tree: SearchTree, rollouts: Rollouts, rng: np.random.Generator
    ) -> PlannerRound:
        weight = np.maximum(tree.distance, _SAMPLING.min_distance) ** -self.bias
        chosen = _drawn(weight, self.batch, rng)
        np.add.at(tree.tried, chosen, 1)
        least, most = (max(1, round(part * rollouts.options.looks)) for part in self.lasts)
        looks = int(rng.integers(least, most + 1))
        wanted = rng.uniform(-1.0, 1.0, (self.batch, tree.v_K.shape[1])) * rollouts.bounds.speed
        interval = rollouts.options.interval
        acceleration = towards(wanted, tree.v_K[chosen], 1, looks * interval, rollouts)
        made = rollouts.simulate(tree.states, chosen, acceleration, looks=looks)
        return PlannerRound(made.n_made, tree.add_segments(made, chosen, interval))


class Explore:
    """This project's planner.

    Args:
        batch: rollouts of a round.
        exploration: longest random exploration phase [s].
        guided: longest phase that the regulator leads [s].
        direct: part of the rollouts without an exploration phase.
        lead_time: least and greatest time by which the regulator's reference runs ahead [s].
        cell: size of the cells in which nodes are counted [rad or m].
        haste: power with which the probability of a node falls with its time.
        calm: rollouts that begin the search without an exploration phase where the puppet is to
            touch something: it is not thrown about if that is not needed.
    """

    def __init__(
        self,
        batch: int = 192,
        exploration: float = 1.6,
        guided: float = 4.0,
        direct: float = 0.1,
        lead_time: tuple[float, float] = (0.4, 1.0),
        cell: float = 0.1,
        haste: float = 4.0,
        calm: int = 8,
    ):
        self.batch, self.exploration, self.guided = batch, exploration, guided
        self.direct, self.lead_time, self.cell, self.haste = direct, lead_time, cell, haste
        self.calm = calm

    def __call__(
        self, tree: SearchTree, rollouts: Rollouts, rng: np.random.Generator
    ) -> PlannerRound:
        n = self.batch
        chosen = self._sparse_nodes(tree, rollouts, n, rng)
        np.add.at(tree.tried, chosen, 1)
        duration = rollouts.options.segment
        random, led = (max(1, round(s / duration)) for s in (self.exploration, self.guided))
        n_given = rng.integers(1, random + 1, n)
        led = led if rollouts.funnels else 0
        if led:
            n_given[rng.random(n) < self.direct] = 0
        if led and rollouts.goal.touches and len(tree) == 1:
            n_given[: self.calm] = 0  # the first that arrives is the plan
        wanted = rollouts.bounds.speed * rng.uniform(-1.0, 1.0, (n, tree.v_K.shape[1]))
        wanted *= _some_ends(rollouts, n, rng)
        acceleration = np.empty((n, random + led, wanted.shape[1]))
        acceleration[:, :random] = towards(wanted, tree.v_K[chosen], random, duration, rollouts)
        left = np.minimum((tree.bound - tree.cost[chosen]) / duration, random + led)
        if not led:
            left = np.minimum(left, n_given)
        made = rollouts.simulate(
            tree.states,
            chosen,
            acceleration,
            n_given=n_given,
            n_segments=np.maximum(left, 1.0).astype(int),
            funnel=rng.integers(0, max(1, len(rollouts.funnels)), n),
            lead_time=rng.uniform(*self.lead_time, n),
        )
        return PlannerRound(made.n_made, tree.add_segments(made, chosen, rollouts.options.interval))

    def _sparse_nodes(
        self, tree: SearchTree, rollouts: Rollouts, n: int, rng: np.random.Generator
    ) -> Indices:
        """(n,) nodes, likelier the fewer nodes are near and the less they were extended.

        Nodes from which the driven coordinates cannot reach the goal within the tree's bound are
        left out.
        """
        cells = np.floor(tree.q_K / self.cell).astype(np.int64)
        # Finding equal hashes is a hundred times as fast as finding equal cells.
        number = cells @ _hash_weights(cells.shape[1])
        _, cell, count = np.unique(number, return_inverse=True, return_counts=True)
        early = (1.0 + tree.time) ** -self.haste
        weight = early / (count[cell] * (1.0 + tree.tried))
        if np.isfinite(tree.bound):
            late = tree.cost + time_to_go(tree.q_K, rollouts) > tree.bound
            weight[late] = 0.0
            weight[0] = max(weight[0], _SAMPLING.min_weight)
        return _drawn(weight, n, rng)


def _some_ends(rollouts: Rollouts, n: int, rng: np.random.Generator) -> Array:
    """(n, n_vK) 1 for driven velocities that explore, else 0: all those of a few string ends."""
    of, ends = rollouts.ends
    moves = rng.random((n, ends)) < _SAMPLING.extra_ends / ends
    moves[np.arange(n), rng.integers(0, ends, n)] = True
    return moves[:, of].astype(float)


def time_to_go(q_K: Array, rollouts: Rollouts) -> Array:
    """(n,) least time in which the driven coordinates can reach the funnels' equilibrium [s]."""
    if not rollouts.funnels:
        return np.zeros(len(q_K))
    table, bounds = rollouts.marionette.coordinates, rollouts.bounds
    places = [(q, v) for q, v in table.scalars_K if bounds.moves[v]]
    q, v = np.array(places).T
    away = np.abs(q_K[:, q] - rollouts.funnels[0].q_K[q])
    return np.max(away / bounds.speed[v], axis=1)


def towards(wanted: Array, v_K: Array, segments: int, duration: float, rollouts: Rollouts) -> Array:
    """(n, segments, n_vK) accelerations towards given velocities, within the bounds.

    Args:
        wanted: (n, n_vK) velocities within the bounds.
        v_K: (n, n_vK) velocities at the start.
        segments: of a rollout.
        duration: of a segment [s].
        rollouts: for the bounds.
    """
    left, most = (wanted - v_K)[:, None], duration * rollouts.bounds.acceleration
    gone = np.arange(segments + 1)[:, None] * most
    return np.diff(np.clip(left, -gone, gone), axis=1) / duration


def _drawn(weight: Array, n: int, rng: np.random.Generator) -> Indices:
    """(n,) random indices, with probabilities in proportion to the weights."""
    sums = np.cumsum(weight)
    return np.searchsorted(sums, rng.random(n) * sums[-1])


@cache
def _hash_weights(n: int) -> Indices:
    """(n,) odd numbers that hash n integers into one."""
    return np.random.default_rng(n).integers(1, 2**62, n) | 1
