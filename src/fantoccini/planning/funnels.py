"""Laws that lead a puppet to an equilibrium from all about it."""

from __future__ import annotations

import numpy as np

from fantoccini.arrays import Array, ConfigD, ConfigK, MaskRows
from fantoccini.marionette import Marionette
from fantoccini.planning.balance import pulled
from fantoccini.planning.goals import Rows
from fantoccini.planning.slopes import segment_slopes, taut
from fantoccini.runtime import Funnel, RunOptions

_DOUBLINGS = 7
"""The law looks 2^7 segments ahead."""

_SPEED = 0.1
"""Weight of velocities beside positions [s]."""

_EFFORTS = (0.01, 1.0)
"""Weights of accelerations beside positions [s^4]."""


def funnels(
    marionette: Marionette,
    q_D: ConfigD,
    q_K: ConfigK,
    moves: MaskRows,
    options: RunOptions,
    looks: int,
    threads: int,
) -> list[Funnel]:
    """The laws of linear-quadratic regulators about an equilibrium, a step a segment.

        min sum |dq_D|^2 + _SPEED^2 (|v_D|^2 + |dq_K|^2 + |v_K|^2) + effort |acc_K|^2

    One takes swing out fast, but far from the equilibrium of a puppet on many strings it stirs up
    more than it takes out; the other is gentle.

    Args:
        marionette: the puppet.
        q_D, q_K: the equilibrium.
        moves: (n_vK,) bool, the driven coordinates that may move.
        options: of the time-stepper; ``save_every`` steps make a look.
        looks: that a segment has.
        threads: that share the work.
    """
    n, k = marionette.coordinates.n_vD, marionette.coordinates.n_vK
    strings = np.zeros((1, len(marionette.tree.strings)))
    at = Rows(q_D[None], np.zeros((1, n)), strings, q_K[None], np.zeros((1, k)))
    _, tension, _ = pulled(marionette, q_D[None], q_K[None])
    onto = taut(marionette, at, tension != 0.0)
    A, B = (
        a[0]
        for a in segment_slopes(
            marionette, at, np.zeros((1, k)), options, looks, threads, onto=onto
        )
    )
    weight = np.full(2 * (n + k), _SPEED**2)
    weight[:n] = 1.0
    efforts = np.array(_EFFORTS)[:, None, None] * np.eye(moves.sum())
    gains = np.zeros((len(efforts), k, 2 * (n + k)))
    gains[:, moves] = regulator(A, B[:, moves], np.diag(weight), efforts)
    return [Funnel(q_D, q_K, K) for K in gains]


def regulator(A: Array, B: Array, Q: Array, R: Array) -> Array:
    """Gains K of acc = -K z that minimise sum z'Q z + acc'R acc over 2^7 steps of z' = A z + B acc.

    For several R (..., n_a, n_a) at once.

    By the structure-preserving doubling of Chu, Fan and Lin (2005): exact for that many steps, so
    that it holds where nothing can be done about a mode; SciPy's solution for endlessly many steps
    needs that something can, and takes 7 to 17 times as long.
    """
    G = B @ np.linalg.solve(R, B.T)
    unit, H, C = np.eye(len(A)), np.broadcast_to(Q, G.shape), np.broadcast_to(A, G.shape)
    for _ in range(_DOUBLINGS):
        both = np.linalg.solve(unit + G @ H, np.concatenate([C, G], axis=-1))
        ahead, spread = both[..., : len(A)], both[..., len(A) :]
        G, H, C = G + C @ spread @ C.swapaxes(-1, -2), H + ahead.swapaxes(-1, -2) @ H @ C, C @ ahead
    return np.linalg.solve(R + B.T @ H @ B, B.T @ H @ A)


def regulators(A: Array, B: Array, Q: Array, R: Array, Q_m: Array) -> tuple[Array, Array]:
    """Gains K_k of a_k = -K_k z_k, by Riccati's recursion from the end::

        min z_m'Q_m z_m + sum over k < m of z_k'Q z_k + a_k'R a_k,   z_k+1 = A_k z_k + B_k a_k

    Args:
        A, B: (m, n_z, n_z), (m, n_z, n_a).
        Q, R, Q_m: weights.

    Returns:
        K (m, n_a, n_z), and P (m + 1, n_z, n_z) of what is still to be paid, z_k'P_k z_k.
    """
    gains, P = np.zeros(B.swapaxes(1, 2).shape), np.zeros((len(A) + 1, *Q.shape))
    P[-1] = Q_m
    for k in reversed(range(len(A))):
        gains[k], P[k] = before(A[k], B[k], Q, R, P[k + 1])
    return gains, P


def before(A: Array, B: Array, Q: Array, R: Array, P: Array) -> tuple[Array, Array]:
    """One step of Riccati's recursion, for many at once.

    Args:
        A, B: (..., n_z, n_z), (..., n_z, n_a).
        Q, R: weights.
        P: (..., n_z, n_z) of what is to be paid after the step.

    Returns:
        K (..., n_a, n_z), and P before the step.
    """
    later = B.swapaxes(-1, -2) @ P
    K = np.linalg.solve(R + later @ B, later @ A)
    P = Q + A.swapaxes(-1, -2) @ P @ (A - B @ K)
    return K, 0.5 * (P + P.swapaxes(-1, -2))
