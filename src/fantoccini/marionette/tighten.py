"""Rows that are taut in a state's mode brought to h = 0, from what a step has left of them."""

from __future__ import annotations

import numpy as np

from fantoccini.arrays import MaskRows
from fantoccini.marionette.closed import CLOSED
from fantoccini.marionette.configurations import integrate
from fantoccini.marionette.instant import instant_at
from fantoccini.marionette.model import Model
from fantoccini.motion import State

_ROUNDS = 20
_NEAR = 0.05
"""Rows that a move may reach, by h over their scale."""
_MET = 1e-14
"""|h| of a row that is met, over its scale."""
_LONGEST = 0.3
"""Longest move of a round [rad or m]."""


def tightened(model: Model, x: State, taut: MaskRows) -> State:
    """The nearest state, in the metric of M_DD, with h = 0 on some rows and h <= 0 on the others.

    Args:
        model: the puppet.
        x: a state that no row forbids, in which those rows are nearly closed.
        taut: (n_rows,) bool, the rows.

    Returns:
        The state, with ``taut`` as its mode as far as that could be met: rows that contradict one
        another stay slack.
    """
    moved, wires = x, model.two_sided
    if not np.any(taut):
        return x.replace(taut=taut)
    scale = model.row_scales(x.q_D, x.q_K)
    for _ in range(_ROUNDS):
        instant = instant_at(model, moved)
        off = np.where(taut | wires, np.abs(instant.h), instant.h) > _MET * scale
        if not np.any(off):
            break
        rows = np.flatnonzero((instant.h > -_NEAR * scale) | taut | wires)
        found = instant.complementarity(rows, instant.h[rows], taut | wires)
        if not found.solved:
            break
        move = -instant.back(instant.W[:, rows] @ found.x)
        size = float(np.max(np.abs(move), initial=0.0))
        move *= min(1.0, _LONGEST / max(size, _LONGEST))
        moved = moved.replace(q_D=integrate(model, moved.q_D, move))
    h = instant_at(model, moved).h
    met = np.abs(h) <= CLOSED * scale
    if np.all(met | ((h <= CLOSED * scale) & ~taut & ~wires)):
        return moved.replace(taut=taut)
    # Fewer rows may be met, none always are.
    fewer = taut & met
    return tightened(model, x, fewer if np.any(fewer != taut) else np.zeros_like(taut))
