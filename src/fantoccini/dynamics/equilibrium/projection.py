"""States moved to satisfy strings and limits, by the smallest move.

Each search uses the rows' linearisation h + A dq at the present configuration. Every row is
one-sided in every round: corrected rows can open later.

1. Onto the rows: min |dq|_M with h + A dq <= 0. Where no dq satisfies the rows together, the sum of
   squares of their violations is minimised.
2. If that stalls: restarts after seeded pushes of growing size off the given configuration. A
   straight limb that is pulled along itself has zero slope and cannot move otherwise.
3. Along the rows towards the given configuration q_0: min |q + dq - q_0|_M with h + A dq <= 0,
   completed by Newton's method on M (q - q_0) + A^T y = 0 and h = 0 of the rows with y > 0.

q and dq are the dynamic coordinates q_D and their changes. A row is a string or a joint limit with
its gap h <= 0, A are the derivatives of h, and |dq|_M^2 = dq^T M dq with the inertia matrix M. In
names, K stands for driven coordinates: ends and lengths of strings, driven joints. A taut string
pulls, a slack one does not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, MaskRows, StateError, tangent
from fantoccini.dynamics.compiled import (
    ROW_TOLERANCES,
    ActiveSet,
    CompiledPuppet,
    Evaluation,
    integrate,
    retract,
    taut_mask,
)
from fantoccini.dynamics.derivatives import with_active_set
from fantoccini.motion import State


@dataclass(frozen=True)
class Search:
    """Bounds of the searches. Moves are in rad or m; gaps are relative to the row's scale."""

    max_move: float = 0.3
    """Longest move of one round: slopes of curved rows are valid nearby only."""
    near_gap: float = 0.5  # -h below which a move may reach a row
    near_taut_gap: float = 0.05
    """-h below which a move may reach a row while taut rows are closed, by shorter moves."""
    gap_rounding: float = 1e-14  # |h| that counts as rounding
    move_rounding: float = 1e-15  # Move that counts as rounding and ends the search
    violation_cost: float = 1e8
    """Weight of violations against moves if rows contradict one another [1/m^2]."""
    max_decrease_ratio: float = 0.999
    """Largest ratio of violations after and before a move; usually it is far smaller."""
    nearest_move: float = 1e-12  # Move below which a state counts as the nearest
    release_move: float = 1e-4  # Move below which Newton's method releases rows that push
    distance_growth: float = 0.01
    """Allowed growth of the distance to q_0, because its metric M_DD changes."""
    difference: float = 1e-6
    """Step of the finite differences for Newton's matrix; it only affects the convergence."""
    pushes: tuple[float, ...] = (0.03, 0.1, 0.1, 0.3, 0.3, 1.0, 1.0)
    """Sizes of pushes off a configuration at which the search stalled, as their largest parts."""
    seed: int = 17
    max_rounds: int = 100  # Maximum number of rounds onto the rows; usually below ten
    max_taut_rounds: int = 20
    max_halvings: int = 6
    max_approaches: int = 15  # Maximum number of rounds towards the nearest state
    max_newton_rounds: int = 20


SEARCH = Search()


def difference_quotient(
    marionette: CompiledPuppet, q_D: Array, function: Callable[[Array], Array], step: float
) -> Array:
    """Central difference quotient (m, n_vD) of a function (m,) of a configuration."""
    n = marionette.coordinates.n_vD
    moves = np.concatenate([np.eye(n), -np.eye(n)]) * step
    values = np.array([function(q) for q in retract(marionette, q_D, moves)])
    return (values[:n] - values[n:]).T / (2 * step)


