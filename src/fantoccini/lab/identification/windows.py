"""Windows: adjacent segments, judged together because each changes the next one's jump."""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, MaskRows


def spread(chosen: MaskRows, before: int, after: int) -> MaskRows:
    """(S,) bool, chosen segments with this many neighbours before and after each."""
    S, spread_out = len(chosen), np.zeros(len(chosen), dtype=bool)
    for s in np.flatnonzero(chosen):
        spread_out[max(0, s - before) : min(S, s + after + 1)] = True
    return spread_out


def cheaper(chosen: MaskRows, before: Array, after: Array) -> MaskRows:
    """(S,) bool, the chosen segments whose window costs less after than before.

    Args:
        chosen: (S,) bool, the segments of all windows.
        before, after: (S + 1,) costs of segments; a window's cost includes the jump after it.
    """
    cheaper_ones = np.zeros(len(chosen), dtype=bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]]).astype(int)))
    for start, stop in edges.reshape(-1, 2):
        window = slice(start, min(stop + 1, len(chosen)))
        cheaper_ones[start:stop] = np.sum(after[window]) < np.sum(before[window])
    return cheaper_ones
