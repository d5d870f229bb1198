"""Which pairs of cores may come near each other, and when: a search through blocks of time.

In a block no point of a core is farther from where it is at the block's middle sample c than the
path that it travels, so that

    d(t) >= d(c) - path_i - path_j,   d(c) >= chords(c) - stray_i - stray_j

with stray the largest distance of a slack string from its chord. Blocks in which this bound is
large are done with; the others are cut into smaller ones, down to steps between samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.dynamics.clearance.cores import Cores

_SIZES = (64, 16, 4, 1)
"""Steps in a block."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of cores.

    Attributes:
        i, j: (n,) cores; i are pieces of strings.
        group: (n,) number of the pair of names that a pair belongs to.
        swollen: (n,) sum of the radii [m].
    """

    i: Indices
    j: Indices
    group: Indices
    swollen: Array

    def __len__(self) -> int:
        return len(self.i)


Limit = Callable[[Indices, Indices], Array]
"""Distances without radii up to which pairs (m,) count in blocks from samples (m,) on [m]."""

Take = Callable[[Indices, Indices, Array], None]
"""Told of the distances without radii (m,) of pairs (m,) at samples (m,) [m]."""


def search(
    cores: Cores, pairs: Pairs, limit: Limit, take: Take | None = None
) -> tuple[Indices, Indices]:
    """The pairs (m,) and first samples (m,) of the steps in which they may be nearer than a limit.

    A step goes from its sample to the next one; that of the last sample has no length.

    Args:
        cores: along a motion.
        pairs: of them.
        limit: of the distance, which may shrink while the search goes on.
        take: called with what is measured on the way; last with the first samples of steps.
    """
    last = cores.a.shape[1] - 1
    start = np.arange(0, last + 1, _SIZES[0])
    pair = np.repeat(np.arange(len(pairs)), len(start))
    start = np.tile(start, len(pairs))
    for size, smaller in zip(_SIZES, (*_SIZES[1:], 0), strict=True):
        middle = np.minimum(start + size // 2, last)
        most = _most(cores.stray, size)
        block = start // size
        stray = most[pairs.i[pair], block] + most[pairs.j[pair], block]
        moved = _moved(cores, pairs, pair, middle, start, size)
        distance = cores.straight(pairs.i[pair], pairs.j[pair], middle)
        kept = np.flatnonzero(distance - moved - stray < limit(pair, start))
        pair, start, middle = pair[kept], start[kept], middle[kept]
        distance, moved = distance[kept], moved[kept]
        # Slack strings move little as well: where they hang says more than how far they may sag.
        bent = np.flatnonzero(stray[kept] > 0.0)
        i, j = pairs.i[pair[bent]], pairs.j[pair[bent]]
        distance[bent] = cores.exact(i, j, middle[bent])[0]
        if take is not None:
            take(pair, middle, distance)
        kept = np.flatnonzero(distance - moved < limit(pair, start))
        pair, start, middle, distance = pair[kept], start[kept], middle[kept], distance[kept]
        if smaller:
            cuts = np.arange(0, size, smaller)
            start = (start[:, None] + cuts).ravel()
            pair, middle, distance = (np.repeat(x, len(cuts)) for x in (pair, middle, distance))
            kept = np.flatnonzero(start <= last)
            pair, start, middle, distance = pair[kept], start[kept], middle[kept], distance[kept]
            # The whole block's middle speaks for its parts, before anything is measured there.
            lower = distance - _moved(cores, pairs, pair, middle, start, smaller)
            kept = np.flatnonzero(lower < limit(pair, start))
            pair, start = pair[kept], start[kept]
    return pair, start


def _moved(
    cores: Cores, pairs: Pairs, pair: Indices, k: Indices, start: Indices, size: int
) -> Array:
    """How far pairs (m,) move at most from samples k to any of the steps from ``start`` on [m]."""
    end = np.minimum(start + size, cores.a.shape[1] - 1)
    moved = np.zeros(len(pair))
    for core in (pairs.i[pair], pairs.j[pair]):
        there = cores.travelled[core, k]
        after, before = cores.travelled[core, end] - there, there - cores.travelled[core, start]
        moved += np.maximum(after, before)
    return moved


def _most(values: Array, size: int) -> Array:
    """(n, n_blocks) largest of values (n, T) in every block, the next one's first included."""
    starts = np.arange(0, values.shape[1], size)
    most = np.maximum.reduceat(values, starts, axis=1)
    most[:, :-1] = np.maximum(most[:, :-1], values[:, starts[1:]])
    return most
