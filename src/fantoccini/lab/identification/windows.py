"""Windows: adjacent segments, judged together because each changes the next one's jump.

A segment is a piece of a record that is simulated from its own first state; a jump is the
difference of two segments where they meet.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, MaskRows


def with_neighbours(selected: MaskRows, before: int, after: int) -> MaskRows:
    """(S,) bool, chosen segments with this many neighbours before and after each."""
    S, widened = len(selected), np.zeros(len(selected), dtype=bool)
    for s in np.flatnonzero(selected):
        widened[max(0, s - before) : min(S, s + after + 1)] = True
    return widened


def cheaper_windows(selected: MaskRows, before: Array, after: Array) -> MaskRows:
    """(S,) bool, the chosen segments whose window costs less after than before.

    Args:
        selected: (S,) bool, the segments of all windows.
        before, after: (S + 1,) costs of segments; a window's cost includes the jump after it.
    """
    is_cheaper = np.zeros(len(selected), dtype=bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], selected, [False]]).astype(int)))
    for start, stop in edges.reshape(-1, 2):
        window = slice(start, min(stop + 1, len(selected)))
        is_cheaper[start:stop] = np.sum(after[window]) < np.sum(before[window])
    return is_cheaper
