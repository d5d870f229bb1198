"""Where a puppet hangs at a goal, or as near to it as it can hang."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import nnls

from fantoccini.arrays import Array, ConfigD, ConfigK, MaskRows
from fantoccini.marionette import Marionette
from fantoccini.marionette.statics import retract
from fantoccini.motion import State
from fantoccini.plan.goals import Goal, Rows

_SOFT = 1e-3
"""Weight of how far coordinates move, so that those that matter to nothing stay."""

_STEP = 1e-7
"""Of finite differences [m or rad]."""

_FARTHEST = 0.5
"""That a coordinate moves in one iteration [m or rad]."""


def balanced(
    marionette: Marionette, goal: Goal, start: State, moves: MaskRows
) -> tuple[ConfigD, ConfigK, float]:
    """The pose nearest to a goal and to an equilibrium on its strings.

        min over q_D, q_K and T >= 0 of |w_0 - W T|^2 + |goal's residuals|^2,
        acc_D = F^-1 (w_0 - W T) at rest

    Driven lengths are those that just reach. Where the goal is a whole configuration, q_D is that.

    Args:
        marionette: the puppet.
        goal: what is wanted.
        start: where to begin.
        moves: (n_vK,) bool, the driven coordinates that may be elsewhere.

    Returns:
        q_D, q_K, and the size of w_0 - W T, that is 0 in an equilibrium.
    """
    tree, p, table = marionette.tree, marionette.p, marionette.coordinates
    lengths = [
        (i, s.length_index[0])
        for i, s in enumerate(tree.strings)
        if s.length_index and moves[s.length_index[1]]
    ]
    reeled = {k for _, k in lengths}
    ends = [q for q, v in table.scalars_K if moves[v] and q not in reeled]
    wires = [i for i, s in enumerate(tree.strings) if s.wire]
    pinned = goal.whole
    n_D = 0 if pinned is not None else table.n_vD
    origin = start.q_D if pinned is None else pinned
    first = np.concatenate([np.zeros(n_D), start.q_K[ends]])

    def configurations(x: Array) -> tuple[Array, Array]:
        """(n, n_qD), (n, n_qK) of rows (n, n_D + ends)."""
        q_D = retract(marionette, origin, x[:, :n_D]) if n_D else np.tile(origin, (len(x), 1))
        q_K = np.tile(start.q_K, (len(x), 1))
        q_K[:, ends] = x[:, n_D:]
        return q_D, q_K

    def lacking(x: Array) -> Array:
        """(n, m) w_0 - W T, what the goal lacks, and how far x is from where it began.

        None of it depends on the strings' lengths, but what the user's functions make of them.
        """
        q_D, q_K = configurations(x)
        none_D, none_K = np.zeros((len(x), table.n_vD)), np.zeros((len(x), table.n_vK))
        arguments = [q_D, none_D, q_K, none_K, none_K, none_D, p]
        _, w0, W, *_ = marionette.library.evaluate("dynamics", arguments)
        W = W.reshape(len(x), -1, table.n_vD).swapaxes(1, 2)[:, :, : len(tree.strings)]
        if wires:  # they push too
            W = np.concatenate([W, -W[:, :, wires]], axis=2)
        left = np.array([w - A @ nnls(A, w)[0] for w, A in zip(w0, W, strict=True)])
        parts = [left, _SOFT * (x - first)]
        if pinned is None:
            if goal.function is not None:
                q_K = reached(q_D, q_K)
            slip = np.zeros((len(x), len(tree.strings)))
            parts.append(goal.residuals(Rows(q_D, none_D, slip, q_K, none_K)))
        return np.concatenate(parts, axis=1)

    def reached(q_D: Array, q_K: Array) -> Array:
        """q_K with the lengths at which the strings just reach."""
        if lengths:
            q_K[:, [k for _, k in lengths]] = 0.0
            (h,) = marionette.library.evaluate("rows", [q_D, q_K, p])
            for i, k in lengths:
                q_K[:, k] = h[:, i]
        return q_K

    x = _least(lacking, first) if len(first) and tree.strings else first
    q_D, q_K = configurations(x[None])
    left = lacking(x[None])[0, : table.n_vD]
    return q_D[0], reached(q_D, q_K)[0], float(np.linalg.norm(left))


def _least(residuals: Callable[[Array], Array], x: Array) -> Array:
    """x at which the squares of residuals are least, by Gauss and Newton with halved steps.

    All slopes of an iteration are one call of the library, which counts: a planner has
    milliseconds, of which SciPy's least squares would take ten.

    Args:
        residuals: of (n, k) points, (n, m).
        x: (k,) where to begin.
    """
    steps, least, before = _STEP * np.eye(len(x)), np.inf, x
    for _ in range(60):
        found = residuals(np.concatenate([x[None], x + steps]))
        squares = float(found[0] @ found[0])
        if not squares < least:
            if np.max(np.abs(x - before)) < 1e-9:
                break
            x = 0.5 * (x + before)
            continue
        slopes = (found[1:] - found[0]).T / _STEP
        move = -np.linalg.lstsq(slopes, found[0], rcond=None)[0]
        size = float(np.max(np.abs(move)))
        gained = squares < (1.0 - 1e-6) * least
        least, before = squares, x
        if size < 1e-9 or not gained:
            break
        x = x + move * min(1.0, _FARTHEST / size)
    return before
