"""Where the driven coordinates must be for a puppet to hang in a pose, or nearly so."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares, nnls

from fantoccini.arrays import Array, ConfigD, ConfigK, MaskRows
from fantoccini.marionette import Marionette

_SOFT = 1e-3
"""Weight of how far string ends move, so that those that matter to nothing stay."""


def balanced(marionette: Marionette, q_D: ConfigD, q_K: ConfigK, moves: MaskRows) -> ConfigK:
    """q_K at which a pose is nearest to an equilibrium on its strings.

        min over q_K and T >= 0 of |w_0 - W T|^2,   acc_D = F^-1 (w_0 - W T) at rest

    Driven lengths are those that just reach.

    Args:
        marionette: the puppet.
        q_D: the pose.
        q_K: where to begin.
        moves: (n_vK,) bool, the driven coordinates that may be elsewhere.
    """
    tree, p = marionette.tree, marionette.p
    at_rest = np.zeros(marionette.coordinates.n_vD), np.zeros(marionette.coordinates.n_vK)
    movable = [q for q, v in marionette.coordinates.scalars_K if moves[v]]
    lengths = [
        (i, s.length_index[0])
        for i, s in enumerate(tree.strings)
        if s.length_index and s.length_index[0] in movable
    ]
    ends = np.setdiff1d(movable, [k for _, k in lengths]).astype(int)

    def reaching(x: Array) -> Array:
        made = q_K.copy()
        made[ends] = x
        for _, k in lengths:
            made[k] = 0.0
        (h,) = marionette.library.evaluate("rows", [q_D, made, p])
        for i, k in lengths:
            made[k] = h[i]
        return made

    def unbalanced(x: Array) -> Array:
        v_D, v_K = at_rest
        arguments = [q_D, v_D, reaching(x), v_K, v_K, v_D, p]
        _, w0, W, *_ = marionette.library.evaluate("dynamics", arguments)
        W = W.reshape(len(tree.strings), -1).T
        tension, _ = nnls(W, w0)
        return np.concatenate([w0 - W @ tension, _SOFT * (x - q_K[ends])])

    if not tree.strings or not len(ends):
        return reaching(q_K[ends])
    return reaching(least_squares(unbalanced, q_K[ends], max_nfev=60).x)
