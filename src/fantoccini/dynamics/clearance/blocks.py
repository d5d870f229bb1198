"""Pairs of cores that may come near each other: a search through blocks of time.

In a block no point of a core is farther from its place at the middle sample c than the length of
its path, so that

    d(t) >= d(c) - path_i - path_j,   d(c) >= chords(c) - sag_i - sag_j

with sag the largest distance of a slack string from its chord. Blocks in which this bound is
large are finished; the others are cut into smaller ones, down to steps between samples.

A core is the segment, box or ellipsoid that stands for a piece of a string or for a solid. The
chord of a string is the straight line between its ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.dynamics.clearance.cores import Cores

_SIZES = (64, 16, 4, 1)
"""Numbers of steps in a block, the coarsest first."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of cores.

    Attributes:
        i, j: (n,) cores; i are pieces of strings.
        group: (n,) index of the pair of names to which a pair belongs.
        radii_sum: (n,) sum of the radii [m].
    """

    i: Indices
    j: Indices
    group: Indices
    radii_sum: Array

    def __len__(self) -> int:
        return len(self.i)


Limit = Callable[[Indices, Indices], Array]
"""Callback: pairs (m,), first samples of blocks (m,) -> upper limits of distances [m]."""

Take = Callable[[Indices, Indices, Array], None]
"""Callback: pairs (m,), samples (m,) and their distances without radii (m,) [m]."""


def search(
    cores: Cores, pairs: Pairs, limit: Limit, callback: Take | None = None
) -> tuple[Indices, Indices]:
    """Pairs (m,) and first samples (m,) of the steps in which they may be nearer than a limit.

    A step goes from its sample to the next one; the step of the last sample has no length.

    Args:
        cores: cores along a motion.
        pairs: pairs of these cores.
        limit: limit of the distance, which may shrink while the search goes on.
        callback: callback for every measurement; its last call is for the first samples of steps.
    """
    last = cores.a.shape[1] - 1
    start = np.arange(0, last + 1, _SIZES[0])
    pair = np.repeat(np.arange(len(pairs)), len(start))
    start = np.tile(start, len(pairs))
    for size, next_size in zip(_SIZES, (*_SIZES[1:], 0), strict=True):
        middle = np.minimum(start + size // 2, last)
        maxima = _block_maxima(cores.sag, size)
        block = start // size
        sag_bound = maxima[pairs.i[pair], block] + maxima[pairs.j[pair], block]
        travel = _max_travel(cores, pairs, pair, middle, start, size)
        distance = cores.straight(pairs.i[pair], pairs.j[pair], middle)
        candidates = np.flatnonzero(distance - travel - sag_bound < limit(pair, start))
        pair, start, middle = pair[candidates], start[candidates], middle[candidates]
        distance, travel = distance[candidates], travel[candidates]
        # Slack strings move little as well: their curves give a better bound than their sag.
        slack = np.flatnonzero(sag_bound[candidates] > 0.0)
        i, j = pairs.i[pair[slack]], pairs.j[pair[slack]]
        distance[slack] = cores.exact(i, j, middle[slack])[0]
        if callback is not None:
            callback(pair, middle, distance)
        candidates = np.flatnonzero(distance - travel < limit(pair, start))
        pair, start, middle, distance = (
            pair[candidates],
            start[candidates],
            middle[candidates],
            distance[candidates],
        )
        if next_size:
            offsets = np.arange(0, size, next_size)
            start = (start[:, None] + offsets).ravel()
            pair, middle, distance = (np.repeat(x, len(offsets)) for x in (pair, middle, distance))
            candidates = np.flatnonzero(start <= last)
            pair, start, middle, distance = (
                pair[candidates],
                start[candidates],
                middle[candidates],
                distance[candidates],
            )
            # The middle of the whole block bounds its parts, before anything is measured there.
            lower_bound = distance - _max_travel(cores, pairs, pair, middle, start, next_size)
            candidates = np.flatnonzero(lower_bound < limit(pair, start))
            pair, start = pair[candidates], start[candidates]
    return pair, start


def _max_travel(
    cores: Cores, pairs: Pairs, pair: Indices, k: Indices, start: Indices, size: int
) -> Array:
    """Largest travel (m,) of pairs (m,) from samples k to any step after ``start`` [m]."""
    end = np.minimum(start + size, cores.a.shape[1] - 1)
    travel = np.zeros(len(pair))
    for core in (pairs.i[pair], pairs.j[pair]):
        at_sample = cores.travelled[core, k]
        after, before = (
            cores.travelled[core, end] - at_sample,
            at_sample - cores.travelled[core, start],
        )
        travel += np.maximum(after, before)
    return travel


def _block_maxima(values: Array, size: int) -> Array:
    """Maxima (n, n_blocks) of values (n, T) in every block, including the next block's first."""
    starts = np.arange(0, values.shape[1], size)
    maxima = np.maximum.reduceat(values, starts, axis=1)
    maxima[:, :-1] = np.maximum(maxima[:, :-1], values[:, starts[1:]])
    return maxima