def project(marionette: CompiledPuppet, x: State) -> State:
    """The nearest admissible state; see :meth:`Marionette.project`.

    Positions first: M (q - q_0) + A_D^T y = 0 with h <= 0, y >= 0 and y . h = 0 or, if that does
    not converge, a nearby state with h <= 0. Then velocities: hdot <= 0 on closed rows.
    """
    taut = ActiveSet.at_state(marionette, x, Evaluation.at_state(marionette, x)).held & taut_mask(
        marionette, x
    )
    solution, violations = moved_onto_rows(marionette, x)
    if violations:
        raise StateError(
            "no state of the puppet was found that fits these string ends and lengths: "
            f"{violations}. "
            f"Tried: moves onto the strings and limits, from there and {len(SEARCH.pushes)} places "
            "nearby"
        )
    solution = _onto_taut_rows(marionette, solution, taut)
    evaluation = Evaluation.at_state(marionette, solution)
    scale = marionette.row_scales(solution.q_D, solution.q_K)
    # Winches that slip absorb the speed instead.
    is_firmly_held = (np.abs(evaluation.h) <= ROW_TOLERANCES.start_gap * scale) & ~np.isfinite(
        marionette.max_forces
    )
    wires = marionette.two_sided
    rows = np.flatnonzero(is_firmly_held | wires)
    impulse = evaluation.complementarity(rows, evaluation.hdot[rows], wires | solution.taut)
    if not impulse.solved:
        impulse = evaluation.complementarity(rows, evaluation.hdot[rows], wires)
    if not impulse.solved:
        names = ", ".join(marionette.names_of(rows, impulse.ray))
        raise StateError(f"no velocity of the puppet fits these driven velocities: {names}")
    v_D = solution.v_D - evaluation.solve_factor(evaluation.W[:, rows] @ impulse.x)
    return with_active_set(marionette, solution.replace(v_D=v_D, taut=solution.taut))


def moved_onto_rows(marionette: CompiledPuppet, x: State) -> tuple[State, str]:
    """The state moved onto the rows with unchanged velocities; remaining violations, in words."""
    solution, violation = onto_rows(marionette, x)
    best_state, least_violation = solution, violation
    rng = np.random.default_rng(SEARCH.seed)
    for size in SEARCH.pushes:
        if violation <= ROW_TOLERANCES.start_gap:
            break
        push = rng.uniform(-size, size, len(x.v_D))
        solution, violation = onto_rows(marionette, x.replace(q_D=retract(marionette, x.q_D, push)))
        if violation < least_violation:
            best_state, least_violation = solution, violation
    if violation > ROW_TOLERANCES.start_gap:
        return best_state, violated_rows(marionette, best_state)
    if solution is not x:
        solution = _nearest_state(marionette, solution, x)
    return solution, ""


def violated_rows(marionette: CompiledPuppet, x: State) -> str:
    """Violated rows with their violations, in words; may be ""."""
    h, scale = Evaluation.at_state(marionette, x).h, marionette.row_scales(x.q_D, x.q_K)
    n_strings, texts = len(marionette.tree.strings), []
    for i in np.flatnonzero(_violation(marionette, h) > ROW_TOLERANCES.start_gap * scale):
        if i >= n_strings:
            text = f"is exceeded by {h[i]:.3g}"
        elif h[i] > 0.0:
            text = f"is too short by {1e3 * h[i]:.3g} mm"
        else:
            text = f"is too long by {-1e3 * h[i]:.3g} mm, and a wire"
        texts.append(f"{marionette.tree.row_names[i]} {text}")
    return ", ".join(texts)


def _violation(marionette: CompiledPuppet, h: Array) -> Array:
    """Violations (n_rows,) >= 0; 0 for a satisfied row."""
    return np.where(marionette.two_sided, np.abs(h), np.maximum(h, 0.0))


def onto_rows(marionette: CompiledPuppet, x: State) -> tuple[State, float]:
    """The state moved along the rows' slopes onto them, and its largest relative violation.

    Steps are halved until the violation falls. A state that violates no row is unchanged.
    """
    scale, wires = marionette.row_scales(x.q_D, x.q_K), marionette.two_sided
    evaluation = Evaluation.at_state(marionette, x)
    violation = _violation(marionette, evaluation.h) / scale
    for _ in range(SEARCH.max_rounds):
        if np.max(violation, initial=0.0) <= SEARCH.gap_rounding:
            break
        rows = np.flatnonzero((evaluation.h > -SEARCH.near_gap * scale) | wires)
        move = evaluation.solve_factor(_least_move(marionette, evaluation, rows))
        size = _largest_entry(move)
        if not SEARCH.move_rounding < size < np.inf:
            break
        step_fraction = min(1.0, SEARCH.max_move / size)
        for _ in range(SEARCH.max_halvings):
            candidate = x.replace(q_D=retract(marionette, x.q_D, step_fraction * move))
            at_candidate = Evaluation.at_state(marionette, candidate)
            remaining = _violation(marionette, at_candidate.h) / scale
            if np.linalg.norm(remaining) < SEARCH.max_decrease_ratio * np.linalg.norm(violation):
                break
            step_fraction *= 0.5
        else:
            break
        x, evaluation, violation = candidate, at_candidate, remaining
    return x, float(np.max(violation, initial=0.0))


