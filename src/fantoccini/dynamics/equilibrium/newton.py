"""Equilibria of puppets that hang, by Newton's method, and whether they are stable.

Forces balance over the pulling rows, whose gaps are zero. Rows that push are released, and violated
rows are held. Relaxation (:mod:`.relaxation`) and descent (:mod:`.descent`) give the start.

A row is a string or a joint limit with its gap h <= 0; it pulls if its tension tau is above 0. -w0
is the gradient of the potential energy V by a move, and W tau the pull of the rows. In names, D
stands for dynamic coordinates, which move by the equations of motion, and K for driven ones: ends
and lengths of strings, driven joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, tangent
from fantoccini.dynamics.compiled import ROW_TOLERANCES, CompiledPuppet, Evaluation, retract
from fantoccini.dynamics.equilibrium.projection import difference_quotient, onto_rows
from fantoccini.motion import State


@dataclass(frozen=True)
class Newton:
    """Bounds of Newton's method, and of pushes off its equilibria. Moves are in rad or m."""

    max_rounds: int = 30
    difference: float = 1e-6
    """Step of the finite differences for Newton's matrix; it only affects the convergence."""
    max_start_force: float = 0.01
    """Unbalanced force, relative to the weight, below which Newton's method begins; with
    larger ones it may converge to another equilibrium than the one the puppet falls into."""
    max_move: float = 0.3  # Longest move of one round of Newton's method
    near_gap: float = 1e-3  # Relative -h below which a row may pull at the equilibrium
    tension_rounding: float = 1e-9  # Tension that counts as rounding, relative to the weight
    force_rounding: float = 1e-13  # Unbalanced force of rounding, relative to the weight
    max_last_force: float = 1e-11  # Unbalanced force accepted after the last round
    gap_rounding: float = 1e-14  # Relative |h| that counts as rounding
    move_rounding: float = 1e-15  # Move of Newton's method that counts as rounding
    pushes: tuple[float, ...] = (0.05, 0.01, 0.002)
    """Sizes of the pushes off an unstable equilibrium, as their largest parts."""
    potential_fall: float = 1e-12  # Fall of V above rounding, divided by the puppet's weight [m]
    max_turn_rounds: int = 12  # Rounds of :func:`nearest_to_requested`
    turn_rounding: float = 1e-13  # Turn that counts as rounding
    max_neutral_stiffness: float = 1e-6
    """Largest stiffness of a neutral move, relative to the stiffest: the precision of finite
    differences. Newton's method and the energy then decide whether it is neutral."""
    move_weight: float = 1e-6  # Weight of translations [m], relative to rotations [rad]


NEWTON = Newton()


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """An equilibrium: forces w0 - W tau = 0 over the pulling rows, in the metric of M_DD.

    Attributes:
        x: the state.
        rows: the pulling rows.
        tension: (len(rows),) tensions of the pulling rows.
    """

    x: State
    rows: Indices
    tension: Array


