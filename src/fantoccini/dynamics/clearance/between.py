"""Conservative advancement: distances along a path, safe between samples (Mirtich 1996).

The displacement of a point between two configurations is at most the length of its path. Hence

    d(t) >= d(c) - path_i(c, t) - path_j(c, t)

for two solids. Intervals in which this bound permits a distance below a limit are halved, until it
no longer does.

d(t) is the distance of solids i and j at time t, d(c) that at a sample, and path the length that a
point of a solid travels. q_D and q_K are the dynamic and driven coordinates at the samples.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, Indices, Mask
from fantoccini.dynamics.clearance.path import Path
from fantoccini.kernel.runtime import Moves

_BATCH_SIZE = 8192
"""Number of intervals measured together."""

Measure = Callable[[Array, Array, Moves], tuple[Array, Array]]
"""Callback: q_D, q_K (m, ...) and moves -> distances (m,) and lower bounds on moves (m,) [m]."""

Criterion = Callable[["Places", Array, Array], Indices]
"""Callback: places, distances (m,), lower bounds (m,) -> indices of the places to refine."""


class Places(NamedTuple):
    """Places on a path.

    Attributes:
        piece: (m,) pieces of the path.
        s: (m,) times since the beginnings of the pieces [s].
        t: (m,) times [s].
        q_D, q_K: (m, n_qD) dynamic and (m, n_qK) driven (kinematic) configurations.
    """

    piece: Indices
    s: Array
    t: Array
    q_D: Array
    q_K: Array

    def subset(self, selection: Indices | Mask) -> Places:
        """The places selected by a mask or indices."""
        piece, s, t, q_D, q_K = self
        return Places(piece[selection], s[selection], t[selection], q_D[selection], q_K[selection])


def advance(path: Path, measure: Measure, criterion: Criterion) -> None:
    """Measures the samples of a path, and refines between them where ``criterion`` requires it."""
    last = len(path) - 1
    for first in range(0, last + 1, _BATCH_SIZE):
        k = np.arange(first, min(first + _BATCH_SIZE, last + 1))
        places = Places(k, np.zeros(len(k)), path.t[k], path.q_D[k], path.q_K[k])
        moves = Moves(*(x[k] for x in path.midpoint_bounds))
        to_refine = k[criterion(places, *measure(places.q_D, places.q_K, moves))]
        before, after = to_refine[to_refine > 0] - 1, to_refine[to_refine < last]
        piece = np.concatenate([before, after])
        h = path.h[piece]
        start = np.concatenate([0.5 * h[: len(before)], np.zeros(len(after))])
        _refine(path, measure, criterion, piece, start, start + 0.5 * h)


def _refine(
    path: Path, measure: Measure, criterion: Criterion, piece: Indices, start: Array, end: Array
) -> None:
    """Refines intervals (m,) of pieces, given by their ends [s]."""
    is_open = end > start
    pending = [(piece[is_open], start[is_open], end[is_open])] if np.any(is_open) else []
    while pending:
        piece, start, end = pending.pop()
        if len(piece) > _BATCH_SIZE:
            pending.append((piece[_BATCH_SIZE:], start[_BATCH_SIZE:], end[_BATCH_SIZE:]))
            piece, start, end = piece[:_BATCH_SIZE], start[:_BATCH_SIZE], end[:_BATCH_SIZE]
        middle = 0.5 * (start + end)
        places = Places(piece, middle, path.t[piece] + middle, *path.at(piece, middle))
        half_bounds = path.move_bounds(piece, start, middle), path.move_bounds(piece, middle, end)
        moves = Moves(*(np.maximum(a, b) for a, b in zip(*half_bounds, strict=True)))
        to_refine = criterion(places, *measure(places.q_D, places.q_K, moves))
        to_refine = to_refine[
            (start[to_refine] < middle[to_refine]) & (middle[to_refine] < end[to_refine])
        ]
        if len(to_refine):
            piece = piece[to_refine]
            start, middle, end = (x[to_refine] for x in (start, middle, end))
            pending.append(
                (
                    np.concatenate([piece, piece]),
                    np.concatenate([start, middle]),
                    np.concatenate([middle, end]),
                )
            )