def _onto_taut_rows(marionette: CompiledPuppet, x: State, taut: MaskRows) -> State:
    """The nearest state in the metric of M_DD with h = 0 on taut rows and h <= 0 on others.

    ``x`` must satisfy the rows, with the taut ones nearly closed. Taut rows that contradict one
    another stay slack in the state returned.
    """
    solution_state, wires = x, marionette.two_sided
    if not np.any(taut):
        return x.replace(taut=taut)
    scale = marionette.row_scales(x.q_D, x.q_K)
    for _ in range(SEARCH.max_taut_rounds):
        evaluation = Evaluation.at_state(marionette, solution_state)
        is_off = (
            np.where(taut | wires, np.abs(evaluation.h), evaluation.h) > SEARCH.gap_rounding * scale
        )
        if not np.any(is_off):
            break
        rows = np.flatnonzero((evaluation.h > -SEARCH.near_taut_gap * scale) | taut | wires)
        solution = evaluation.complementarity(rows, evaluation.h[rows], taut | wires)
        if not solution.solved:
            break
        move = -evaluation.solve_factor(evaluation.W[:, rows] @ solution.x)
        move *= min(1.0, SEARCH.max_move / max(_largest_entry(move), SEARCH.max_move))
        solution_state = solution_state.replace(q_D=integrate(marionette, solution_state.q_D, move))
    h = Evaluation.at_state(marionette, solution_state).h
    is_met = np.abs(h) <= ROW_TOLERANCES.start_gap * scale
    if np.all(is_met | ((h <= ROW_TOLERANCES.start_gap * scale) & ~taut & ~wires)):
        return solution_state.replace(taut=taut)
    met_taut = taut & is_met
    return _onto_taut_rows(
        marionette, x, met_taut if np.any(met_taut != taut) else np.zeros_like(taut)
    )


def _largest_entry(move: Array) -> float:
    """Largest part of a move [rad or m]."""
    return float(np.max(np.abs(move), initial=0.0))


def _least_move(marionette: CompiledPuppet, evaluation: Evaluation, rows: Indices) -> Array:
    """The shortest y with h + W^T y <= 0, or with the least violation."""
    W, h, wires = evaluation.W[:, rows], evaluation.h[rows], marionette.two_sided[rows]
    solution = evaluation.complementarity(rows, h, marionette.two_sided)
    if solution.solved:
        return -W @ solution.x
    # min |y|^2 + k |s|^2 with h + W^T y <= s: this adds 1/k to the diagonal of W^T W.
    from scipy.optimize import lsq_linear  # slow to import, and only contradictions need it

    damping = np.sqrt(np.trace(W.T @ W) / (SEARCH.violation_cost * len(rows)))
    stacked = np.vstack([W, np.eye(len(rows)) * damping])
    # x of min |tall x|^2 / 2 - h . x, completed to a square.
    target = np.linalg.lstsq(stacked.T, h, rcond=None)[0]
    lower = np.where(wires, -np.inf, 0.0)
    return -W @ lsq_linear(stacked, target, (lower, np.inf), method="bvls").x