def newton(marionette: CompiledPuppet, x: State) -> Equilibrium | None:
    """The equilibrium near a configuration; None if Newton's method does not converge."""
    scale = marionette.row_scales(x.q_D, x.q_K)
    mass, weight = sizes(marionette)
    force_scale = weight / np.sqrt(mass)
    evaluation = Evaluation.at_state(marionette, x)
    near_rows = np.flatnonzero((evaluation.h > -NEWTON.near_gap * scale) | marionette.two_sided)
    hddot = evaluation.gamma[near_rows] + evaluation.W[:, near_rows].T @ evaluation.w0
    cap = np.full(len(scale), marionette.tension_cap)
    tension = evaluation.complementarity(near_rows, hddot, marionette.two_sided, cap).x
    if (
        np.linalg.norm(evaluation.w0 - evaluation.W[:, near_rows] @ tension)
        > NEWTON.max_start_force * force_scale
    ):
        return None
    rows: Indices = near_rows[
        (tension > NEWTON.tension_rounding * weight) | marionette.two_sided[near_rows]
    ]
    for _ in range(NEWTON.max_rounds):
        evaluation = Evaluation.at_state(marionette, x)
        W = evaluation.W[:, rows]
        tension = np.zeros(0)
        if len(rows):
            tension = np.asarray(np.linalg.lstsq(W, evaluation.w0, rcond=1e-10)[0], dtype=float)
        force = evaluation.w0 - W @ tension
        gap = np.max(np.abs(evaluation.h[rows]) / scale[rows], initial=0.0)
        if (
            np.linalg.norm(force) < NEWTON.force_rounding * force_scale
            and gap < NEWTON.gap_rounding
        ):
            changed_rows = _changed_rows(marionette, evaluation, rows, tension, scale)
            if changed_rows is None:
                return Equilibrium(x, rows, tension)
            rows = changed_rows
            continue
        K, A = derivatives(marionette, Equilibrium(x, rows, tension))
        system = np.block([[K, -W], [A, np.zeros((len(rows), len(rows)))]])
        step = np.linalg.lstsq(system, -np.concatenate([force, evaluation.h[rows]]), rcond=1e-9)[0]
        move = step[: len(K)]
        largest = np.max(np.abs(move), initial=0.0)
        if not np.isfinite(largest):
            return None
        move = move * min(1.0, NEWTON.max_move / (largest or 1.0))
        x = x.replace(q_D=retract(marionette, x.q_D, move))
        converged = largest < NEWTON.move_rounding
        if converged and _changed_rows(marionette, evaluation, rows, tension, scale) is None:
            return Equilibrium(x, rows, tension)
    evaluation = Evaluation.at_state(marionette, x)
    force = evaluation.w0 - evaluation.W[:, rows] @ tension
    balanced = np.linalg.norm(force) < NEWTON.max_last_force * force_scale
    if balanced and _changed_rows(marionette, evaluation, rows, tension, scale) is None:
        return Equilibrium(x, rows, tension)
    return None


def _changed_rows(
    marionette: CompiledPuppet, evaluation: Evaluation, rows: Indices, tension: Array, scale: Array
) -> Indices | None:
    """The rows without those that push and with those that are violated; None if unchanged."""
    is_pushing = (
        tension < -NEWTON.tension_rounding * sizes(marionette)[1]
    ) & ~marionette.two_sided[rows]
    is_violated = (evaluation.h > ROW_TOLERANCES.start_gap * scale) & ~marionette.two_sided
    if not np.any(is_pushing) and not np.any(is_violated):
        return None
    return np.union1d(rows[~is_pushing], np.flatnonzero(is_violated))


def derivatives(marionette: CompiledPuppet, equilibrium: Equilibrium) -> tuple[Array, Array]:
    """Derivatives of w0 - W tau (n_vD, n_vD) and of h (len(rows), n_vD) by a small move."""

    def residual(q_D: Array) -> Array:
        evaluation = Evaluation.at_state(marionette, equilibrium.x.replace(q_D=q_D))
        return np.append(
            evaluation.w0 - evaluation.W[:, equilibrium.rows] @ equilibrium.tension,
            evaluation.h[equilibrium.rows],
        )

    derivative = difference_quotient(marionette, equilibrium.x.q_D, residual, NEWTON.difference)
    return derivative[: len(equilibrium.x.v_D)], derivative[len(equilibrium.x.v_D) :]


def curvature(evaluation: Evaluation, by_move: Array) -> tuple[Array, Array]:
    """Eigenvalues [1/s^2] and modes of V's Hessian, in coordinates with M_DD the identity.

    Args:
        evaluation: the model at the state.
        by_move: (n_vD, n_vD) derivative of w0 - W tau by a small move.
    """
    H = -by_move @ evaluation.solve_factor(np.eye(len(by_move))).T
    return np.linalg.eigh(0.5 * (H + H.T))


def instability(
    evaluation: Evaluation, rows: Indices, curvature: tuple[Array, Array], threshold: float
) -> Array | None:
    """A push (n_vD,) along which V falls while the rows hold; None at a minimum.

    Args:
        evaluation: the model at the state.
        rows: the pulling rows.
        curvature: curvature of V + tau . h; see :func:`curvature`.
        threshold: squared growth rate of an instability, relative to the fastest oscillation.
    """
    (values, modes), W = curvature, evaluation.W[:, rows]
    projector = np.eye(len(modes)) - W @ np.linalg.pinv(W) if len(rows) else np.eye(len(modes))
    values, vectors = np.linalg.eigh(projector @ (modes * values) @ modes.T @ projector)
    if values[0] > -threshold * max(1.0, float(np.max(np.abs(values)))):
        return None
    push = evaluation.solve_factor(projector @ vectors[:, 0])
    return push / np.max(np.abs(push))


