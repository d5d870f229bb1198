"""Equilibria by descent of V with its curvature.

Dynamic relaxation (:mod:`.relaxation`) takes steps that suit a puppet's stiffest spring over the
time of its slowest sway or creep. Here each step solves, in coordinates y in which M_DD is the
identity,

    min  -w0 . y + 1/2 y . (|H| + mu) y    subject to  h + W^T y <= 0

with H the Hessian of V and |H| the same with the absolute values of its eigenvalues, so that a step
descends at a saddle as well; mu grows where V did not fall and shrinks where it did.

V is the potential energy and -w0 its gradient in y, without strings; h are the gaps of rows
(strings and limits), and W^T their derivatives. q_D are the dynamic coordinates. In names, K stands
for driven coordinates: ends and lengths of strings, driven joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, StateError, tangent
from fantoccini.dynamics.compiled import ROW_TOLERANCES, CompiledPuppet, Evaluation, retract
from fantoccini.dynamics.equilibrium.newton import (
    Equilibrium,
    curvature,
    derivatives,
    instability,
    newton,
    pushed,
)
from fantoccini.dynamics.equilibrium.projection import moved_onto_rows, onto_rows
from fantoccini.dynamics.equilibrium.relaxation import poles, with_motors_in_step
from fantoccini.motion import State


@dataclass(frozen=True)
class Descent:
    """Bounds of the descent. Moves are in rad or m."""

    max_rounds: int = 3000
    first_mu: float = 1e2  # Initial mu [1/s^2]
    min_mu: float = 1e-3  # mu below which it becomes 0, and from which it grows [1/s^2]
    max_mu: float = 1e14  # mu at which the search has stalled [1/s^2]
    mu_growth: float = 3.0  # Factor of mu after a step on which V did not fall
    mu_shrinkage: float = 0.2  # Factor of mu after a step on which V fell
    min_curvature: float = 1e-3
    """Minimum curvature used by steps [1/s^2]: gravity alone may have none."""
    max_move: float = 0.1  # Longest move of one round
    pole_share: float = 0.25
    """Longest move of a stepper motor in one round, relative to the distance of its poles."""
    near_gap: float = 0.05  # Relative -h of rows that a step may reach
    min_move: float = 1e-12  # Move below which a puppet rests
    max_distance: float = 100.0  # Move from which the puppet has no equilibrium
    max_flat_fall: float = 1e-15  # Fall of V on flat ground, divided by the puppet's weight [m]
    rounding: float = 1e-14  # Rounding error of V, a sum over all links and springs, relative to V
    max_stalls: int = 3  # Maximum number of moves with flat V and no smaller forces
    min_growth_rate: float = 1e-9
    """Squared growth rate of an instability, relative to that of the fastest oscillation."""
    difference: float = 1e-6  # Step of the finite differences that give the Hessian
    max_force: float = 1e-6  # Largest unbalanced force at rest, relative to the weight
    max_newton_move: float = 1e-3
    """Largest move of Newton's method that still refines the same equilibrium."""


DESCENT = Descent()


def descended(marionette: CompiledPuppet, x: State) -> Equilibrium:
    """A local minimum of V subject to the rows, from a state that satisfies them.

    Raises:
        StateError: V keeps falling, or the search stalled with unbalanced forces.
    """
    solution = _minimum(marionette, x)
    in_step_state = with_motors_in_step(marionette, solution.x)
    if in_step_state is not solution.x:
        solution = _minimum(marionette, moved_onto_rows(marionette, in_step_state)[0])
    refined = newton(marionette, solution.x)
    if refined is None or np.max(np.abs(refined.x.q_D - solution.x.q_D)) > DESCENT.max_newton_move:
        return solution
    return refined


