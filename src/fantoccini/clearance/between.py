"""Distances along a path: nothing is passed between samples, however thin it is (Mirtich 1996).

No point of a solid is farther from where it is in a configuration than the path on which it goes
there, so that

    d(t) >= d(c) - path_i(c, t) - path_j(c, t)

for two solids. What may thereby come nearer than a limit is looked at again in the middles of both
halves, until it cannot.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fantoccini.arrays import Array, Indices, Mask
from fantoccini.clearance.path import Path
from fantoccini.runtime import Moves

_AT_ONCE = 8192
"""Intervals that are looked at together."""

Measure = Callable[[Array, Array, Moves], tuple[Array, Array]]
"""q_D, q_K (m, ...) and moves -> distances (m,), and bounds below which none falls (m,) [m]."""

Look = Callable[["Places", Array, Array], Indices]
"""Told of places, distances (m,) and bounds (m,) there; the numbers of those to look around."""


class Places(NamedTuple):
    """Places on a path.

    Attributes:
        piece: (m,) of the path.
        s: (m,) times since its beginning [s].
        t: (m,) [s].
        q_D, q_K: (m, n_qD), (m, n_qK).
    """

    piece: Indices
    s: Array
    t: Array
    q_D: Array
    q_K: Array

    def some(self, which: Indices | Mask) -> Places:
        """Those that a mask or indices choose."""
        piece, s, t, q_D, q_K = self
        return Places(piece[which], s[which], t[which], q_D[which], q_K[which])


def advance(path: Path, measure: Measure, look: Look) -> None:
    """Looks at the samples of a path, and between them wherever that is asked for."""
    last = len(path) - 1
    for first in range(0, last + 1, _AT_ONCE):
        k = np.arange(first, min(first + _AT_ONCE, last + 1))
        at = Places(k, np.zeros(len(k)), path.t[k], path.q_D[k], path.q_K[k])
        moves = Moves(*(x[k] for x in path.around))
        around = k[look(at, *measure(at.q_D, at.q_K, moves))]
        before, after = around[around > 0] - 1, around[around < last]
        piece = np.concatenate([before, after])
        h = path.h[piece]
        start = np.concatenate([0.5 * h[: len(before)], np.zeros(len(after))])
        _between(path, measure, look, piece, start, start + 0.5 * h)


def _between(
    path: Path, measure: Measure, look: Look, piece: Indices, start: Array, end: Array
) -> None:
    """Looks into intervals (m,) of pieces, given by their ends [s]."""
    kept = end > start
    waiting = [(piece[kept], start[kept], end[kept])] if np.any(kept) else []
    while waiting:
        piece, start, end = waiting.pop()
        if len(piece) > _AT_ONCE:
            waiting.append((piece[_AT_ONCE:], start[_AT_ONCE:], end[_AT_ONCE:]))
            piece, start, end = piece[:_AT_ONCE], start[:_AT_ONCE], end[:_AT_ONCE]
        middle = 0.5 * (start + end)
        at = Places(piece, middle, path.t[piece] + middle, *path.at(piece, middle))
        halves = path.moves(piece, start, middle), path.moves(piece, middle, end)
        moves = Moves(*(np.maximum(a, b) for a, b in zip(*halves, strict=True)))
        around = look(at, *measure(at.q_D, at.q_K, moves))
        around = around[(start[around] < middle[around]) & (middle[around] < end[around])]
        if len(around):
            piece = piece[around]
            start, middle, end = (x[around] for x in (start, middle, end))
            waiting.append((
                np.concatenate([piece, piece]),
                np.concatenate([start, middle]),
                np.concatenate([middle, end]),
            ))
