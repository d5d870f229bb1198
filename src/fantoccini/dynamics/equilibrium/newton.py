"""Equilibria of puppets that hang, by Newton's method, and whether they are stable.

Forces balance over the pulling rows, whose gaps are zero. Rows that push are released, and violated
rows are held. Relaxation (:mod:`.relaxation`) and descent (:mod:`.descent`) give the start.
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
    potential_fall: float = 1e-12  # Fall of V above rounding, over the puppet's weight [m]
    max_turn_rounds: int = 12  # Rounds of :func:`as_asked`
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
    size = weight / np.sqrt(mass)
    at = Evaluation.of(marionette, x)
    near = np.flatnonzero((at.h > -NEWTON.near_gap * scale) | marionette.two_sided)
    hddot = at.gamma[near] + at.W[:, near].T @ at.w0
    cap = np.full(len(scale), marionette.tension_cap)
    tension = at.complementarity(near, hddot, marionette.two_sided, cap).x
    if np.linalg.norm(at.w0 - at.W[:, near] @ tension) > NEWTON.max_start_force * size:
        return None
    rows: Indices = near[(tension > NEWTON.tension_rounding * weight) | marionette.two_sided[near]]
    for _ in range(NEWTON.max_rounds):
        at = Evaluation.of(marionette, x)
        W = at.W[:, rows]
        tension = np.zeros(0)
        if len(rows):
            tension = np.asarray(np.linalg.lstsq(W, at.w0, rcond=1e-10)[0], dtype=float)
        force = at.w0 - W @ tension
        gap = np.max(np.abs(at.h[rows]) / scale[rows], initial=0.0)
        if np.linalg.norm(force) < NEWTON.force_rounding * size and gap < NEWTON.gap_rounding:
            changed = _changed(marionette, at, rows, tension, scale)
            if changed is None:
                return Equilibrium(x, rows, tension)
            rows = changed
            continue
        K, A = derivatives(marionette, Equilibrium(x, rows, tension))
        system = np.block([[K, -W], [A, np.zeros((len(rows), len(rows)))]])
        step = np.linalg.lstsq(system, -np.concatenate([force, at.h[rows]]), rcond=1e-9)[0]
        move = step[: len(K)]
        largest = np.max(np.abs(move), initial=0.0)
        if not np.isfinite(largest):
            return None
        move = move * min(1.0, NEWTON.max_move / (largest or 1.0))
        x = x.replace(q_D=retract(marionette, x.q_D, move))
        converged = largest < NEWTON.move_rounding
        if converged and _changed(marionette, at, rows, tension, scale) is None:
            return Equilibrium(x, rows, tension)
    at = Evaluation.of(marionette, x)
    force = at.w0 - at.W[:, rows] @ tension
    balanced = np.linalg.norm(force) < NEWTON.max_last_force * size
    if balanced and _changed(marionette, at, rows, tension, scale) is None:
        return Equilibrium(x, rows, tension)
    return None


def _changed(
    marionette: CompiledPuppet, at: Evaluation, rows: Indices, tension: Array, scale: Array
) -> Indices | None:
    """The rows without those that push and with those that are violated; None if unchanged."""
    pushing = (tension < -NEWTON.tension_rounding * sizes(marionette)[1]) & ~marionette.two_sided[
        rows
    ]
    violated = (at.h > ROW_TOLERANCES.start_gap * scale) & ~marionette.two_sided
    if not np.any(pushing) and not np.any(violated):
        return None
    return np.union1d(rows[~pushing], np.flatnonzero(violated))


def derivatives(marionette: CompiledPuppet, equilibrium: Equilibrium) -> tuple[Array, Array]:
    """Derivatives of w0 - W tau (n_vD, n_vD) and of h (len(rows), n_vD) by a small move."""

    def residual(q_D: Array) -> Array:
        at = Evaluation.of(marionette, equilibrium.x.replace(q_D=q_D))
        return np.append(
            at.w0 - at.W[:, equilibrium.rows] @ equilibrium.tension, at.h[equilibrium.rows]
        )

    by_move = difference_quotient(marionette, equilibrium.x.q_D, residual, NEWTON.difference)
    return by_move[: len(equilibrium.x.v_D)], by_move[len(equilibrium.x.v_D) :]


def curvature(at: Evaluation, by_move: Array) -> tuple[Array, Array]:
    """Eigenvalues [1/s^2] and modes of V's Hessian, in coordinates with M_DD the identity.

    Args:
        at: the model at the state.
        by_move: (n_vD, n_vD) derivative of w0 - W tau by a small move.
    """
    H = -by_move @ at.solve_factor(np.eye(len(by_move))).T
    return np.linalg.eigh(0.5 * (H + H.T))


def instability(
    at: Evaluation, rows: Indices, curvature: tuple[Array, Array], threshold: float
) -> Array | None:
    """A push (n_vD,) along which V falls while the rows hold; None at a minimum.

    Args:
        at: the model at the state.
        rows: the pulling rows.
        curvature: curvature of V + tau . h; see :func:`curvature`.
        threshold: squared growth rate of an instability, relative to the fastest oscillation.
    """
    (values, modes), W = curvature, at.W[:, rows]
    free = np.eye(len(modes)) - W @ np.linalg.pinv(W) if len(rows) else np.eye(len(modes))
    values, vectors = np.linalg.eigh(free @ (modes * values) @ modes.T @ free)
    if values[0] > -threshold * max(1.0, float(np.max(np.abs(values)))):
        return None
    push = at.solve_factor(free @ vectors[:, 0])
    return push / np.max(np.abs(push))


def pushed(marionette: CompiledPuppet, x: State, push: Array) -> State | None:
    """A state with lower V than an equilibrium, to either side along a push; None without one.

    Rows that are closed and do not pull are not in the equations of an equilibrium: they may
    stabilise a saddle.
    """
    V, threshold = marionette.energies(x)[1], NEWTON.potential_fall * sizes(marionette)[1]
    for size in NEWTON.pushes:
        for sign in (1.0, -1.0):
            moved = x.replace(q_D=retract(marionette, x.q_D, sign * size * push))
            other, worst = onto_rows(marionette, moved)
            # V does not include motors' work: the result of the push is judged later.
            lower = marionette.tree.drives or marionette.energies(other)[1] < V - threshold
            if worst <= ROW_TOLERANCES.start_gap and lower:
                return other
    return None


def as_asked(marionette: CompiledPuppet, asked: State, equilibrium: Equilibrium) -> Equilibrium:
    """The equilibrium of equal energy that is rotated least from the requested state.

    A load's angle about its only string is neutral. Without this choice it would depend on how the
    puppet swung to rest, and no input could undo it. In neutral directions without rotation, the
    translation is the smallest.
    """
    table, n = marionette.coordinates, len(equilibrium.x.v_D)
    places = table.scalars_D, table.quaternions_D
    weight = _turn_weights(marionette)
    for _ in range(NEWTON.max_turn_rounds):
        neutral = _neutral(marionette, equilibrium)
        to_asked = tangent.between(*places, equilibrium.x.q_D[None], asked.q_D[None], n)[0]
        shares = np.linalg.lstsq(weight[:, None] * neutral, weight * to_asked)[0]
        move = neutral @ shares
        largest = float(np.max(np.abs(move), initial=0.0))
        if largest < NEWTON.turn_rounding:
            break
        move *= min(1.0, NEWTON.max_move / largest)
        other = newton(
            marionette, equilibrium.x.replace(q_D=retract(marionette, equilibrium.x.q_D, move))
        )
        if other is None or not np.array_equal(other.rows, equilibrium.rows):
            break
        risen = marionette.energies(other.x)[1] - marionette.energies(equilibrium.x)[1]
        if abs(risen) > NEWTON.potential_fall * sizes(marionette)[1]:
            break
        equilibrium = other
    return equilibrium


def _turn_weights(marionette: CompiledPuppet) -> Array:
    """Weights (n_vD,): 1 for rotations, small ones for translations."""
    table = marionette.coordinates
    weight = np.ones(table.n_vD)
    units = {row.name: row.unit for row in table.rows}
    for q, v in table.scalars_D:
        if units[table.q_D[q]] != "rad":
            weight[v] = NEWTON.move_weight
    return weight


def _neutral(marionette: CompiledPuppet, equilibrium: Equilibrium) -> Array:
    """Orthonormal basis (n_vD, r) of the moves that change neither forces nor gaps."""
    W = Evaluation.of(marionette, equilibrium.x).W[:, equilibrium.rows]
    K, A = derivatives(marionette, equilibrium)
    K = K - W @ (np.linalg.pinv(W) @ K) if len(equilibrium.rows) else K
    parts = [part / max(float(np.max(np.abs(part), initial=0.0)), 1e-300) for part in (K, A)]
    _, size, modes = np.linalg.svd(np.concatenate(parts))
    return np.asarray(modes[size < NEWTON.max_neutral_stiffness * size[0]].T)


def sizes(marionette: CompiledPuppet) -> tuple[float, float]:
    """Mass [kg] and weight [N] as scales, always positive.

    If only rotors move, they are the rotors' inertia, and 1 N or N m.
    """
    rotors = sum(row.inertia(marionette.number) for row in marionette.tree.drives)
    return marionette.mass or rotors or 1.0, marionette.weight or 1.0
