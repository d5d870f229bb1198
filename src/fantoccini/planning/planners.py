"""What a planner does: which nodes to go on from, with which inputs, and what to keep.

``est-2007`` is the paper's expansive-space tree (Sec. VII): nodes chosen with a probability that
falls with their distance from the goal, a random input for each, and the ends are kept.

``explore`` goes on from many nodes at a time, in lanes on all threads, those where little was tried
first. A motion goes astray for a while, with random velocities of the driven coordinates, and is
then led to where the puppet hangs at the goal, by a linear-quadratic regulator that takes the swing
out of it, until it is there or something is in the way. The ends of all its segments are kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from fantoccini.arrays import Array
from fantoccini.planning.motions import Motions
from fantoccini.planning.search_tree import SearchTree


@dataclass(frozen=True)
class Grown:
    """What one round has added.

    Attributes:
        motions: that were made.
        nodes: numbers of the nodes that were kept.
    """

    motions: int
    nodes: range


_ASTRAY = 1.5
"""Ends that go astray beside the first, on average."""

Planner = Callable[[SearchTree, Motions, np.random.Generator], Grown]
"""One round of a planner: grows the tree."""


class EST2007:
    """The paper's planner.

    Args:
        bias: power with which the probability of a node falls with its distance from the goal; 0
            chooses uniformly.
        lasts: how long a motion lasts, in segments of the problem: at least and at most. Motions
            of less than a segment diffuse: their random inputs cancel one another.
        batch: nodes that are chosen at once and gone on from side by side, in lanes; 1 is the
            paper's own order.
    """

    def __init__(self, bias: float = 4.0, lasts: tuple[float, float] = (1.0, 5.0), batch: int = 64):
        self.bias, self.lasts, self.batch = bias, lasts, batch

    def __call__(self, tree: SearchTree, motions: Motions, rng: np.random.Generator) -> Grown:
        weight = np.maximum(tree.distance, 1e-9) ** -self.bias
        chosen = _drawn(weight, self.batch, rng)
        np.add.at(tree.tried, chosen, 1)
        least, most = (max(1, round(part * motions.looks)) for part in self.lasts)
        looks = int(rng.integers(least, most + 1))
        wanted = rng.uniform(-1.0, 1.0, (self.batch, tree.v_K.shape[1])) * motions.bounds.speed
        acceleration = towards(wanted, tree.v_K[chosen], 1, looks * motions.interval, motions)
        made = motions.sweep(tree.rows, chosen, acceleration, looks=looks)
        return Grown(made.n_made, tree.add_segments(made, chosen, motions.interval))


class Explore:
    """Our planner.

    Args:
        batch: motions a round.
        astray: for so long a motion goes astray, at most [s].
        led: for so long it is led, at most [s].
        direct: part of the motions that are led from the beginning.
        hurry: least and greatest time in which the regulator's reference runs ahead [s].
        cell: size of the cells whose nodes are counted [rad or m].
        haste: power with which the probability of a node falls with its time.
    """

    def __init__(
        self,
        batch: int = 192,
        astray: float = 1.6,
        led: float = 4.0,
        direct: float = 0.1,
        hurry: tuple[float, float] = (0.4, 1.0),
        cell: float = 0.1,
        haste: float = 4.0,
    ):
        self.batch, self.astray, self.led = batch, astray, led
        self.direct, self.hurry, self.cell, self.haste = direct, hurry, cell, haste

    def __call__(self, tree: SearchTree, motions: Motions, rng: np.random.Generator) -> Grown:
        n = self.batch
        chosen = self._where_little_was_tried(tree, motions, n, rng)
        np.add.at(tree.tried, chosen, 1)
        duration = motions.looks * motions.interval
        astray, led = (max(1, round(s / duration)) for s in (self.astray, self.led))
        given = rng.integers(1, astray + 1, n)
        led = led if motions.funnels else 0
        if led:
            given[rng.random(n) < self.direct] = 0
        wanted = motions.bounds.speed * rng.uniform(-1.0, 1.0, (n, tree.v_K.shape[1]))
        wanted *= _some_ends(motions, n, rng)
        acceleration = np.empty((n, astray + led, wanted.shape[1]))
        acceleration[:, :astray] = towards(wanted, tree.v_K[chosen], astray, duration, motions)
        left = np.minimum((tree.bound - tree.cost[chosen]) / duration, astray + led)
        if not led:
            left = np.minimum(left, given)
        made = motions.sweep(
            tree.rows,
            chosen,
            acceleration,
            given=given,
            made=np.maximum(left, 1.0).astype(int),
            which=rng.integers(0, max(1, len(motions.funnels)), n),
            reach=rng.uniform(*self.hurry, n),
        )
        return Grown(made.n_made, tree.add_segments(made, chosen, motions.interval))

    def _where_little_was_tried(
        self, tree: SearchTree, motions: Motions, n: int, rng: np.random.Generator
    ) -> Array:
        """Nodes with a probability that falls with the nodes about them and with their trials.

        Those from which the driven coordinates cannot be at the goal within the tree's bound have
        none.
        """
        cells = np.floor(tree.q_K / self.cell).astype(np.int64)
        # A cell's number, by which equal ones are found a hundred times as fast as by its places.
        number = cells @ _mixing(cells.shape[1])
        _, cell, count = np.unique(number, return_inverse=True, return_counts=True)
        early = (1.0 + tree.time) ** -self.haste
        weight = early / (count[cell] * (1.0 + tree.tried))
        if np.isfinite(tree.bound):
            late = tree.cost + time_to_go(tree.q_K, motions) > tree.bound
            weight[late] = 0.0
            weight[0] = max(weight[0], 1e-300)
        return _drawn(weight, n, rng)


def _some_ends(motions: Motions, n: int, rng: np.random.Generator) -> Array:
    """(n, n_vK) 1 for driven coordinates that go astray: all of an end's, and of few ends."""
    of, ends = motions.ends
    moves = rng.random((n, ends)) < _ASTRAY / ends
    moves[np.arange(n), rng.integers(0, ends, n)] = True
    return moves[:, of].astype(float)


def time_to_go(q_K: Array, motions: Motions) -> Array:
    """Seconds (n,) in which the driven coordinates could be where funnels lead; 0 without."""
    if not motions.funnels:
        return np.zeros(len(q_K))
    table, bounds = motions.marionette.coordinates, motions.bounds
    places = [(q, v) for q, v in table.scalars_K if bounds.moves[v]]
    q, v = np.array(places).T
    away = np.abs(q_K[:, q] - motions.funnels[0].q_K[q])
    return np.max(away / bounds.speed[v], axis=1)


def towards(wanted: Array, v_K: Array, segments: int, duration: float, motions: Motions) -> Array:
    """Accelerations (n, segments, n_vK) that bring velocities to wanted ones, within the bounds.

    Args:
        wanted: (n, n_vK) within the bounds.
        v_K: (n, n_vK) at the start.
        segments: of a motion.
        duration: of a segment [s].
        motions: for the bounds.
    """
    left, most = (wanted - v_K)[:, None], duration * motions.bounds.acceleration
    gone = np.arange(segments + 1)[:, None] * most
    return np.diff(np.clip(left, -gone, gone), axis=1) / duration


def _drawn(weight: Array, n: int, rng: np.random.Generator) -> Array:
    """n places, each with a probability in proportion to its weight."""
    sums = np.cumsum(weight)
    return np.searchsorted(sums, rng.random(n) * sums[-1])


@cache
def _mixing(n: int) -> Array:
    """Odd numbers that mix n places to one."""
    return np.random.default_rng(n).integers(1, 2**62, n) | 1