def _nearest_state(marionette: CompiledPuppet, x: State, origin: State) -> State:
    """The state moved along the rows until it is nearest to ``origin``.

    mu > 0 damps moves, min |q + dq - q_0|_M^2 + mu |dq|_M^2: with mu = 0, curved rows make long
    moves overshoot. Newton's method completes searches that converge slowly.
    """
    wires, scale, mu = marionette.two_sided, marionette.row_scales(x.q_D, x.q_K), 0.0
    pulling_rows: tuple[Indices, Array] = np.zeros(0, dtype=np.intp), np.zeros(0)
    for _ in range(SEARCH.max_approaches):
        evaluation = Evaluation.at_state(marionette, x)
        offset = _offset(marionette, evaluation, x, origin)
        rows = np.flatnonzero((evaluation.h > -SEARCH.near_gap * scale) | wires)
        W, free_move = evaluation.W[:, rows], offset / (1.0 + mu)
        solution = evaluation.complementarity(rows, evaluation.h[rows] + W.T @ free_move, wires)
        move = evaluation.solve_factor(free_move - W @ solution.x)
        size = _largest_entry(move)
        if not solution.solved or not SEARCH.nearest_move < size < np.inf:
            return x
        move *= min(1.0, SEARCH.max_move / size)
        candidate, violation = onto_rows(
            marionette, x.replace(q_D=retract(marionette, x.q_D, move))
        )
        new_offset = _offset(
            marionette, Evaluation.at_state(marionette, candidate), candidate, origin
        )
        max_distance = (1.0 + SEARCH.distance_growth) * np.linalg.norm(offset)
        if violation > ROW_TOLERANCES.start_gap or np.linalg.norm(new_offset) > max_distance:
            mu = max(4.0 * mu, 1.0)
            continue
        is_pulling = (solution.x != 0.0) | wires[rows]
        pulling_rows = rows[is_pulling], (1.0 + mu) * solution.x[is_pulling]
        x, mu = candidate, (0.5 * mu if mu > 0.1 else 0.0)
    return _stationary(marionette, x, origin, *pulling_rows) or x


def _stationary(
    marionette: CompiledPuppet, x: State, origin: State, rows: Indices, pull: Array
) -> State | None:
    """The state nearest to ``origin``, F away = W pull and h = 0 on rows, by Newton's method.

    Rows that push are released. None if it does not converge to a state that satisfies all rows
    and is as near.
    """
    n, evaluation = marionette.coordinates.n_vD, Evaluation.at_state(marionette, x)
    max_distance = (1.0 + SEARCH.distance_growth) * np.linalg.norm(
        _offset(marionette, evaluation, x, origin)
    )

    def residual(q_D: Array) -> Array:
        """Residual (n + len(rows),) of the two equations."""
        y = x.replace(q_D=q_D)
        evaluation = Evaluation.at_state(marionette, y)
        return np.append(
            _offset(marionette, evaluation, y, origin) - evaluation.W[:, rows] @ pull,
            evaluation.h[rows],
        )

    for _ in range(SEARCH.max_newton_rounds):
        jacobian = difference_quotient(marionette, x.q_D, residual, SEARCH.difference)
        W = np.vstack(
            [-Evaluation.at_state(marionette, x).W[:, rows], np.zeros((len(rows), len(rows)))]
        )
        step = np.linalg.lstsq(np.hstack([jacobian, W]), -residual(x.q_D), rcond=1e-12)[0]
        size = _largest_entry(step[:n])
        if not size < SEARCH.max_move:
            return None
        x = x.replace(q_D=retract(marionette, x.q_D, step[:n]))
        pull = pull + step[n:]
        is_pulling = (pull >= 0.0) | marionette.two_sided[rows]
        if size < SEARCH.nearest_move and np.all(is_pulling):
            break
        if size < SEARCH.release_move:
            rows, pull = rows[is_pulling], pull[is_pulling]
    else:
        return None
    x, violation = onto_rows(marionette, x)
    distance = np.linalg.norm(_offset(marionette, Evaluation.at_state(marionette, x), x, origin))
    return None if violation > ROW_TOLERANCES.start_gap or distance > max_distance else x


def _offset(marionette: CompiledPuppet, evaluation: Evaluation, x: State, origin: State) -> Array:
    """The move to the configuration ``origin``, in coordinates with M_DD the identity."""
    table = marionette.coordinates
    index_pairs = table.scalars_D, table.quaternions_D
    F_inverse = evaluation.solve_factor(np.eye(table.n_vD)).T
    move = tangent.between(*index_pairs, x.q_D, origin.q_D, table.n_vD)
    return np.asarray(np.linalg.solve(F_inverse, move), dtype=float)
