"""Where a puppet hangs at a goal, or as near to it as it can hang."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import nnls

from fantoccini.arrays import Array, ConfigD, ConfigK, MaskRows
from fantoccini.marionette import Marionette
from fantoccini.marionette.projection import retract
from fantoccini.motion import State
from fantoccini.planning.goals import Goal, States

_SOFT = 1e-3
"""Weight of how far driven coordinates move, so that those that matter to nothing stay."""

_SOFTER = 1e-4
"""Weight of how far the others do."""

_PULLS = 1e-6
"""Tension beside the puppet's weight from which on a string pulls."""

_SLACK = 0.005
"""That strings which do not pull have at least [m]."""

_FREE = 0.05
"""Room that is left to limits on the way [rad or m]."""

_STAGES = 8
"""In which a goal is approached."""

_STEP = 1e-7
"""Of finite differences [m or rad]."""

_LAST = 1e-6
"""Step after which nothing is left to do: what is left of an error is 1e-7 of it [m or rad]."""

_FARTHEST = 0.5
"""That a coordinate moves in one iteration [m or rad]."""


def balanced(
    marionette: Marionette, goal: Goal, start: State, moves: MaskRows
) -> tuple[ConfigD, ConfigK, float]:
    """The pose nearest to a goal and to an equilibrium on its strings.

        min over q_D, q_K and T >= 0 of |w_0 - W T|^2 + |goal's residuals|^2 + |limits passed|^2,
        acc_D = F^-1 (w_0 - W T) at rest

    Driven lengths are those that just reach; strings that do not pull keep the slack they have at
    the start. Where the goal is a whole configuration, q_D is that.

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
        (i, s.driven_length[0])
        for i, s in enumerate(tree.strings)
        if s.driven_length and moves[s.driven_length[1]]
    ]
    reeled = {k for _, k in lengths}
    ends = [q for q, v in table.scalars_K if moves[v] and q not in reeled]
    pinned = goal.whole
    n_D = 0 if pinned is not None else table.n_vD
    origin = start.q_D if pinned is None else pinned
    first = np.concatenate([np.zeros(n_D), start.q_K[ends]])

    def configurations(x: Array) -> tuple[Array, Array]:
        """(n, n_qD), (n, n_qK) of rows (n, n_D + ends)."""
        q_D = retract(marionette.model, origin, x[:, :n_D]) if n_D else np.tile(origin, (len(x), 1))
        q_K = np.tile(start.q_K, (len(x), 1))
        q_K[:, ends] = x[:, n_D:]
        return q_D, q_K

    def lacking(x: Array) -> Array:
        """(n, m) w_0 - W T, what the goal lacks, and how far coordinates are from the start."""
        q_D, q_K = configurations(x)
        left, _, limits = pulled(marionette, q_D, q_K)
        parts = [left, _SOFT * soft * (x - first)[:, n_D:]]
        if pinned is None:
            q_K = reached(q_D, q_K)
            away = q_K - start.q_K
            parts.append(np.maximum(limits + soft * _FREE, 0.0))
            parts += [_SOFT * soft * away[:, list(reeled)], _SOFTER * soft * x[:, :n_D]]
            none_D, none_K = np.zeros((len(x), table.n_vD)), np.zeros((len(x), table.n_vK))
            slip = np.zeros((len(x), len(tree.strings)))
            off = goal.residuals(States(q_D, none_D, slip, q_K, none_K))
            parts.append(off if begun is None else off - left_over * begun)
        return np.concatenate(parts, axis=1)

    def reached(q_D: Array, q_K: Array) -> Array:
        """q_K with the lengths at which the strings just reach."""
        if lengths:
            q_K[:, [k for _, k in lengths]] = 0.0
            h = marionette.model.library.evaluate("rows", q_D=q_D, q_K=q_K, p=p).h
            for i, k in lengths:
                q_K[:, k] = h[:, i]
        return q_K

    soft, x, begun, left_over = 1.0, first, None, 0.0
    if len(first) and tree.strings:
        if pinned is None:
            # To the goal by stages, so that what hangs stays what hangs.
            begun = goal.residuals(States.of(start))[0]
            for stage in range(1, _STAGES):
                left_over = 1.0 - stage / _STAGES
                x = _least(lacking, x)
            left_over = 0.0
            x = _least(lacking, x)
        # Then what was found is only put right.
        soft = 0.0
        x = _least(lacking, x)
    q_D, q_K = configurations(x[None])
    left, tension, _ = pulled(marionette, q_D, q_K)
    q_K = reached(q_D, q_K)[0]
    h = marionette.model.library.evaluate("rows", q_D=start.q_D, q_K=start.q_K, p=p).h
    for i, k in lengths:
        if not tension[0, i] > _PULLS * marionette.weight:
            q_K[k] += max(_SLACK, -h[i])
    return q_D[0], q_K, float(np.linalg.norm(left))


def pulled(marionette: Marionette, q_D: Array, q_K: Array) -> tuple[Array, Array, Array]:
    """How strings hold configurations at rest best.

    All strings are taken for taut, whatever their lengths; limits do not help.

    Args:
        marionette: the puppet.
        q_D, q_K: (n, n_qD), (n, n_qK).

    Returns:
        w_0 - W T (n, n_vD), T (n, n_strings) [N], and h of limits (n, n_limits).
    """
    tree, table, n = marionette.tree, marionette.coordinates, len(q_D)
    wires = [i for i, s in enumerate(tree.strings) if s.wire]
    none_D, none_K = np.zeros((n, table.n_vD)), np.zeros((n, table.n_vK))
    found = marionette.model.library.evaluate(
        "dynamics", q_D=q_D, v_D=none_D, q_K=q_K, v_K=none_K, acc_K=none_K, u_D=none_D,
        p=marionette.p,
    )  # fmt: skip
    w0, W, h_limit = found.w0, found.W, found.h_limit
    # Wires push too.
    both = np.concatenate([W, -W[:, :, wires]], axis=2)
    if not both.shape[2]:  # SciPy's nnls writes where it must not without columns
        return w0, np.zeros((n, 0)), h_limit
    pulls = np.array([nnls(A, w)[0] for A, w in zip(both, w0, strict=True)])
    tension = pulls[:, : len(tree.strings)]
    tension[:, wires] -= pulls[:, len(tree.strings) :]
    return w0 - np.einsum("nij,nj->ni", W, tension), tension, h_limit


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
        if size < _LAST:
            return x + move
        if not gained:
            break
        x = x + move * min(1.0, _FARTHEST / size)
    return before
