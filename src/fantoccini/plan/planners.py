"""What a planner does: which nodes to go on from, with which inputs, and what to keep.

``est-2007`` is the paper's expansive-space tree (Sec. VII): one node at a time, chosen with a
probability that falls with its distance from the goal, a random input, and the end is kept.

``explore`` goes on from many nodes at a time, in lanes on all threads: some of them near the goal,
the others where little was tried. Where the driven coordinates are known at the goal, part of the
motions are led there. All states along a motion are looked at; of the first kind of motions the
state is kept that has the least left, of the second any.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.plan.goals import Goal
from fantoccini.plan.motions import Motions
from fantoccini.plan.search_tree import SearchTree


@dataclass(frozen=True)
class Grown:
    """What one round has added.

    Attributes:
        motions: that were made.
        nodes: numbers of the nodes that were kept.
    """

    motions: int
    nodes: range


Planner = Callable[[SearchTree, Motions, Goal, np.random.Generator], Grown]
"""One round of a planner: grows the tree."""


class EST2007:
    """The paper's planner.

    Args:
        bias: power with which the probability of a node falls with its distance from the goal; 0
            chooses uniformly.
        looks: how long a motion lasts, in looks: at least and at most.
    """

    def __init__(self, bias: float = 4.0, looks: tuple[int, int] = (2, 10)):
        self.bias, self.looks = bias, looks

    def __call__(
        self, tree: SearchTree, motions: Motions, goal: Goal, rng: np.random.Generator
    ) -> Grown:
        weight = np.maximum(tree.distance, 1e-9) ** -self.bias
        chosen = _drawn(weight, 1, rng)
        looks = int(rng.integers(self.looks[0], self.looks[1] + 1))
        acceleration = random_accelerations(tree, motions, goal, chosen, looks, rng)
        swept = motions.sweep(tree.rows[chosen], acceleration, looks)
        tree.tried[chosen] += 1
        if not swept.good[0, -1]:
            return Grown(1, range(len(tree), len(tree)))
        end = swept.rows[:, -1]
        distance = goal.distance(end)
        ends = np.array([looks])
        return Grown(1, tree.add(end, chosen, acceleration, ends, motions.interval, distance))


class Explore:
    """Our planner.

    Args:
        batch: motions a round.
        looks: how long a motion lasts, in looks.
        greedy: part of the motions that begin near the goal.
        led: part of the motions that are led to where the driven coordinates are at the goal.
        cell: size of the cells whose nodes are counted [rad or m].
        weary: by how much a trial makes a node count as farther from the goal.
        spread: part of the nodes among which promising ones are chosen, on average.
    """

    def __init__(
        self,
        batch: int = 256,
        looks: int = 40,
        greedy: float = 0.6,
        led: float = 0.5,
        cell: float = 0.25,
        weary: float = 2.0,
        spread: float = 0.02,
    ):
        self.batch, self.looks, self.greedy = batch, looks, greedy
        self.led, self.cell, self.weary, self.spread = led, cell, weary, spread

    def __call__(
        self, tree: SearchTree, motions: Motions, goal: Goal, rng: np.random.Generator
    ) -> Grown:
        n_greedy = int(self.greedy * self.batch)
        chosen = np.concatenate(
            [
                self._promising(tree, motions, goal, n_greedy, rng),
                self._where_little_was_tried(tree, self.batch - n_greedy, rng),
            ]
        )
        np.add.at(tree.tried, chosen, 1)
        acceleration = random_accelerations(tree, motions, goal, chosen, self.looks, rng, self.led)
        swept = motions.sweep(tree.rows[chosen], acceleration, self.looks)
        distance = np.where(swept.good, goal.distance(swept.rows), np.inf)
        to_go = distance + time_to_go(swept.rows.q_K, motions, goal)
        reach = swept.good.sum(axis=1) - 1  # the last look that is good
        promising = np.argmin(to_go[:, 1:], axis=1) + 1
        anywhere = 1 + np.floor(rng.random(self.batch) * np.maximum(reach, 1)).astype(int)
        end = np.where(np.arange(self.batch) < n_greedy, promising, anywhere)
        # What comes nearer to the goal than all before is kept whoever finds it.
        nearest = np.argmin(distance[:, 1:], axis=1) + 1
        best = distance[np.arange(self.batch), nearest]
        end = np.where(best < tree.distance.min(), nearest, end)
        kept = np.flatnonzero(reach >= 1)
        end = end[kept]
        nodes = tree.add(
            swept.rows[kept, end],
            chosen[kept],
            acceleration[kept],
            end,
            motions.interval,
            distance[kept, end],
        )
        return Grown(self.batch, nodes)

    def _promising(
        self, tree: SearchTree, motions: Motions, goal: Goal, n: int, rng: np.random.Generator
    ) -> Array:
        """Nodes by their rank in what is left; one that was often tried counts as farther."""
        left = tree.distance + time_to_go(tree.q_K, motions, goal)
        order = np.argsort(left * (1.0 + self.weary * tree.tried), kind="stable")
        rank = rng.exponential(1.0 + self.spread * len(order), n).astype(int)
        return order[np.minimum(rank, len(order) - 1)]

    def _where_little_was_tried(self, tree: SearchTree, n: int, rng: np.random.Generator) -> Array:
        """Nodes with a probability that falls with the nodes about them and with their trials."""
        features = np.concatenate([tree.q_D, tree.q_K], axis=1)
        cells = np.floor(features / self.cell).astype(np.int64)
        # A cell's number, by which equal ones are found a hundred times as fast as by its places.
        number = cells @ _mixing(cells.shape[1])
        _, cell, count = np.unique(number, return_inverse=True, return_counts=True)
        weight = 1.0 / (count[cell] * (1.0 + tree.tried))
        return _drawn(weight, n, rng)


def time_to_go(q_K: Array, motions: Motions, goal: Goal) -> Array:
    """Seconds in which the driven coordinates could be where they are at the goal.

    Args:
        q_K: (..., n_qK).
        motions: for the bounds.
        goal: 0 where it says nothing of the driven coordinates.

    Returns:
        (...) [s].
    """
    if goal.q_K is None:
        return np.zeros(q_K.shape[:-1])
    moves = motions.bounds.moves
    away = np.abs(q_K - goal.q_K)[..., moves]
    return np.max(away / motions.bounds.speed[moves], axis=-1)


def _drawn(weight: Array, n: int, rng: np.random.Generator) -> Array:
    """n places, each with a probability in proportion to its weight."""
    sums = np.cumsum(weight)
    return np.searchsorted(sums, rng.random(n) * sums[-1])


def _mixing(n: int) -> Array:
    """Odd numbers that mix n places to one."""
    return np.random.default_rng(n).integers(1, 2**62, n) | 1


def random_accelerations(
    tree: SearchTree,
    motions: Motions,
    goal: Goal,
    chosen: Array,
    looks: int,
    rng: np.random.Generator,
    led: float = 0.0,
) -> Array:
    """Accelerations (n, n_vK) towards random velocities within the bounds.

    Args:
        tree: the nodes.
        motions: for the bounds and the times.
        goal: where its driven coordinates are known, some motions are led there.
        chosen: (n,) nodes.
        looks: how long the motions last.
        rng: of all choices.
        led: part of the motions that are led.
    """
    bounds, duration = motions.bounds, looks * motions.interval
    v_K = tree.v_K[chosen]
    wanted = rng.uniform(-1.0, 1.0, v_K.shape)
    if goal.q_K is not None and led > 0.0:
        n = len(chosen)
        patience = duration * (1.0 + 3.0 * rng.random((n, 1)))
        away = np.where(bounds.moves, goal.q_K - tree.q_K[chosen], 0.0)
        there = away / patience / np.where(bounds.moves, bounds.speed, 1.0)
        # All together slow down to the slowest, so that the ends go straight there.
        there /= np.maximum(1.0, np.abs(there).max(axis=1, keepdims=True))
        astray = wanted * rng.choice([0.0, 0.2, 0.6], (n, 1))
        wanted = np.where(rng.random((n, 1)) < led, np.clip(there + astray, -1.0, 1.0), wanted)
    acceleration = (wanted * bounds.speed - v_K) / duration
    return np.clip(acceleration, -bounds.acceleration, bounds.acceleration)
