"""Which pairs of cores may come near each other, and when: a search through blocks of time.

In a block no point of a core is farther from where it is at the block's middle sample c than the
path it travels, so that

    d(t) >= d(c) - path_i - path_j - stray_i - stray_j

with d the distance of chords and stray the sag of slack strings. Blocks in which this bound is
large are done with; the others are cut into smaller ones, down to single steps between samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array, Indices, Mask
from fantoccini.clearance.cores import Cores

_SIZES = (256, 64, 16, 4, 1)
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


Keep = Callable[[Indices, Indices, Array, Array], Mask]
"""Which blocks to cut: of pairs (m,), middle samples (m,), distances (m,) of chords there and lower
bounds (m,) in the block, both without radii [m]."""


def search(cores: Cores, pairs: Pairs, keep: Keep) -> tuple[Indices, Indices]:
    """The pairs (m,) and first samples (m,) of the steps that ``keep`` keeps at last.

    A step goes from its sample to the next one; the last sample's has no length.
    """
    last = cores.a.shape[1] - 1
    start = np.arange(0, last + 1, _SIZES[0])
    pair = np.repeat(np.arange(len(pairs)), len(start))
    start = np.tile(start, len(pairs))
    for size, smaller in zip(_SIZES, (*_SIZES[1:], 0), strict=True):
        middle = np.minimum(start + size // 2, last)
        distance = cores.straight(pairs.i[pair], pairs.j[pair], middle)
        lower = distance.copy()
        most = _most(cores.stray, size)
        for core in (pairs.i[pair], pairs.j[pair]):
            path = cores.travelled
            end = np.minimum(start + size, last)
            there = path[core, middle]
            lower -= np.maximum(path[core, end] - there, there - path[core, start])
            lower -= most[core, start // size]
        kept = keep(pair, middle, distance, lower)
        pair, start = pair[kept], start[kept]
        if smaller:
            cuts = np.arange(0, size, smaller)
            pair, start = np.repeat(pair, len(cuts)), (start[:, None] + cuts).ravel()
            inside = start <= last
            pair, start = pair[inside], start[inside]
    return pair, start


def _most(values: Array, size: int) -> Array:
    """(n, n_blocks) largest of values (n, T) in every block, the next one's first included."""
    starts = np.arange(0, values.shape[1], size)
    most = np.maximum.reduceat(values, starts, axis=1)
    most[:, :-1] = np.maximum(most[:, :-1], values[:, starts[1:]])
    return most
