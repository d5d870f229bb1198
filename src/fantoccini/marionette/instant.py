"""One evaluation of the compiled model, with its rows: the Python side of ``evaluation.hpp``.

    hddot = gamma + A_D acc_D,   acc_D = F^-1 (w0 + W lambda),   W = F^-T A_D^T,   M_DD = F^T F
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.contract import WINCH_AT
from fantoccini.marionette.model import BRAKE, Model
from fantoccini.marionette.vectors import vector
from fantoccini.motion import State
from fantoccini.runtime import Complementarity, Library
from fantoccini.tree import Tree


@dataclass(frozen=True, eq=False)
class Instant:
    """The model's quantities at one state.

    Attributes:
        library: the compiled puppet.
        L: packed factor of M_DD.
        w0: (n_vD,) F^-T of the forces without strings.
        W: (n_vD, n_rows) F^-T A_D^T, strings then limits.
        h, hdot, gamma: (n_rows,) [m or rad, and per s, per s^2]; of strings with what has slipped.
        hdot_K: (n_rows,) A_K v_K.
    """

    library: Library
    L: Array
    w0: Array
    W: Array
    h: Array
    hdot: Array
    gamma: Array
    hdot_K: Array

    @classmethod
    def of(
        cls,
        library: Library,
        tree: Tree,
        x: State,
        p: Array,
        acc_K: Array,
        u_D: Array,
        dt: float = 0.0,
    ) -> Instant:
        """Evaluates the model at a state.

        Args:
            library: the compiled puppet.
            tree: its tree.
            x: the state.
            p: (n_p,) parameters.
            acc_K: (n_vK,) accelerations of the inputs.
            u_D: (n_vD,) user forces.
            dt: step over which damping and drag act implicitly, as in a first time step [s].
        """
        n, n_l = len(x.v_D), len(tree.limits)
        at = {
            "q_D": x.q_D, "v_D": x.v_D, "q_K": x.q_K, "v_K": x.v_K, "acc_K": acc_K, "u_D": u_D,
            "p": p,
        }  # fmt: skip
        on = factor = library.evaluate("dynamics", **at)
        if dt:
            factor = library.evaluate("step_dynamics", **at, v_ahead=x.v_D, dt=dt)
        J = np.zeros((n_l, n))
        for i, limit in enumerate(tree.limits):
            place = tree.links[limit.link].v
            J[i, place] = on.J_limit[: place.stop - place.start, i]
        W_l = library.evaluate("forth", L=factor.L, x=J).y if n_l else np.zeros((0, n))
        return cls(
            library,
            factor.L,
            factor.w0,
            np.concatenate([factor.W.T, W_l]).T,
            np.concatenate([on.h - x.slip if len(x.slip) else on.h, on.h_limit]),
            np.concatenate([on.hdot, J @ x.v_D]),
            np.concatenate([on.gamma, on.gamma_limit]),
            np.concatenate([on.hdot_K, np.zeros(n_l)]),
        )

    def back(self, w: Array) -> Array:
        """F^-1 w for vectors (..., n_vD)."""
        return self.library.evaluate("back", L=self.L, x=w).y

    def forth(self, f: Array) -> Array:
        """L^-T f for vectors (..., n_vD)."""
        return self.library.evaluate("forth", L=self.L, x=f).y

    def complementarity(
        self, rows: Array, b: Array, two_sided: Array, upper: Array | None = None
    ) -> Complementarity:
        """x and s of G x - b = s over some rows; see ``active_set.hpp``.

        Args:
            rows: indices.
            b: (len(rows),) right-hand side.
            two_sided: (n_rows,) bool.
            upper: (n_rows,) bounds of x; none when not given.
        """
        bounds = None if upper is None else upper[rows]
        return self.library.complementarity(self.W[:, rows], b, two_sided[rows], bounds)


def instant_at(
    model: Model, x: State, acc_K: Array | None = None, u_D: Array | None = None
) -> Instant:
    """The compiled model's quantities at a state.

    Args:
        model: the puppet.
        x: the state.
        acc_K: (n_vK,) accelerations of the inputs; 0 when not given.
        u_D: (n_vD,) user forces; 0 when not given.
    """
    table = model.coordinates
    acc_K = vector("acc_K", acc_K, table.n_vK)
    u_D = vector("u_D", u_D, table.n_vD)
    model.states([x])
    made = Instant.of(model.library, model.tree, x, model.p, acc_K, u_D)
    if len(x.slip):
        speed, braked = model.winches[:, WINCH_AT["rewind_speed"]], np.sqrt(2.0 * BRAKE * x.slip)
        made.hdot[: len(x.slip)] -= model.winding(x.slip)
        made.gamma[: len(x.slip)] -= np.where((braked > 0) & (braked < speed), BRAKE, 0.0)
    return made
