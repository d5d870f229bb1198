"""One evaluation of the compiled model with its rows: the Python side of ``model/evaluation.hpp``.

hddot = gamma + A_D acc_D,   acc_D = F^-1 (w0 + W lambda),   W = F^-T A_D^T,   M_DD = F^T F

A row is a string or a joint limit with its gap h <= 0, and A_D its derivatives by the dynamic
coordinates. acc_D are the dynamic accelerations; w0 gives them without strings, and lambda is minus
the tensions. In names, K stands for driven coordinates: ends and lengths of strings, driven joints.
Slip is the length of string that a winch lets out at its largest tension.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, MaskRows
from fantoccini.dynamics.compiled.compiled_puppet import CompiledPuppet
from fantoccini.dynamics.compiled.vector_checks import vector
from fantoccini.kernel.contract import WINCH_AT, WINCH_DECELERATION
from fantoccini.kernel.runtime import Complementarity, Library
from fantoccini.motion import State


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The model's quantities at one state.

    Attributes:
        library: the compiled puppet.
        L: packed factor of M_DD.
        w0: (n_vD,) vector F^-T f, with f the forces without strings.
        W: (n_vD, n_rows) matrix F^-T A_D^T, strings then limits.
        h, hdot, gamma: (n_rows,) gaps and their rates [m or rad, per s, per s^2], including slip.
    """

    library: Library
    L: Array
    w0: Array
    W: Array
    h: Array
    hdot: Array
    gamma: Array

    @classmethod
    def at_state(
        cls,
        marionette: CompiledPuppet,
        x: State,
        acc_K: Array | None = None,
        u_D: Array | None = None,
    ) -> Evaluation:
        """Evaluates the model at a state.

        Args:
            marionette: the puppet.
            x: the state.
            acc_K: (n_vK,) accelerations of the inputs; 0 by default.
            u_D: (n_vD,) user forces; 0 by default.

        Raises:
            StateError: the state or a vector does not fit the puppet.
        """
        library, tree, table = marionette.library, marionette.tree, marionette.coordinates
        acc_K, u_D = vector("acc_K", acc_K, table.n_vK), vector("u_D", u_D, table.n_vD)
        slip = marionette.states([x]).slip[0]
        evaluated = library.evaluate("dynamics", **marionette.at(x), acc_K=acc_K, u_D=u_D)
        n_l = len(tree.limits)
        J = np.zeros((n_l, table.n_vD))
        limit, axis, velocity = tree.limit_entries
        J[limit, velocity] = evaluated.J_limit[axis, limit]
        W_l = library.evaluate("solve_factor_transposed", L=evaluated.L, x=J).y if n_l else J
        # A winch that rewinds slip brakes before it stops.
        rewind_speed = marionette.winches[:, WINCH_AT["rewind_speed"]]
        braking_speed = np.sqrt(2.0 * WINCH_DECELERATION * slip)
        deceleration = np.where(
            (braking_speed > 0) & (braking_speed < rewind_speed), WINCH_DECELERATION, 0.0
        )
        return cls(
            library,
            evaluated.L,
            evaluated.w0,
            np.concatenate([evaluated.W.T, W_l]).T,
            np.concatenate([evaluated.h - slip, evaluated.h_limit]),
            np.concatenate([evaluated.hdot - marionette.rewinding(slip), J @ x.v_D]),
            np.concatenate([evaluated.gamma - deceleration, evaluated.gamma_limit]),
        )

    def solve_factor(self, w: Array) -> Array:
        """Vectors F^-1 w (..., n_vD)."""
        return self.library.evaluate("solve_factor", L=self.L, x=w).y

    def solve_factor_transposed(self, f: Array) -> Array:
        """Vectors F^-T f (..., n_vD)."""
        return self.library.evaluate("solve_factor_transposed", L=self.L, x=f).y

    def complementarity(
        self, rows: Indices, b: Array, two_sided: MaskRows, upper: Array | None = None
    ) -> Complementarity:
        """Solution x, s of G x - b = s over selected rows; see :meth:`Library.complementarity`.

        Args:
            rows: indices of the rows.
            b: (len(rows),) right-hand side.
            two_sided: (n_rows,) mask of wires.
            upper: (n_rows,) bounds of x; no bounds by default.
        """
        bounds = None if upper is None else upper[rows]
        return self.library.complementarity(self.W[:, rows], b, two_sided[rows], bounds)
