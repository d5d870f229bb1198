"""Small motions about a state of rest, in the directions left free by rows and contact points.

    dq_D = N eta + Y dq_K,   C N = 0,   N^T M N = 1,   C Y = -C_K
    etaddot + D etadot + K eta = -N^T (r_q Y + r_qK) dq_K - N^T (r_v Y + r_vK) dv_K
                                 - N^T M_DK dacc_K
    D = N^T r_v N,   K = N^T r_q N,   Y = -M^-1 C^T (C M^-1 C^T)^-1 C_K

C are A_D of the rows that pull and the rows of points that push, C_K their rows for the inputs.
r_q is the derivative of gravity, springs, C^T tension and the forces of contact, so it includes
the stiffness from tension.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, StateError
from fantoccini.dynamics.compiled import CompiledPuppet, Evaluation, Screws, retract
from fantoccini.dynamics.derivatives.contact_rows import ContactRows
from fantoccini.dynamics.derivatives.contact_state import Resting, motion_at
from fantoccini.dynamics.derivatives.kkt import DEPENDENT_ROWS
from fantoccini.dynamics.derivatives.linearisation import derivatives_at
from fantoccini.dynamics.derivatives.mode_system import ModeSystem
from fantoccini.motion import State


@dataclass(frozen=True)
class BalanceSettings:
    """Bounds of the search for balance."""

    max_rounds: int = 8
    max_rest_acceleration: float = 1e-7
    """Acceleration of a state at rest [rad/s^2 or m/s^2]: a tenth of the bound for modes."""
    max_move: float = 1e-3
    """Largest move of a round [rad or m]; with larger ones, the set of pulling rows may change."""
    zero_eigenvalue: float = 1e-12  # Eigenvalue of K that counts as 0, relative to the largest


BALANCE = BalanceSettings()
MIN_TENSION = 1e-9
"""Minimum tension of a pulling row, relative to the puppet's weight."""


@dataclass(frozen=True, eq=False)
class SmallMotions:
    """Matrices of the module's equations, with m free directions.

    Attributes:
        held: indices of the strings and limits that pull.
        N: (n_vD, m) free directions.
        M: (n_vD, n_vD) inertia matrix M_DD.
        K, D: (m, m) stiffness and damping.
        forcing: factors of dq_K, dv_K and dacc_K on the right, (m, n_vK) each.
    """

    held: Indices
    N: Array
    M: Array
    K: Array
    D: Array
    forcing: tuple[Array, Array, Array]

    @classmethod
    def of(cls, marionette: CompiledPuppet, x: State, motion: Resting) -> SmallMotions:
        """The small motions about a state of rest.

        Args:
            marionette: the puppet.
            x: the state.
            motion: accelerations, tensions and contacts there.
        """
        tension, points = motion.tension, motion.contacts.points
        held = np.flatnonzero(marionette.two_sided | (tension > MIN_TENSION * marionette.weight))
        at, n, k = Evaluation.of(marionette, x), len(x.v_D), len(x.v_K)
        none_D, none_K = np.zeros(n), np.zeros(k)
        by = derivatives_at(marionette, x, none_D, none_K, tension)
        r_q, r_v, r_qK, r_vK = (by[name] for name in ("r_q", "r_v", "r_qK", "r_vK"))
        rows = ContactRows(Screws(marionette, x, none_D, none_K), points, 0.0)
        widths = np.cumsum([n, n, k, k])
        more = np.split(rows.force_by(), widths, axis=1)
        r_q, r_v, r_qK, r_vK = r_q + more[0], r_v + more[1], r_qK + more[2], r_vK + more[3]
        by_inputs = np.split(rows.velocity_by(), widths, axis=1)[3]
        system = ModeSystem(at, held, rows)
        u, size, _ = np.linalg.svd(system.held, full_matrices=True)
        rank = int(np.sum(size > DEPENDENT_ROWS * np.max(size, initial=0.0)))
        N = at.solve_factor(u[:, rank:].T).T
        C_K = np.concatenate([by["A_K"][held], by_inputs])
        Y, _ = system.solve(np.zeros((n, k)), C_K)
        return cls(
            held,
            N,
            marionette.interpreted("mass_matrix", x).M,
            N.T @ r_q @ N,
            N.T @ r_v @ N,
            (-N.T @ (r_q @ Y + r_qK), -N.T @ (r_v @ Y + r_vK), -N.T @ by["M_DK"]),
        )


def balanced_state(marionette: CompiledPuppet, x: State) -> State:
    """A state near rest, moved until its forces balance, by Newton's method.

    Rows and contact points stay held: K eta = N^T M acc_D. If it does not converge, it is ``x``.
    """
    best, smallest = x, np.inf
    for _ in range(BALANCE.max_rounds):
        try:
            motion = motion_at(marionette, x)
        except StateError:
            break
        remaining = float(np.max(np.abs(motion.acc_D), initial=0.0))
        if not remaining < smallest:
            break
        best, smallest = x, remaining
        if remaining <= BALANCE.max_rest_acceleration:
            break
        small = SmallMotions.of(marionette, x, motion)
        eta = np.linalg.lstsq(small.K, small.N.T @ small.M @ motion.acc_D, BALANCE.zero_eigenvalue)[
            0
        ]
        move = small.N @ eta
        if not 0.0 < np.max(np.abs(move), initial=0.0) < BALANCE.max_move:
            break
        x = x.replace(q_D=retract(marionette, x.q_D, move))
    return best
