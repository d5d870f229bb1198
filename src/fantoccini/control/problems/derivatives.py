"""Derivatives of a segment's end by its start and its accelerations.

In z = (dq_D, dv_D, dq_K, dv_K), with tangent vectors dq::

    z_end = A z_start + B dacc_K

by central differences, all at once: of the time-stepper in lanes, or of any other map of states.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, MaskRows, tangent
from fantoccini.control.tasks import StateArrays, flattened
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import (
    POSE,
    GoalNumbers,
    RolloutPool,
    RolloutSettings,
    RunOptions,
    Solids,
)


@dataclass(frozen=True)
class _Steps:
    """Steps of finite differences, and what they resolve."""

    central: float = 1e-4
    """Step of central differences, by default [rad, m and their rates]."""
    forward: float = 1e-7
    """Step of forward differences of gaps [rad or m]."""
    rank: float = 1e-6
    """Singular values of taut strings' Jacobians, relative to the largest, that count as 0."""


_STEPS = _Steps()


def segment_derivatives(
    marionette: Marionette,
    starts: StateArrays,
    acceleration: Array,
    options: RunOptions,
    looks: int,
    threads: int = 1,
    onto: Array | None = None,
    apart: float = _STEPS.central,
) -> tuple[Array, Array]:
    """Derivatives of m segments, by the time-stepper.

    Args:
        marionette: the puppet.
        starts: (m,) states.
        acceleration: (m, n_vK) of the driven coordinates.
        options: of the time-stepper; ``save_every`` steps make a look.
        looks: that the segments last.
        threads: that share the work.
        onto: (m, n_z, n_z) projections of changes of the starts; see :func:`taut_projection`.
        apart: size of the changes [rad, m and their rates].

    Returns:
        A (m, n_z, n_z) and B (m, n_z, n_vK).
    """
    pool = RolloutPool(
        marionette.libraries.rollouts, _unbounded(marionette, options, looks), threads
    )

    def ends(near: StateArrays, acc_K: Array) -> StateArrays:
        every = np.arange(len(acc_K))
        return StateArrays(**pool(near.parts, every, acc_K[:, None], np.ones_like(every)).states)

    return central_differences(marionette, ends, starts, acceleration, onto, apart)


StateMap = Callable[[StateArrays, Array], StateArrays]
"""States (n,) and accelerations (n, n_vK) -> the states (n,) to which they lead."""


def central_differences(
    marionette: Marionette,
    end: StateMap,
    starts: StateArrays,
    acceleration: Array,
    onto: Array | None = None,
    apart: float = _STEPS.central,
) -> tuple[Array, Array]:
    """Derivatives of a map of states, A (m, n_z, n_z) and B (m, n_z, n_vK).

    Args:
        marionette: the puppet.
        end: the map; called once, with all changed states, start by start.
        starts, acceleration, onto, apart: see :func:`segment_derivatives`.
    """
    table, m = marionette.coordinates, len(acceleration)
    n, k = table.n_vD, table.n_vK
    places_D = table.scalars_D, table.quaternions_D
    places_K = table.scalars_K, table.quaternions_K
    size = 2 * n + 3 * k
    changes = np.tile(np.eye(size), (m, 1, 1))
    if onto is not None:
        changes[:, : size - k, : size - k] = onto.swapaxes(1, 2)
    z = apart * np.concatenate([changes, -changes], axis=1)
    q_D, v_D, q_K, v_K, acc_K = np.split(z, np.cumsum([n, n, k, k]), axis=2)
    near = StateArrays(
        tangent.moved(*places_D, starts.q_D[:, None], q_D),
        starts.v_D[:, None] + v_D,
        np.repeat(starts.slip[:, None], 2 * size, axis=1),
        tangent.moved(*places_K, starts.q_K[:, None], q_K),
        starts.v_K[:, None] + v_K,
    )
    found = end(near.flat, flattened(acceleration[:, None] + acc_K))
    ends = {name: a.reshape(m, 2, size, -1) for name, a in found.parts.items()}
    answers = (
        tangent.between(*places_D, ends["q_D"][:, 1], ends["q_D"][:, 0], n),
        ends["v_D"][:, 0] - ends["v_D"][:, 1],
        tangent.between(*places_K, ends["q_K"][:, 1], ends["q_K"][:, 0], k),
        ends["v_K"][:, 0] - ends["v_K"][:, 1],
    )
    by = np.concatenate(answers, axis=2).swapaxes(1, 2) / (2.0 * apart)
    return by[:, :, : size - k], by[:, :, size - k :]


