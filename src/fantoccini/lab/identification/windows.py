"""Windows: runs of segments that are judged together, as each changes the gap of the next."""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, MaskRows


def spread(some: MaskRows, before: int, after: int) -> MaskRows:
    """Segments (S,) and so many before and after each."""
    S, out = len(some), np.zeros(len(some), dtype=bool)
    for s in np.flatnonzero(some):
        out[max(0, s - before) : min(S, s + after + 1)] = True
    return out


def cheaper(some: MaskRows, before: Array, after: Array) -> MaskRows:
    """(S,) bool, those of ``some`` (S,) whose window costs less after than before.

    Args:
        some: the segments of windows.
        before, after: (S + 1,) costs of segments; the gap behind a window is part of its cost.
    """
    out = np.zeros(len(some), dtype=bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], some, [False]]).astype(int)))
    for start, stop in edges.reshape(-1, 2):
        own = slice(start, min(stop + 1, len(some)))
        out[start:stop] = np.sum(after[own]) < np.sum(before[own])
    return out