def _minimum(marionette: CompiledPuppet, x: State) -> Equilibrium:
    wires, scale = marionette.two_sided, marionette.row_scales(x.q_D, x.q_K)
    force_scale = marionette.weight / np.sqrt(marionette.mass)
    mu, V, start = DESCENT.first_mu, marionette.energies(x)[1], x.q_D
    max_moves = np.full(len(x.v_D), DESCENT.max_move)
    for row, pole in poles(marionette):
        max_moves[row.v] = np.minimum(max_moves[row.v], DESCENT.pole_share * pole)
    rows: Indices = np.zeros(0, dtype=np.intp)
    tension, unbalanced, stalls = np.zeros(0), np.inf, 0
    for _ in range(DESCENT.max_rounds):
        evaluation = Evaluation.at_state(marionette, x)
        near = np.flatnonzero((evaluation.h > -DESCENT.near_gap * scale) | wires)
        force_by_move = _force_derivative(marionette, Equilibrium(x, rows, tension))
        curvature_modes = values, modes = curvature(evaluation, force_by_move)
        while True:
            damped = np.maximum(np.abs(values) + mu, DESCENT.min_curvature)
            softened = modes / np.sqrt(damped)
            W = softened.T @ evaluation.W[:, near]
            force = softened.T @ evaluation.w0
            solution = marionette.library.complementarity(
                W, evaluation.h[near] + W.T @ force, wires[near]
            )
            move = evaluation.solve_factor(softened @ (force - W @ solution.x))
            size = float(np.max(np.abs(move), initial=0.0))
            move = move / max(1.0, float(np.max(np.abs(move) / max_moves, initial=0.0)))
            next_state, violation = onto_rows(
                marionette, x.replace(q_D=retract(marionette, x.q_D, move))
            )
            next_V = marionette.energies(next_state)[1]
            fall = V - next_V + _motors_work(marionette, x, next_state)
            is_flat = abs(
                fall
            ) <= DESCENT.max_flat_fall * marionette.weight + DESCENT.rounding * abs(V)
            is_accepted = violation <= ROW_TOLERANCES.start_gap and (fall > 0.0 or is_flat)
            if is_accepted or mu > DESCENT.max_mu:
                break
            mu = max(DESCENT.mu_growth * mu, DESCENT.min_mu)
        is_pulling = solution.x != 0.0
        rows, tension = near[is_pulling], solution.x[is_pulling]
        previous_unbalanced = unbalanced
        unbalanced = float(np.linalg.norm(evaluation.w0 - evaluation.W[:, rows] @ tension))
        # Where V is flat to rounding, forces still measure the distance. A single move along a
        # valley may leave the forces across it unchanged.
        stalls = stalls + 1 if is_flat and unbalanced > 0.5 * previous_unbalanced else 0
        if size < DESCENT.min_move or stalls > DESCENT.max_stalls or mu > DESCENT.max_mu:
            push = instability(evaluation, rows, curvature_modes, DESCENT.min_growth_rate)
            lower_state = None if push is None else pushed(marionette, x, push)
            if lower_state is None and unbalanced > DESCENT.max_force * force_scale:
                raise StateError(
                    "the descent of the potential energy stalled with forces of "
                    f"{unbalanced / force_scale:.2g} of the puppet's weight unbalanced; begin "
                    "nearer to where the puppet hangs, or simulate with damping until it rests"
                )
            if lower_state is None:
                return Equilibrium(next_state if size < DESCENT.min_move else x, rows, tension)
            next_state = lower_state
            next_V = marionette.energies(next_state)[1]
        if np.max(np.abs(next_state.q_D - start), initial=0.0) > DESCENT.max_distance:
            break
        smaller_mu = mu * DESCENT.mu_shrinkage if mu > DESCENT.min_mu and not is_flat else 0.0
        x, V, mu = next_state, next_V, smaller_mu
    raise StateError(
        "the descent of the potential energy does not end. Is every free body held by a string, a "
        "limit or a joint to the world?"
    )


def _motors_work(marionette: CompiledPuppet, x: State, other: State) -> float:
    """Work of the drives' motors between two states [J], by Simpson's rule: V excludes it."""
    commanded = [(row, row.command[1]) for row in marionette.tree.drives if row.command is not None]
    if not commanded:
        return 0.0
    table, n = marionette.coordinates, len(x.v_D)
    index_pairs = table.scalars_D, table.quaternions_D
    move = tangent.between(*index_pairs, x.q_D, other.q_D, n)
    q_D = tangent.moved(*index_pairs, x.q_D, np.array([[0.0], [0.5], [1.0]]) * move)
    k, strings = len(x.v_K), len(marionette.tree.strings)
    zeros = np.zeros((3, n)), np.tile(x.q_K, (3, 1)), np.zeros((3, k))
    force = marionette.effort(q_D, *zeros, zeros[0], zeros[2], np.zeros((3, strings)))
    mean = (force[0] + 4.0 * force[1] + force[2]) / 6.0
    work = 0.0
    for row, command_start in commanded:
        joint_move = move[row.v]
        work += float(mean[command_start:][: len(joint_move)] @ joint_move)
    return work


def _force_derivative(marionette: CompiledPuppet, solution: Equilibrium) -> Array:
    """Derivative (n_vD, n_vD) of w0 - W tau by a small move."""
    if len(solution.rows):
        return derivatives(marionette, solution)[0]
    x, n = solution.x, len(solution.x.v_D)
    moves = np.concatenate([np.eye(n), -np.eye(n)]) * DESCENT.difference
    moved_q_D = retract(marionette, x.q_D, moves)
    arguments = marionette.at(x) | {
        "q_D": moved_q_D,
        "acc_K": np.zeros_like(x.v_K),
        "u_D": np.zeros(n),
    }
    w0 = marionette.library.evaluate("dynamics", **arguments).w0
    return (w0[:n] - w0[n:]).T / (2 * DESCENT.difference)