def _unbounded(marionette: Marionette, options: RunOptions, looks: int) -> RolloutSettings:
    """Settings of rollouts that nothing stops."""
    table = marionette.coordinates
    fast, far = np.full(table.n_vK, np.inf), np.full(table.n_qK, np.inf)
    none_D, none_K = np.zeros(table.n_vD), np.zeros(table.n_vK)
    nowhere = GoalNumbers(POSE, np.zeros(table.n_qD), np.zeros(table.n_qD), none_D, none_D, none_K)
    return RolloutSettings(
        options=options,
        looks=looks,
        p=marionette.p,
        winches=marionette.winches,
        bounds={"speed": fast, "acceleration": fast, "low": -far, "high": far},
        margin=0.0,
        slack=True,
        solids=Solids.none(marionette.tree),
        goal=nowhere,
        tolerance=-1.0,
    )


def taut_projection(marionette: Marionette, at: StateArrays, held: MaskRows) -> Array:
    """(m, n_z, n_z) projections of changes onto those that leave taut strings taut::

        dh = A_D dq_D + A_K dq_K = 0
        dhdot = A_D dv_D + A_K dv_K + (d hdot / dq) dq = 0

    by the least change of dq_D, then of dv_D.

    Args:
        marionette: the puppet.
        at: (m,) states.
        held: (m, n_strings) bool, the taut strings.
    """
    table = marionette.coordinates
    n, k = table.n_vD, table.n_vK
    m, ways = len(held), n + k
    steps = _STEPS.forward * np.concatenate([np.zeros((1, ways)), np.eye(ways)])
    places_D = table.scalars_D, table.quaternions_D
    places_K = table.scalars_K, table.quaternions_K
    q_D = tangent.moved(*places_D, at.q_D[:, None], steps[:, :n]).reshape(m * (ways + 1), -1)
    q_K = tangent.moved(*places_K, at.q_K[:, None], steps[:, n:]).reshape(m * (ways + 1), -1)
    v_D, v_K = (np.repeat(v, ways + 1, axis=0) for v in (at.v_D, at.v_K))
    h = marionette.library.evaluate("rows", q_D=q_D, q_K=q_K, p=marionette.p).h
    hdot = marionette.library.evaluate(
        "dynamics",
        q_D=q_D,
        v_D=v_D,
        q_K=q_K,
        v_K=v_K,
        acc_K=np.zeros_like(v_K),
        u_D=np.zeros_like(v_D),
        p=marionette.p,
    ).hdot
    strings = held.shape[1]
    h_q, hdot_q = (
        _forward_differences(a[:, :strings].reshape(m, ways + 1, strings), held) for a in (h, hdot)
    )
    back = np.linalg.pinv(h_q[..., :n], rcond=_STEPS.rank)
    one = np.tile(np.eye(ways), (m, 1, 1))
    one[:, :n] -= back @ h_q
    place = np.concatenate([np.arange(n), 2 * n + np.arange(k)])
    rate = np.concatenate([n + np.arange(n), 2 * n + k + np.arange(k)])
    onto = np.zeros((m, 2 * ways, 2 * ways))
    onto[:, place[:, None], place] = onto[:, rate[:, None], rate] = one
    onto[:, n : 2 * n, place] = -back @ hdot_q @ one
    return onto


def _forward_differences(found: Array, held: MaskRows) -> Array:
    """(m, n_strings, n) derivatives from (m, 1 + n, n_strings) values; 0 where not held."""
    return (found[:, 1:] - found[:, :1]).swapaxes(1, 2) / _STEPS.forward * held[..., None]