def pushed(marionette: CompiledPuppet, x: State, push: Array) -> State | None:
    """A state with lower V than an equilibrium, to either side along a push; None without one.

    Rows that are closed and do not pull are not in the equations of an equilibrium: they may
    stabilise a saddle.
    """
    V, threshold = marionette.energies(x)[1], NEWTON.potential_fall * sizes(marionette)[1]
    for size in NEWTON.pushes:
        for sign in (1.0, -1.0):
            pushed_state = x.replace(q_D=retract(marionette, x.q_D, sign * size * push))
            onto_rows_state, violation = onto_rows(marionette, pushed_state)
            # V does not include motors' work: the result of the push is judged later.
            is_lower = (
                marionette.tree.drives or marionette.energies(onto_rows_state)[1] < V - threshold
            )
            if violation <= ROW_TOLERANCES.start_gap and is_lower:
                return onto_rows_state
    return None


def nearest_to_requested(
    marionette: CompiledPuppet, requested: State, equilibrium: Equilibrium
) -> Equilibrium:
    """The equilibrium of equal energy that is rotated least from the requested state.

    A load's angle about its only string is neutral. Without this choice it would depend on how the
    puppet swung to rest, and no input could undo it. In neutral directions without rotation, the
    translation is the smallest.
    """
    table, n = marionette.coordinates, len(equilibrium.x.v_D)
    index_pairs = table.scalars_D, table.quaternions_D
    weight = _rotation_weights(marionette)
    for _ in range(NEWTON.max_turn_rounds):
        moves = _neutral_moves(marionette, equilibrium)
        to_requested = tangent.between(
            *index_pairs, equilibrium.x.q_D[None], requested.q_D[None], n
        )[0]
        coefficients = np.linalg.lstsq(weight[:, None] * moves, weight * to_requested)[0]
        move = moves @ coefficients
        largest = float(np.max(np.abs(move), initial=0.0))
        if largest < NEWTON.turn_rounding:
            break
        move *= min(1.0, NEWTON.max_move / largest)
        candidate = newton(
            marionette, equilibrium.x.replace(q_D=retract(marionette, equilibrium.x.q_D, move))
        )
        if candidate is None or not np.array_equal(candidate.rows, equilibrium.rows):
            break
        rise = marionette.energies(candidate.x)[1] - marionette.energies(equilibrium.x)[1]
        if abs(rise) > NEWTON.potential_fall * sizes(marionette)[1]:
            break
        equilibrium = candidate
    return equilibrium


def _rotation_weights(marionette: CompiledPuppet) -> Array:
    """Weights (n_vD,): 1 for rotations, small ones for translations."""
    table = marionette.coordinates
    weight = np.ones(table.n_vD)
    units = {row.name: row.unit for row in table.rows}
    for q, v in table.scalars_D:
        if units[table.q_D[q]] != "rad":
            weight[v] = NEWTON.move_weight
    return weight


def _neutral_moves(marionette: CompiledPuppet, equilibrium: Equilibrium) -> Array:
    """Orthonormal basis (n_vD, r) of the moves that change neither forces nor gaps."""
    W = Evaluation.at_state(marionette, equilibrium.x).W[:, equilibrium.rows]
    K, A = derivatives(marionette, equilibrium)
    K = K - W @ (np.linalg.pinv(W) @ K) if len(equilibrium.rows) else K
    scaled = [part / max(float(np.max(np.abs(part), initial=0.0)), 1e-300) for part in (K, A)]
    _, size, modes = np.linalg.svd(np.concatenate(scaled))
    return np.asarray(modes[size < NEWTON.max_neutral_stiffness * size[0]].T)


def sizes(marionette: CompiledPuppet) -> tuple[float, float]:
    """Mass [kg] and weight [N] as scales, always positive.

    If only rotors move, they are the rotors' inertia, and 1 N or N m.
    """
    rotor_inertia = sum(row.inertia(marionette.number) for row in marionette.tree.drives)
    return marionette.mass or rotor_inertia or 1.0, marionette.weight or 1.0
