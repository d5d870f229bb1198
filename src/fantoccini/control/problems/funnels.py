"""Funnels: feedback laws that lead a puppet to an equilibrium from a region around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, ConfigD, ConfigK, MaskRows
from fantoccini.control.problems.balance import best_support
from fantoccini.control.problems.derivatives import segment_derivatives, taut_projection
from fantoccini.control.problems.rollouts import RolloutOptions
from fantoccini.control.problems.state_arrays import StateArrays
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import Funnel, RunOptions

SPEED_WEIGHT = 0.1
"""Weight of velocities relative to positions, in all regulators [s]."""


@dataclass(frozen=True)
class _Weights:
    """Weights and horizon of the regulators of funnels."""

    doublings: int = 7
    """The horizon is 2^7 segments."""
    accelerations: tuple[float, ...] = (0.01, 1.0)
    """Weights of accelerations relative to positions, one for each law [s^4]."""


_WEIGHTS = _Weights()


def funnels(
    marionette: Marionette,
    q_D: ConfigD,
    q_K: ConfigK,
    moves: MaskRows,
    run_options: RunOptions,
    options: RolloutOptions,
) -> list[Funnel]:
    """Linear-quadratic regulators about an equilibrium, with one step a segment.

        min sum |dq_D|^2 + w^2 (|v_D|^2 + |dq_K|^2 + |v_K|^2) + r |acc_K|^2

    The first damps swing fast, but may excite a puppet on many strings far from the equilibrium;
    the second is gentle.

    Args:
        marionette: the puppet.
        q_D, q_K: the equilibrium.
        moves: (n_vK,) bool, the driven velocities that may be nonzero.
        run_options: of the time-stepper.
        options: of the rollouts.
    """
    n, k = marionette.coordinates.n_vD, marionette.coordinates.n_vK
    strings = np.zeros((1, len(marionette.tree.strings)))
    at = StateArrays(q_D[None], np.zeros((1, n)), strings, q_K[None], np.zeros((1, k)))
    _, tension, _ = best_support(marionette, q_D[None], q_K[None])
    onto = taut_projection(marionette, at, tension != 0.0)
    A, B = (
        a[0]
        for a in segment_derivatives(
            marionette, at, np.zeros((1, k)), run_options, options.looks, options.threads, onto=onto
        )
    )
    weight = np.full(2 * (n + k), SPEED_WEIGHT**2)
    weight[:n] = 1.0
    accelerations = np.array(_WEIGHTS.accelerations)[:, None, None] * np.eye(moves.sum())
    gains = np.zeros((len(accelerations), k, 2 * (n + k)))
    gains[:, moves] = regulator(A, B[:, moves], np.diag(weight), accelerations)
    return [Funnel(q_D, q_K, K) for K in gains]


def servo(
    marionette: Marionette, q_D: ConfigD, q_K: ConfigK, moves: MaskRows, segment: float
) -> Funnel:
    """The regulator that leads the driven coordinates alone, whatever the puppet does.

    Args:
        marionette: the puppet.
        q_D: (n_qD,) where it leads the puppet.
        q_K: (n_qK,) where it leads the driven coordinates.
        moves: (n_vK,) bool, the driven velocities that may be nonzero.
        segment: duration of one step [s].
    """
    n, k = marionette.coordinates.n_vD, marionette.coordinates.n_vK
    A, B = np.array([[1.0, segment], [0.0, 1.0]]), np.array([[0.5 * segment**2], [segment]])
    R = _WEIGHTS.accelerations[0] * SPEED_WEIGHT**2 * np.eye(1)
    gain = regulator(A, B, np.diag([1.0, SPEED_WEIGHT**2]) * SPEED_WEIGHT**2, R)[0]
    gains = np.zeros((k, 2 * (n + k)))
    for v in np.flatnonzero(moves):
        gains[v, [2 * n + v, 2 * n + k + v]] = gain
    return Funnel(q_D, q_K, gains)


def regulator(A: Array, B: Array, Q: Array, R: Array) -> Array:
    """Gains K of acc = -K z that minimise sum z'Q z + acc'R acc over 2^7 steps of z' = A z + B acc.

    By the structure-preserving doubling of Chu, Fan and Lin (2005): exact for that horizon, also
    where a mode cannot be stabilised. SciPy's solution for an infinite horizon needs that it can,
    and takes 7 to 17 times as long.

    Args:
        A, B: (n_z, n_z), (n_z, n_a).
        Q: (n_z, n_z) weights.
        R: (..., n_a, n_a) weights, several at once.

    Returns:
        (..., n_a, n_z).
    """
    G = B @ np.linalg.solve(R, B.T)
    unit, H, C = np.eye(len(A)), np.broadcast_to(Q, G.shape), np.broadcast_to(A, G.shape)
    for _ in range(_WEIGHTS.doublings):
        both = np.linalg.solve(unit + G @ H, np.concatenate([C, G], axis=-1))
        ahead, spread = both[..., : len(A)], both[..., len(A) :]
        G, H, C = G + C @ spread @ C.swapaxes(-1, -2), H + ahead.swapaxes(-1, -2) @ H @ C, C @ ahead
    return np.asarray(np.linalg.solve(R + B.T @ H @ B, B.T @ H @ A), dtype=float)


def regulators(A: Array, B: Array, Q: Array, R: Array, Q_m: Array) -> tuple[Array, Array]:
    """Gains K_k of a_k = -K_k z_k, by Riccati's recursion from the end::

        min z_m'Q_m z_m + sum over k < m of z_k'Q z_k + a_k'R a_k,   z_k+1 = A_k z_k + B_k a_k

    Args:
        A, B: (m, n_z, n_z), (m, n_z, n_a).
        Q, R, Q_m: weights.

    Returns:
        K (m, n_a, n_z), and P (m + 1, n_z, n_z) of the cost to go, z_k'P_k z_k.
    """
    gains, P = np.zeros(B.swapaxes(1, 2).shape), np.zeros((len(A) + 1, *Q.shape))
    P[-1] = Q_m
    for k in reversed(range(len(A))):
        gains[k], P[k] = riccati_step(A[k], B[k], Q, R, P[k + 1])
    return gains, P


def riccati_step(A: Array, B: Array, Q: Array, R: Array, P: Array) -> tuple[Array, Array]:
    """One step of Riccati's recursion, for many at once.

    Args:
        A, B: (..., n_z, n_z), (..., n_z, n_a).
        Q, R: weights.
        P: (..., n_z, n_z) of the cost to go after the step.

    Returns:
        K (..., n_a, n_z), and P before the step.
    """
    later = B.swapaxes(-1, -2) @ P
    K = np.asarray(np.linalg.solve(R + later @ B, later @ A), dtype=float)
    P = Q + A.swapaxes(-1, -2) @ P @ (A - B @ K)
    return K, 0.5 * (P + P.swapaxes(-1, -2))
