"""Accelerations and tensions of a state: Eqs. 10 and 11 with the rules of Sec. IV.

acc_D and acc_K are the accelerations of the dynamic and the driven coordinates. A row is a string
or a joint limit. h is the gap of a string, path length minus string length; hdot and hddot are its
rates. With the inertia matrix M_DD = F^T F, w0 = F^-T f are the scaled forces f without strings,
and W = F^-T A_D^T those of unit tensions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, StateError
from fantoccini.dynamics.compiled.active_set import ActiveSet, check_active_set
from fantoccini.dynamics.compiled.compiled_puppet import CompiledPuppet
from fantoccini.dynamics.compiled.evaluation import Evaluation
from fantoccini.motion import State

ROUNDING = 1e-14
"""Rounding error of hddot, relative to its largest term or gravity."""


class ForwardDynamics(NamedTuple):
    """Accelerations and tensions at one state.

    Attributes:
        acc_D: (n_vD,) dynamic accelerations [rad/s^2 or m/s^2].
        tension: (n_rows,) forces of strings, then of limits, >= 0 [N or N m]; of least norm
            where several give the same motion.
    """

    acc_D: Array
    tension: Array


def forward_dynamics(
    marionette: CompiledPuppet, x: State, acc_K: Array | None = None, u_D: Array | None = None
) -> ForwardDynamics:
    """Accelerations and tensions of Eqs. 10 and 11; see :meth:`Marionette.forward_dynamics`."""
    evaluation = Evaluation.at_state(marionette, x, acc_K, u_D)
    check_active_set(marionette, x, evaluation)
    active_set = ActiveSet.at_state(marionette, x, evaluation)
    tension = np.where(active_set.slipping, marionette.max_forces, 0.0)
    w0 = evaluation.w0 - evaluation.W[:, active_set.slipping] @ tension[active_set.slipping]
    rows = np.flatnonzero(active_set.held)
    hddot = evaluation.gamma[rows] + evaluation.W[:, rows].T @ w0
    # Rounding alone must not make opposing rows contradict each other.
    terms = np.abs(evaluation.gamma[rows]) + np.abs(evaluation.W[:, rows]).T @ np.abs(w0)
    scale = max(float(np.max(terms, initial=0.0)), marionette.weight / (marionette.mass or 1.0))
    hddot[np.abs(hddot) <= ROUNDING * scale] = 0.0
    solution = evaluation.complementarity(rows, hddot, marionette.two_sided, marionette.max_forces)
    if not solution.solved:
        raise StateError(
            "no acceleration satisfies these strings and limits: "
            + ", ".join(marionette.names_of(rows, solution.ray))
        )
    tension[rows] = solution.x
    return ForwardDynamics(
        evaluation.solve_factor(w0 - evaluation.W[:, rows] @ solution.x), tension
    )
