"""Laws that lead a puppet to an equilibrium from all about it."""

from __future__ import annotations

import numpy as np

from fantoccini.arrays import Array, ConfigD, ConfigK, MaskRows
from fantoccini.marionette import Marionette
from fantoccini.motion import tangent
from fantoccini.runtime import (
    POSE,
    Funnel,
    GoalNumbers,
    RunOptions,
    Solids,
    Sweeper,
    Terms,
)

_EPS = 1e-4
"""Of central differences [rad, m and their rates]."""

_DOUBLINGS = 7
"""The law looks 2^7 segments ahead."""

_SPEED = 0.1
"""Weight of velocities beside positions [s]."""

_EFFORT = 0.01
"""Weight of accelerations beside positions [s^4]."""


def funnel(
    marionette: Marionette,
    q_D: ConfigD,
    q_K: ConfigK,
    moves: MaskRows,
    options: RunOptions,
    looks: int,
) -> Funnel:
    """The law of a linear-quadratic regulator about an equilibrium, a step a segment.

        min sum |dq_D|^2 + _SPEED^2 (|v_D|^2 + |dq_K|^2 + |v_K|^2) + _EFFORT |acc_K|^2

    Args:
        marionette: the puppet.
        q_D, q_K: the equilibrium.
        moves: (n_vK,) bool, the driven coordinates that may move.
        options: of the time-stepper; ``save_every`` steps make a look.
        looks: that a segment has.
    """
    A, B = segment_slopes(marionette, q_D, q_K, options, looks)
    n, k = marionette.coordinates.n_vD, marionette.coordinates.n_vK
    weight = np.full(2 * (n + k), _SPEED**2)
    weight[:n] = 1.0
    gains = np.zeros((k, 2 * (n + k)))
    gains[moves] = regulator(A, B[:, moves], np.diag(weight), _EFFORT * np.eye(int(moves.sum())))
    return Funnel(q_D, q_K, gains)


def segment_slopes(
    marionette: Marionette, q_D: ConfigD, q_K: ConfigK, options: RunOptions, looks: int
) -> tuple[Array, Array]:
    """z_next = A z + B acc_K over a segment from rest, z = (dq_D, v_D, dq_K, v_K).

    By central differences, all side by side in lanes.

    Args:
        marionette: the puppet.
        q_D, q_K: the configuration.
        options: of the time-stepper.
        looks: that a segment has.

    Returns:
        A (n_z, n_z) and B (n_z, n_vK).
    """
    table = marionette.coordinates
    n, k = table.n_vD, table.n_vK
    places_D = table.scalars_D, table.quaternions_D
    places_K = table.scalars_K, table.quaternions_K
    size = 2 * n + 3 * k
    z = _EPS * np.concatenate([np.eye(size), -np.eye(size)])
    parts = np.split(z, np.cumsum([n, n, k, k]), axis=1)
    starts = {
        "q_D": tangent.moved(*places_D, q_D, parts[0]), "v_D": parts[1],
        "slip": np.zeros((2 * size, len(marionette.tree.strings))),
        "q_K": tangent.moved(*places_K, q_K, parts[2]), "v_K": parts[3],
    }  # fmt: skip
    free = np.full(k, np.inf), np.full(k, np.inf), np.full(table.n_qK, -np.inf)
    none = np.zeros(table.n_qD), np.zeros(table.n_qD), np.zeros(n)
    nothing = Solids.none(len(marionette.tree.strings))
    terms = Terms(
        options, looks, marionette.p, marionette.winches, (*free, -free[2]), 0.0, nothing,
        GoalNumbers(POSE, *none), -1.0,
    )  # fmt: skip
    sweeper = Sweeper(marionette.motions, terms, 1)
    rows = np.arange(2 * size)
    made = sweeper(starts, rows, parts[4][:, None], np.ones(2 * size)).states
    after = np.concatenate(
        [
            tangent.between(*places_D, q_D, made["q_D"][:, 0], n),
            made["v_D"][:, 0],
            tangent.between(*places_K, q_K, made["q_K"][:, 0], k),
            made["v_K"][:, 0],
        ],
        axis=1,
    )
    slopes = ((after[:size] - after[size:]) / (2.0 * _EPS)).T
    return slopes[:, : size - k], slopes[:, size - k :]


def regulator(A: Array, B: Array, Q: Array, R: Array) -> Array:
    """Gains K of acc = -K z that minimise sum z'Q z + acc'R acc over 2^7 steps of z' = A z + B acc.

    By the structure-preserving doubling of Chu, Fan and Lin (2005): exact for that many steps, so
    that it holds where nothing can be done about a mode; SciPy's solution for endlessly many steps
    needs that something can, and takes 7 to 17 times as long.
    """
    unit, G, H, C = np.eye(len(A)), B @ np.linalg.solve(R, B.T), Q, A
    for _ in range(_DOUBLINGS):
        both = np.linalg.solve(unit + G @ H, np.concatenate([C, G], axis=1))
        ahead, spread = both[:, : len(A)], both[:, len(A) :]
        G, H, C = G + C @ spread @ C.T, H + ahead.T @ H @ C, C @ ahead
    return np.linalg.solve(R + B.T @ H @ B, B.T @ H @ A)
