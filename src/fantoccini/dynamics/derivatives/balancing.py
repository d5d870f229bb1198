"""Equilibrium near a given state, on floor and props, by Newton's method on the accelerations.

    K eta = U^T F acc_D,   K = -U^T F (d acc_D/dq_D) N,   q_D <- q_D + N eta
    C N = 0,   N = F^-1 U,   U^T U = 1,   M = F^T F

C has the rows of held strings and limits and of touching points, as in :mod:`.small_motions`.
Derivatives are central differences, since the library of exact ones takes as long to compile as the
model.

q_D are the dynamic coordinates and acc_D their accelerations; eta are coordinates of the motions
that held strings and contacts leave free. In names, K stands for driven coordinates: ends and
lengths of strings, driven joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, StateError
from fantoccini.dynamics.compiled import CompiledPuppet, Evaluation, Screws, retract
from fantoccini.dynamics.derivatives.contact_rows import ContactRows
from fantoccini.dynamics.derivatives.contact_state import FrozenModes, RestMotion, motion_at
from fantoccini.dynamics.derivatives.mode_system import ModeSystem
from fantoccini.dynamics.derivatives.small_motions import free_directions, held_rows
from fantoccini.motion import State


@dataclass(frozen=True)
class BalanceSettings:
    """Bounds of the search for balance."""

    max_rounds: int = 12
    max_rest_acceleration: float = 1e-7
    """Acceleration of a state at rest [rad/s^2 or m/s^2]: a tenth of the bound for modes."""
    max_move: float = 1e-3
    """Bound of a Newton step [rad or m]; a longer one ends the search: other rows may pull then."""
    difference_step: float = 1e-6
    """Largest component of the displacements in the central differences [rad or m]."""
    zero_stiffness: float = 1e-3  # Singular value of K that counts as 0 [rad^2/s^2]


BALANCE = BalanceSettings()


def balanced_state(marionette: CompiledPuppet, x: State) -> State:
    """A state near rest, moved until its forces balance.

    The active strings, limits and contacts stay the same. Without convergence the result is the
    state of the smallest acceleration on the way.
    """
    best_state, least_acceleration = x, np.inf
    for _ in range(BALANCE.max_rounds):
        try:
            motion = motion_at(marionette, x)
            acceleration = float(np.max(np.abs(motion.acc_D), initial=0.0))
            if not acceleration < least_acceleration:
                break
            best_state, least_acceleration = x, acceleration
            if acceleration <= BALANCE.max_rest_acceleration:
                break
            move = _newton_move(marionette, x, motion)
        except StateError:
            break
        if not 0.0 < np.max(np.abs(move), initial=0.0) < BALANCE.max_move:
            break
        x = x.replace(q_D=retract(marionette, x.q_D, move))
    return best_state


def _newton_move(marionette: CompiledPuppet, x: State, motion: RestMotion) -> Array:
    """Move (n_vD,) after which the accelerations are 0 to first order."""
    held, points = held_rows(marionette, motion.tension), motion.contacts.points
    still_D, still_K = np.zeros_like(x.v_D), np.zeros_like(x.v_K)
    evaluation, frozen = Evaluation.at_state(marionette, x), FrozenModes(marionette, points)
    rows = ContactRows(Screws(marionette, x, still_D, still_K), points, 0.0)
    N = free_directions(evaluation, ModeSystem(evaluation, held, rows))

    def accelerations(move: Array) -> Array:
        nearby = x.replace(q_D=retract(marionette, x.q_D, move))
        return frozen.accelerations_and_forces(
            Evaluation.at_state(marionette, nearby), nearby, still_K, held
        )[0]

    columns = []
    for direction in N.T:
        step = BALANCE.difference_step / np.max(np.abs(direction))
        difference = accelerations(step * direction) - accelerations(-step * direction)
        columns.append(difference / (2.0 * step))
    if not columns:
        return still_D
    inverse_F = evaluation.solve_factor(np.eye(len(still_D))).T
    U = np.linalg.solve(inverse_F, N)
    K = -U.T @ np.linalg.solve(inverse_F, np.stack(columns, axis=1))
    cutoff = BALANCE.zero_stiffness / max(float(np.linalg.norm(K, 2)), BALANCE.zero_stiffness)
    eta = np.linalg.lstsq(K, U.T @ np.linalg.solve(inverse_F, motion.acc_D), cutoff)[0]
    return np.asarray(N @ eta)
