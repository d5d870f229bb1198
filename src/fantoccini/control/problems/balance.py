"""Equilibria of a puppet at a goal, or nearest to it, as a start of planning.

q_D are the dynamic coordinates and q_K the driven ones, the ends and lengths of strings; n_vD and
n_vK are the numbers of their velocities. A wire is a string that also pushes. A marionette is a
puppet with its compiled equations; `marionette.puppet` is the description in its file. A taut
string pulls, a slack one does not. With the inertia matrix M_DD = F^T F, w_0 = F^-T f are the
scaled forces f without strings, and W those of unit tensions; T are tensions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from fantoccini.base import Array, ConfigD, ConfigK, MaskRows
from fantoccini.control.tasks import Goal, StateArrays
from fantoccini.dynamics.compiled import retract
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State


@dataclass(frozen=True)
class _Tolerances:
    """Weights and tolerances of the search for an equilibrium."""

    driven_weight: float = 1e-3
    """Weight of displacements of driven coordinates, which fixes irrelevant ones."""
    dynamic_weight: float = 1e-4
    """Weight of displacements of dynamic coordinates."""
    target_overlap: float = 0.002
    """Overlap to aim for at required touches, so that they close before the inputs rest [m]."""
    min_tension: float = 1e-6
    """Minimum tension, relative to the weight, to count as taut."""
    min_slack: float = 0.005
    """Smallest slack of the other strings [m]."""
    limit_margin: float = 0.05
    """Distance kept from limits during the search [rad or m]."""
    n_stages: int = 8
    """Number of stages of the approach to a goal; the puppet hangs at the end of each."""
    difference: float = 1e-7
    """Step of finite differences [m or rad]."""
    last_step: float = 1e-6
    """Step that ends the iteration [m or rad]; the remaining error is 1e-7 of it."""
    max_step: float = 0.5
    """Largest change of a coordinate in one iteration [m or rad]."""
    min_step: float = 1e-9
    """Damped step that ends the iteration [m or rad]."""
    min_damping: float = 1e-10
    """Smallest damping after a step that failed, relative to the largest squared singular value."""
    min_decrease: float = 1e-6
    """Smallest decrease of the sum of squares in one iteration, relative to the sum."""
    max_iterations: int = 60
    """Largest number of iterations, including those that failed."""


_TOLERANCES = _Tolerances()


def nearest_equilibrium(
    marionette: Marionette, goal: Goal, start: State, movable: MaskRows
) -> tuple[ConfigD, ConfigK, float]:
    """The pose nearest to a goal and to an equilibrium on its strings.

        min over q_D, q_K and T >= 0 of |w_0 - W T|^2 + |goal residuals|^2 + |limits exceeded|^2,
        acc_D = F^-1 (w_0 - W T) at rest

    Each driven length makes its string just taut; slack strings keep their slack at the start. If
    the goal is a single configuration, q_D is that configuration.

    Args:
        marionette: the puppet.
        goal: goal of the plan.
        start: initial guess.
        movable: (n_vK,) bool, the driven velocities that may be nonzero.

    Returns:
        q_D, q_K, and the norm |w_0 - W T|, which is 0 in an equilibrium.
    """
    tree, p, table = marionette.tree, marionette.p, marionette.coordinates
    driven_strings = [
        (i, s.driven_length[0])
        for i, s in enumerate(tree.strings)
        if s.driven_length and movable[s.driven_length[1]]
    ]
    driven_lengths = {k for _, k in driven_strings}
    end_indices = [q for q, v in table.scalars_K if movable[v] and q not in driven_lengths]
    fixed_q_D = goal.single_configuration
    n_D = 0 if fixed_q_D is not None else table.n_vD
    origin = start.q_D if fixed_q_D is None else fixed_q_D
    initial_x = np.concatenate([np.zeros(n_D), start.q_K[end_indices]])

    def configurations(x: Array) -> tuple[Array, Array]:
        """(n, n_qD), (n, n_qK) configurations of points (n, n_D + ends)."""
        q_D = retract(marionette, origin, x[:, :n_D]) if n_D else np.tile(origin, (len(x), 1))
        q_K = np.tile(start.q_K, (len(x), 1))
        q_K[:, end_indices] = x[:, n_D:]
        return q_D, q_K

    def residuals(x: Array) -> Array:
        """(n, m) w_0 - W T, goal residuals, violations of limits, weighted displacements."""
        q_D, q_K = configurations(x)
        residual_force, _, limits = best_support(marionette, q_D, q_K)
        residual_force = residual_force[:, is_puppet_velocity]
        soft_K = _TOLERANCES.driven_weight * regularisation
        soft_D = _TOLERANCES.dynamic_weight * regularisation
        parts = [residual_force, soft_K * (x - initial_x)[:, n_D:]]
        if fixed_q_D is None:
            q_K = with_taut_lengths(q_D, q_K)
            displacement = q_K - start.q_K
            parts.append(np.maximum(limits + regularisation * _TOLERANCES.limit_margin, 0.0))
            parts += [soft_K * displacement[:, list(driven_lengths)], soft_D * x[:, :n_D]]
            zero_v_D, zero_v_K = np.zeros((len(x), table.n_vD)), np.zeros((len(x), table.n_vK))
            slip = np.zeros((len(x), len(tree.strings)))
            goal_residuals = target_residuals(StateArrays(q_D, zero_v_D, slip, q_K, zero_v_K))
            parts.append(
                goal_residuals
                if initial_residuals is None
                else goal_residuals - remaining_share * initial_residuals
            )
        return np.concatenate(parts, axis=1)

    def target_residuals(states: StateArrays) -> Array:
        """(n, m) residuals of the goal, and of the overlap at required touches."""
        goal_residuals = goal.residuals(states)
        if not goal.touches:
            return goal_residuals
        return np.concatenate(
            [goal_residuals, goal.gaps(states) + _TOLERANCES.target_overlap], axis=1
        )

    def with_taut_lengths(q_D: Array, q_K: Array) -> Array:
        """q_K with the lengths at which the strings are just taut."""
        if driven_strings:
            q_K[:, [k for _, k in driven_strings]] = 0.0
            h = marionette.library.evaluate("rows", q_D=q_D, q_K=q_K, p=p).h
            for i, k in driven_strings:
                q_K[:, k] = h[:, i]
        return q_K

    is_puppet_velocity = puppet_velocity_mask(marionette)
    regularisation, x, remaining_share = 1.0, initial_x, 0.0
    initial_residuals: Array | None = None
    if len(initial_x) and tree.strings:
        if fixed_q_D is None:
            initial_residuals = target_residuals(StateArrays.of(start))[0]
            for stage in range(1, _TOLERANCES.n_stages):
                remaining_share = 1.0 - stage / _TOLERANCES.n_stages
                x = _least_squares(residuals, x)
            remaining_share = 0.0
            x = _least_squares(residuals, x)
        # The last search has no weights on displacements and limits.
        regularisation = 0.0
        x = _least_squares(residuals, x)
    q_D, q_K = configurations(x[None])
    residual_force, tension, _ = best_support(marionette, q_D, q_K)
    q_K = with_taut_lengths(q_D, q_K)[0]
    h = marionette.library.evaluate("rows", q_D=start.q_D, q_K=start.q_K, p=p).h
    for i, k in driven_strings:
        if not tension[0, i] > _TOLERANCES.min_tension * marionette.weight:
            q_K[k] += max(_TOLERANCES.min_slack, -h[i])
    return q_D[0], q_K, float(np.linalg.norm(residual_force[:, is_puppet_velocity]))


def puppet_velocity_mask(marionette: Marionette) -> MaskRows:
    """(n_vD,) bool, the dynamic velocities of puppets; those of props hang from no string."""
    is_puppet_velocity = np.ones(marionette.coordinates.n_vD, dtype=bool)
    for link in marionette.tree.links:
        if link.name in marionette.puppet.props:
            is_puppet_velocity[link.v] = False
    return is_puppet_velocity


def best_support(marionette: Marionette, q_D: Array, q_K: Array) -> tuple[Array, Array, Array]:
    """The tensions that best balance configurations at rest.

    All strings count as taut, regardless of their lengths; limits exert no force.

    Args:
        marionette: the puppet.
        q_D, q_K: (n, n_qD) dynamic and (n, n_qK) driven (kinematic) configurations.

    Returns:
        w_0 - W T (n, n_vD), T (n, n_strings) [N], and h of limits (n, n_limits).
    """
    tree, table, n = marionette.tree, marionette.coordinates, len(q_D)
    wires = [i for i, s in enumerate(tree.strings) if s.wire]
    zero_v_D, zero_v_K = np.zeros((n, table.n_vD)), np.zeros((n, table.n_vK))
    values = marionette.library.evaluate(
        "dynamics",
        q_D=q_D,
        v_D=zero_v_D,
        q_K=q_K,
        v_K=zero_v_K,
        acc_K=zero_v_K,
        u_D=zero_v_D,
        p=marionette.p,
    )
    w0, W, h_limit = values.w0, values.W, values.h_limit
    # Wires also push.
    directions = np.concatenate([W, -W[:, :, wires]], axis=2)
    if not directions.shape[2]:  # SciPy's nnls writes out of bounds without columns
        return w0, np.zeros((n, 0)), h_limit
    forces = np.array([nnls(A, w)[0] for A, w in zip(directions, w0, strict=True)])
    tension = forces[:, : len(tree.strings)]
    tension[:, wires] -= forces[:, len(tree.strings) :]
    return w0 - np.einsum("nij,nj->ni", W, tension), tension, h_limit


def _least_squares(residuals: Callable[[Array], Array], x: Array) -> Array:
    """The minimiser x of a sum of squares |r|^2, by the method of Levenberg and Marquardt.

        dx = -V S (S^2 + d)^-1 U^T r, with the singular value decomposition dr/dx = U S V^T

    The damping d is 0 until a step fails to decrease the sum. All differences of an iteration are
    one call of the library: SciPy's least squares would take 10 ms, too long for a planner.

    Args:
        residuals: function of (n, k) points that returns (n, m) residuals.
        x: (k,) initial guess.
    """
    step = _TOLERANCES.difference
    steps, min_squares, best_x, damping = step * np.eye(len(x)), np.inf, x, 0.0
    for _ in range(_TOLERANCES.max_iterations):
        values = residuals(np.concatenate([x[None], x + steps]))
        squares = float(values[0] @ values[0])
        if squares < min_squares:
            has_decreased = squares < (1.0 - _TOLERANCES.min_decrease) * min_squares
            min_squares, best_x, damping = squares, x, 0.3 * damping
            U, S, Vt = np.linalg.svd((values[1:] - values[0]).T / step, full_matrices=False)
            projected = U.T @ values[0]
            if not has_decreased:
                break
        elif best_x is x:  # the sum is not finite at the initial guess
            break
        else:
            damping = max(10.0 * damping, _TOLERANCES.min_damping * S[0] ** 2)
        rank = np.count_nonzero(np.finfo(float).eps * max(len(values[0]), len(x)) * S[0] < S)
        change = -Vt[:rank].T @ (S[:rank] * projected[:rank] / (S[:rank] ** 2 + damping))
        max_change = float(np.max(np.abs(change)))
        if max_change < (_TOLERANCES.last_step if squares == min_squares else _TOLERANCES.min_step):
            return best_x + change
        x = best_x + change * min(1.0, _TOLERANCES.max_step / max_change)
    return best_x
