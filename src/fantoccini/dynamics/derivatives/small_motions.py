"""Small motions about a state of rest, in the directions left free by rows and contact points.

    dq_D = N eta + Y dq_K,   C N = 0,   N^T M N = 1,   C Y = -C_K
    etaddot + D etadot + K eta = -N^T (r_q Y + r_qK) dq_K - N^T (r_v Y + r_vK) dv_K
                                 - N^T M_DK dacc_K
    D = N^T r_v N,   K = N^T r_q N,   Y = -M^-1 C^T (C M^-1 C^T)^-1 C_K

C has the rows A_D of held strings and limits, then those of touching points; C_K has the same rows
for the driven velocities v_K.
r_q is the derivative of gravity, springs, C^T tension and the forces of contact, so it includes
the stiffness from tension.

A row is a string or a joint limit; A_D are its derivatives by the dynamic coordinates q_D, M is the
inertia matrix, q_K are the driven coordinates, and eta the free coordinates of the motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices
from fantoccini.dynamics.compiled import CompiledPuppet, Evaluation, Screws
from fantoccini.dynamics.derivatives.contact_rows import ContactRows
from fantoccini.dynamics.derivatives.contact_state import RestMotion
from fantoccini.dynamics.derivatives.kkt import DEPENDENT_ROWS
from fantoccini.dynamics.derivatives.linearisation import derivatives_at
from fantoccini.dynamics.derivatives.mode_system import ModeSystem
from fantoccini.motion import State

MIN_TENSION = 1e-9
"""Minimum tension of a pulling row, relative to the puppet's weight."""


@dataclass(frozen=True, eq=False)
class SmallMotions:
    """Matrices of the module's equations, with m free directions.

    Attributes:
        held: indices of the held rows; see :func:`held_rows`.
        N: (n_vD, m) free directions.
        M: (n_vD, n_vD) inertia matrix M_DD.
        K, D: (m, m) stiffness and damping.
        forcing: (m, n_vK) each, factors of dq_K, dv_K and dacc_K on the right-hand side.
    """

    held: Indices
    N: Array
    M: Array
    K: Array
    D: Array
    forcing: tuple[Array, Array, Array]

    @classmethod
    def about_rest(cls, marionette: CompiledPuppet, x: State, motion: RestMotion) -> SmallMotions:
        """The small motions about a state of rest.

        Args:
            marionette: the puppet.
            x: the state.
            motion: accelerations, tensions and contacts there.
        """
        tension, points = motion.tension, motion.contacts.points
        held = held_rows(marionette, tension)
        evaluation, n, k = Evaluation.at_state(marionette, x), len(x.v_D), len(x.v_K)
        zero_D, zero_K = np.zeros(n), np.zeros(k)
        derivatives = derivatives_at(marionette, x, zero_D, zero_K, tension)
        r_q, r_v, r_qK, r_vK = (derivatives[name] for name in ("r_q", "r_v", "r_qK", "r_vK"))
        rows = ContactRows(Screws(marionette, x, zero_D, zero_K), points, 0.0)
        widths = np.cumsum([n, n, k, k])
        contact_terms = np.split(rows.force_by(), widths, axis=1)
        r_q, r_v, r_qK, r_vK = (
            r_q + contact_terms[0],
            r_v + contact_terms[1],
            r_qK + contact_terms[2],
            r_vK + contact_terms[3],
        )
        contact_by_v_K = np.split(rows.velocity_by(), widths, axis=1)[3]
        system = ModeSystem(evaluation, held, rows)
        N = free_directions(evaluation, system)
        C_K = np.concatenate([derivatives["A_K"][held], contact_by_v_K])
        Y, _ = system.solve(np.zeros((n, k)), C_K)
        return cls(
            held,
            N,
            marionette.interpreted("mass_matrix", x).M,
            N.T @ r_q @ N,
            N.T @ r_v @ N,
            (-N.T @ (r_q @ Y + r_qK), -N.T @ (r_v @ Y + r_vK), -N.T @ derivatives["M_DK"]),
        )


def held_rows(marionette: CompiledPuppet, tension: Array) -> Indices:
    """Indices of the held rows: wires, and strings and limits under tension."""
    pulls = tension > MIN_TENSION * marionette.weight
    return np.flatnonzero(marionette.two_sided | pulls)


def free_directions(evaluation: Evaluation, system: ModeSystem) -> Array:
    """Directions N (n_vD, m) with C N = 0 and N^T M N = 1."""
    u, size, _ = np.linalg.svd(system.held, full_matrices=True)
    rank = int(np.sum(size > DEPENDENT_ROWS * np.max(size, initial=0.0)))
    return evaluation.solve_factor(u[:, rank:].T).T
