"""Planners: the choice of nodes to extend, of inputs, and of ends to keep.

``est-2007`` is the paper's expansive-space tree (Sec. VII): nodes are chosen with a probability
that falls with their distance from the goal, each gets a random input, and the ends become nodes.

``explore`` extends many nodes at once, in lanes on all threads, preferring those in sparse regions
of the tree. A rollout begins with a random exploration phase, with random velocities of the driven
coordinates. Then a linear-quadratic regulator controls it to the equilibrium at the goal. The
ends of all its segments become nodes.

A node is a state of the search tree, and a segment a piece of a motion with constant accelerations
of the driven coordinates q_K. Lanes are rollouts that the vector unit of the processor advances
together.
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
    """Parameters of the random choices."""

    mean_extra_ends: float = 1.5
    """Mean number of string ends that explore in addition to the first."""
    min_distance: float = 1e-9
    """Distance from the goal below which nodes are equally likely."""
    min_weight: float = 1e-300
    """Weight of the root, so that a node can always be chosen."""


_SAMPLING = _Sampling()


@dataclass(frozen=True)
class PlannerRound:
    """The nodes that one round has added.

    Attributes:
        rollouts: number of rollouts.
        nodes: indices of the added nodes.
    """

    rollouts: int
    nodes: range


Planner = Callable[[SearchTree, Rollouts, np.random.Generator], PlannerRound]
"""One round of a planner, which grows the tree."""


class EST2007:
    """The paper's planner.

    Args:
        bias: exponent of the decrease of a node's probability with its distance from the goal; 0
            for equal probabilities.
        durations: shortest and longest duration of a rollout, in segments of the problem; below
            one segment, random inputs cancel one another.
        batch: number of nodes extended at once, in lanes; 1 is the paper's own order.
    """

    def __init__(
        self, bias: float = 4.0, durations: tuple[float, float] = (1.0, 5.0), batch: int = 64
    ):
        self.bias, self.durations, self.batch = bias, durations, batch

    def __call__(
        self, tree: SearchTree, rollouts: Rollouts, rng: np.random.Generator
    ) -> PlannerRound:
        weight = np.maximum(tree.distance, _SAMPLING.min_distance) ** -self.bias
        start_nodes = _random_indices(weight, self.batch, rng)
        np.add.at(tree.tried, start_nodes, 1)
        min_checks, max_checks = (
            max(1, round(share * rollouts.options.n_checks)) for share in self.durations
        )
        n_checks = int(rng.integers(min_checks, max_checks + 1))
        velocity = rng.uniform(-1.0, 1.0, (self.batch, tree.v_K.shape[1])) * rollouts.bounds.speed
        interval = rollouts.options.interval
        acceleration = accelerations_towards(
            velocity, tree.v_K[start_nodes], 1, n_checks * interval, rollouts
        )
        segments = rollouts.simulate(tree.states, start_nodes, acceleration, n_checks=n_checks)
        return PlannerRound(
            segments.n_simulated, tree.add_segments(segments, start_nodes, interval)
        )


class Explore:
    """This project's planner.

    Args:
        batch: number of rollouts in a round.
        max_exploration_time: longest random exploration phase [s].
        max_guided_time: longest phase led by the regulator [s].
        direct_share: share of the rollouts without an exploration phase.
        lead_times: smallest and largest lead time of the regulator's reference [s].
        cell_size: size of the cells in which nodes are counted [rad or m].
        time_exponent: exponent of the decrease of a node's probability with its time.
        n_first_direct: number of first rollouts without an exploration phase if the puppet must
            touch something, which avoids unnecessary large swings.
    """

    def __init__(
        self,
        batch: int = 192,
        max_exploration_time: float = 1.6,
        max_guided_time: float = 4.0,
        direct_share: float = 0.1,
        lead_times: tuple[float, float] = (0.4, 1.0),
        cell_size: float = 0.1,
        time_exponent: float = 4.0,
        n_first_direct: int = 8,
    ):
        self.batch, self.max_exploration_time = batch, max_exploration_time
        self.max_guided_time, self.direct_share = max_guided_time, direct_share
        self.lead_times, self.cell_size = lead_times, cell_size
        self.time_exponent, self.n_first_direct = time_exponent, n_first_direct

    def __call__(
        self, tree: SearchTree, rollouts: Rollouts, rng: np.random.Generator
    ) -> PlannerRound:
        n = self.batch
        start_nodes = self._sparse_nodes(tree, rollouts, n, rng)
        np.add.at(tree.tried, start_nodes, 1)
        duration = rollouts.options.segment
        n_random, n_guided = (
            max(1, round(time / duration))
            for time in (self.max_exploration_time, self.max_guided_time)
        )
        n_prescribed = rng.integers(1, n_random + 1, n)
        n_guided = n_guided if rollouts.laws else 0
        if n_guided:
            n_prescribed[rng.random(n) < self.direct_share] = 0
        if n_guided and rollouts.goal.touches and len(tree) == 1:
            n_prescribed[: self.n_first_direct] = 0  # the first rollout that arrives is the plan
        velocity = rollouts.bounds.speed * rng.uniform(-1.0, 1.0, (n, tree.v_K.shape[1]))
        velocity *= _exploring_velocities(rollouts, n, rng)
        acceleration = np.empty((n, n_random + n_guided, velocity.shape[1]))
        acceleration[:, :n_random] = accelerations_towards(
            velocity, tree.v_K[start_nodes], n_random, duration, rollouts
        )
        n_segments = np.minimum(
            (tree.bound - tree.cost[start_nodes]) / duration, n_random + n_guided
        )
        if not n_guided:
            n_segments = np.minimum(n_segments, n_prescribed)
        segments = rollouts.simulate(
            tree.states,
            start_nodes,
            acceleration,
            n_prescribed=n_prescribed,
            n_segments=np.maximum(n_segments, 1.0).astype(int),
            law=rng.integers(0, max(1, len(rollouts.laws)), n),
            lead_time=rng.uniform(*self.lead_times, n),
        )
        return PlannerRound(
            segments.n_simulated,
            tree.add_segments(segments, start_nodes, rollouts.options.interval),
        )

    def _sparse_nodes(
        self, tree: SearchTree, rollouts: Rollouts, n: int, rng: np.random.Generator
    ) -> Indices:
        """(n,) nodes, with more weight on those with few neighbours and few rollouts.

        Nodes from which the driven coordinates cannot reach the goal within the tree's bound are
        left out.
        """
        cells = np.floor(tree.q_K / self.cell_size).astype(np.int64)
        # Comparing hashes is a hundred times as fast as comparing cells.
        hashes = cells @ _hash_weights(cells.shape[1])
        _, cell, count = np.unique(hashes, return_inverse=True, return_counts=True)
        time_weight = (1.0 + tree.time) ** -self.time_exponent
        weight = time_weight / (count[cell] * (1.0 + tree.tried))
        if np.isfinite(tree.bound):
            too_costly = tree.cost + time_to_go(tree.q_K, rollouts) > tree.bound
            weight[too_costly] = 0.0
            weight[0] = max(weight[0], _SAMPLING.min_weight)
        return _random_indices(weight, n, rng)


def _exploring_velocities(rollouts: Rollouts, n: int, rng: np.random.Generator) -> Array:
    """(n, n_vK) 1 for the exploring driven velocities, those of some string ends; 0 for others."""
    end_of_velocity, ends = rollouts.string_ends
    is_exploring = rng.random((n, ends)) < _SAMPLING.mean_extra_ends / ends
    is_exploring[np.arange(n), rng.integers(0, ends, n)] = True
    return is_exploring[:, end_of_velocity].astype(float)


def time_to_go(q_K: Array, rollouts: Rollouts) -> Array:
    """(n,) least time in which the driven coordinates can reach the laws' equilibrium [s]."""
    if not rollouts.laws:
        return np.zeros(len(q_K))
    table, bounds = rollouts.marionette.coordinates, rollouts.bounds
    indices = [(q, v) for q, v in table.scalars_K if bounds.movable[v]]
    q, v = np.array(indices).T
    distance = np.abs(q_K[:, q] - rollouts.laws[0].q_K[q])
    return np.max(distance / bounds.speed[v], axis=1)


def accelerations_towards(
    target: Array, v_K: Array, segments: int, duration: float, rollouts: Rollouts
) -> Array:
    """(n, segments, n_vK) accelerations towards given velocities, within the bounds.

    Args:
        target: (n, n_vK) velocities within the bounds.
        v_K: (n, n_vK) velocities at the start.
        segments: number of segments in a rollout.
        duration: duration of a segment [s].
        rollouts: rollouts with the bounds.
    """
    change, max_change = (target - v_K)[:, None], duration * rollouts.bounds.acceleration
    reachable = np.arange(segments + 1)[:, None] * max_change
    return np.diff(np.clip(change, -reachable, reachable), axis=1) / duration


def _random_indices(weight: Array, n: int, rng: np.random.Generator) -> Indices:
    """(n,) random indices, with probabilities in proportion to the weights."""
    cumulative_weight = np.cumsum(weight)
    return np.searchsorted(cumulative_weight, rng.random(n) * cumulative_weight[-1])


@cache
def _hash_weights(n: int) -> Indices:
    """(n,) odd numbers that hash n integers into one."""
    return np.random.default_rng(n).integers(1, 2**62, n) | 1
