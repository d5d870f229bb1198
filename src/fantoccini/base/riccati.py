"""Riccati's recursion: gains of linear-quadratic regulators, u = -K z.

    min  z_m'P_m z_m + sum over k of z_k'Q_k z_k + 2 z_k'S_k u_k + u_k'R_k u_k
    z_k+1 = A_k z_k + B_k u_k

:func:`step` factors a stage; :func:`gains` and :func:`stationary_gain` call it. Only the compiled
recursion (``kernel/cpp/fantoccini/search/stage_riccati.hpp``) handles bounds of inputs and
couplings between stages.

z_k is the state at stage k and u_k the input; Q, R, S and P are weights.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base.arrays import Array


def step(
    A: Array, B: Array, Q: Array, R: Array, P: Array, S: Array | None = None
) -> tuple[Array, Array]:
    """The gain and the cost to go before a stage, or of several stages at once.

        K = (R + B'P B)^-1 (S' + B'P A),   P <- Q + A'P (A - B K) - S K

    Args:
        A, B: (..., n_z, n_z), (..., n_z, n_u).
        Q, R: (..., n_z, n_z), (..., n_u, n_u) weights.
        P: (..., n_z, n_z) cost to go after the stage.
        S: (..., n_z, n_u) cross weights; 0 by default.

    Returns:
        K (..., n_u, n_z), and P before the stage.
    """
    BP = B.swapaxes(-1, -2) @ P
    right_side = BP @ A if S is None else BP @ A + S.swapaxes(-1, -2)
    K = np.asarray(np.linalg.solve(R + BP @ B, right_side), dtype=float)
    P = Q + A.swapaxes(-1, -2) @ P @ (A - B @ K)
    if S is not None:
        P = P - S @ K
    return K, 0.5 * (P + P.swapaxes(-1, -2))


def gains(
    A: Array, B: Array, Q: Array, R: Array, end_cost: Array, S: Array | None = None
) -> tuple[Array, Array]:
    """The gains of m stages.

    Args:
        A, B: (m, n_z, n_z), (m, n_z, n_u).
        Q, R: weights of every stage (m, ...), or the same for all.
        end_cost: (n_z, n_z) P_m.
        S: (m, n_z, n_u); 0 by default.

    Returns:
        K (m, n_u, n_z), and P (m + 1, n_z, n_z) of the cost to go, z_k'P_k z_k.
    """
    m, n_z, n_u = B.shape
    Q, R = np.broadcast_to(Q, (m, n_z, n_z)), np.broadcast_to(R, (m, n_u, n_u))
    K, P = np.zeros((m, n_u, n_z)), np.zeros((m + 1, n_z, n_z))
    P[m] = end_cost
    for k in reversed(range(m)):
        K[k], P[k] = step(A[k], B[k], Q[k], R[k], P[k + 1], None if S is None else S[k])
    return K, P


def stationary_gain(A: Array, B: Array, Q: Array, R: Array, doublings: int) -> Array:
    """The gain of the first of 2^doublings equal stages.

    Structure-preserving doubling (Chu, Fan and Lin 2005): exact for that horizon, even if some
    modes cannot be stabilised. SciPy's solution for an infinite horizon requires stabilisable
    modes, and takes 7 to 17 times as long.

    Args:
        A, B: (n_z, n_z), (n_z, n_u).
        Q: (n_z, n_z) weights.
        R: (..., n_u, n_u) weights, several at once.
        doublings: number of doublings of the horizon.

    Returns:
        (..., n_u, n_z).
    """
    G = B @ np.linalg.solve(R, B.T)
    identity, P, C = np.eye(len(A)), np.broadcast_to(Q, G.shape), np.broadcast_to(A, G.shape)
    for _ in range(doublings):
        solution = np.linalg.solve(identity + G @ P, np.concatenate([C, G], axis=-1))
        propagated, solved_G = solution[..., : len(A)], solution[..., len(A) :]
        G, P, C = (
            G + C @ solved_G @ C.swapaxes(-1, -2),
            P + propagated.swapaxes(-1, -2) @ P @ C,
            C @ propagated,
        )
    return step(A, B, Q, R, P)[0]
