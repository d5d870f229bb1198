"""LQR laws, which bring a puppet to an equilibrium from a region around it.

LQR stands for linear-quadratic regulator: feedback that minimises squared deviations. q_D are the
dynamic coordinates and q_K the driven ones, the ends and lengths of strings. A segment is a piece
of motion with constant driven accelerations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import ConfigD, ConfigK, MaskRows, riccati
from fantoccini.control.problems.balance import best_support
from fantoccini.control.problems.derivatives import segment_derivatives, taut_projection
from fantoccini.control.tasks import RolloutOptions, StateArrays
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import LqrLaw, RunOptions

SPEED_WEIGHT = 0.1
"""Weight of velocities relative to positions, in all regulators [s]."""


@dataclass(frozen=True)
class _Weights:
    """Weights and horizon of the LQR laws."""

    doublings: int = 7
    """Number of doublings: the horizon is 2^7 segments."""
    accelerations: tuple[float, ...] = (0.01, 1.0)
    """Weights of accelerations relative to positions, one for each law [s^4]."""


_WEIGHTS = _Weights()


def lqr_laws(
    marionette: Marionette,
    q_D: ConfigD,
    q_K: ConfigK,
    movable: MaskRows,
    run_options: RunOptions,
    options: RolloutOptions,
) -> list[LqrLaw]:
    """Linear-quadratic regulators about an equilibrium, with one step per segment.

        min sum |dq_D|^2 + w^2 (|v_D|^2 + |dq_K|^2 + |v_K|^2) + r |acc_K|^2

    The first law damps swing fast, but may excite a puppet on many strings far from the
    equilibrium; the second is gentle.

    Args:
        marionette: the puppet.
        q_D, q_K: the equilibrium.
        movable: (n_vK,) bool, the driven velocities that may be nonzero.
        run_options: options of the time-stepper.
        options: options of the rollouts.
    """
    n, k = marionette.coordinates.n_vD, marionette.coordinates.n_vK
    strings = np.zeros((1, len(marionette.tree.strings)))
    state = StateArrays(q_D[None], np.zeros((1, n)), strings, q_K[None], np.zeros((1, k)))
    _, tension, _ = best_support(marionette, q_D[None], q_K[None])
    projection = taut_projection(marionette, state, tension != 0.0)
    A, B = (
        a[0]
        for a in segment_derivatives(
            marionette,
            state,
            np.zeros((1, k)),
            run_options,
            options.n_checks,
            options.threads,
            projection=projection,
        )
    )
    weight = np.full(2 * (n + k), SPEED_WEIGHT**2)
    weight[:n] = 1.0
    accelerations = np.array(_WEIGHTS.accelerations)[:, None, None] * np.eye(movable.sum())
    gains = np.zeros((len(accelerations), k, 2 * (n + k)))
    gains[:, movable] = riccati.stationary_gain(
        A, B[:, movable], np.diag(weight), accelerations, _WEIGHTS.doublings
    )
    return [LqrLaw(q_D, q_K, K) for K in gains]


def servo(
    marionette: Marionette, q_D: ConfigD, q_K: ConfigK, movable: MaskRows, segment: float
) -> LqrLaw:
    """The regulator of the driven coordinates alone, independent of the puppet's motion.

    Args:
        marionette: the puppet.
        q_D: (n_qD,) target configuration of the puppet.
        q_K: (n_qK,) target of the driven coordinates.
        movable: (n_vK,) bool, the driven velocities that may be nonzero.
        segment: duration of one step [s].
    """
    n, k = marionette.coordinates.n_vD, marionette.coordinates.n_vK
    A, B = np.array([[1.0, segment], [0.0, 1.0]]), np.array([[0.5 * segment**2], [segment]])
    Q = np.diag([1.0, SPEED_WEIGHT**2]) * SPEED_WEIGHT**2
    R = _WEIGHTS.accelerations[0] * SPEED_WEIGHT**2 * np.eye(1)
    gain = riccati.stationary_gain(A, B, Q, R, _WEIGHTS.doublings)[0]
    gains = np.zeros((k, 2 * (n + k)))
    for v in np.flatnonzero(movable):
        gains[v, [2 * n + v, 2 * n + k + v]] = gain
    return LqrLaw(q_D, q_K, gains)
