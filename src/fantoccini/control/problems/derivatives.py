"""Derivatives of a segment's end with respect to its start and its accelerations.

For z = (dq_D, dv_D, dq_K, dv_K), with tangent vectors dq::

    z_end = A z_start + B dacc_K

by central differences in one batch, of the time-stepper in lanes or of any other map of states.

q_D are the dynamic coordinates and q_K the driven ones, with velocities v_D and v_K and driven
accelerations acc_K. A segment is a piece of motion with constant acc_K. Lanes are runs that the
vector unit of the processor advances together. h is the gap of a string, path length minus string
length; hdot and hddot are its rates. A taut string pulls, a slack one does not.
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
    """Steps and tolerance of finite differences."""

    central: float = 1e-4
    """Default step of central differences [rad, m and their rates]."""
    forward: float = 1e-7
    """Step of forward differences of gaps [rad or m]."""
    rank: float = 1e-6
    """Singular values of taut strings' Jacobians up to this count as 0, relative to the largest."""


_STEPS = _Steps()


def segment_derivatives(
    marionette: Marionette,
    starts: StateArrays,
    acceleration: Array,
    options: RunOptions,
    n_checks: int,
    threads: int = 1,
    projection: Array | None = None,
    difference: float = _STEPS.central,
) -> tuple[Array, Array]:
    """Derivatives of m segments, by the time-stepper.

    Args:
        marionette: the puppet.
        starts: (m,) states.
        acceleration: (m, n_vK) accelerations of the driven coordinates.
        options: options of the time-stepper; a check comes every ``save_every`` steps.
        n_checks: number of checks in a segment.
        threads: number of threads.
        projection: (m, n_z, n_z) projections of changes of the starts; see :func:`taut_projection`.
        difference: size of the changes [rad, m and their rates].

    Returns:
        A (m, n_z, n_z) and B (m, n_z, n_vK).
    """
    pool = RolloutPool(
        marionette.libraries.rollouts, _unbounded(marionette, options, n_checks), threads
    )

    def end_states(perturbed: StateArrays, acc_K: Array) -> StateArrays:
        index = np.arange(len(acc_K))
        return StateArrays(
            **pool(perturbed.parts, index, acc_K[:, None], np.ones_like(index)).states
        )

    return central_differences(marionette, end_states, starts, acceleration, projection, difference)


StateMap = Callable[[StateArrays, Array], StateArrays]
"""States (n,) and accelerations (n, n_vK) -> the states (n,) to which they lead."""


def central_differences(
    marionette: Marionette,
    state_map: StateMap,
    starts: StateArrays,
    acceleration: Array,
    projection: Array | None = None,
    difference: float = _STEPS.central,
) -> tuple[Array, Array]:
    """Derivatives of a map of states, A (m, n_z, n_z) and B (m, n_z, n_vK).

    Args:
        marionette: the puppet.
        state_map: the map; called once, with all changed states, in the order of the starts.
        starts, acceleration, projection, difference: see :func:`segment_derivatives`.
    """
    table, m = marionette.coordinates, len(acceleration)
    n, k = table.n_vD, table.n_vK
    indices_D = table.scalars_D, table.quaternions_D
    indices_K = table.scalars_K, table.quaternions_K
    size = 2 * n + 3 * k
    changes = np.tile(np.eye(size), (m, 1, 1))
    if projection is not None:
        changes[:, : size - k, : size - k] = projection.swapaxes(1, 2)
    z = difference * np.concatenate([changes, -changes], axis=1)
    q_D, v_D, q_K, v_K, acc_K = np.split(z, np.cumsum([n, n, k, k]), axis=2)
    perturbed = StateArrays(
        tangent.moved(*indices_D, starts.q_D[:, None], q_D),
        starts.v_D[:, None] + v_D,
        np.repeat(starts.slip[:, None], 2 * size, axis=1),
        tangent.moved(*indices_K, starts.q_K[:, None], q_K),
        starts.v_K[:, None] + v_K,
    )
    end_states = state_map(perturbed.flat, flattened(acceleration[:, None] + acc_K))
    ends = {name: a.reshape(m, 2, size, -1) for name, a in end_states.parts.items()}
    differences = (
        tangent.between(*indices_D, ends["q_D"][:, 1], ends["q_D"][:, 0], n),
        ends["v_D"][:, 0] - ends["v_D"][:, 1],
        tangent.between(*indices_K, ends["q_K"][:, 1], ends["q_K"][:, 0], k),
        ends["v_K"][:, 0] - ends["v_K"][:, 1],
    )
    derivatives = np.concatenate(differences, axis=2).swapaxes(1, 2) / (2.0 * difference)
    return derivatives[:, :, : size - k], derivatives[:, :, size - k :]


def _unbounded(marionette: Marionette, options: RunOptions, n_checks: int) -> RolloutSettings:
    """Settings of rollouts without bounds, obstacles or goal."""
    table = marionette.coordinates
    unlimited_v, unlimited_q = np.full(table.n_vK, np.inf), np.full(table.n_qK, np.inf)
    zero_v_D, zero_v_K = np.zeros(table.n_vD), np.zeros(table.n_vK)
    no_goal = GoalNumbers(
        POSE, np.zeros(table.n_qD), np.zeros(table.n_qD), zero_v_D, zero_v_D, zero_v_K
    )
    return RolloutSettings(
        options=options,
        n_checks=n_checks,
        p=marionette.p,
        winches=marionette.winches,
        bounds={
            "speed": unlimited_v,
            "acceleration": unlimited_v,
            "low": -unlimited_q,
            "high": unlimited_q,
        },
        margin=0.0,
        slack=True,
        solids=Solids.none(marionette.tree),
        goal=no_goal,
        tolerance=-1.0,
    )


def taut_projection(marionette: Marionette, states: StateArrays, taut: MaskRows) -> Array:
    """(m, n_z, n_z) projections onto changes that keep taut strings taut::

        dh = A_D dq_D + A_K dq_K = 0
        dhdot = A_D dv_D + A_K dv_K + (d hdot / dq) dq = 0

    with the least change of dq_D, then of dv_D.

    Args:
        marionette: the puppet.
        states: (m,) states.
        taut: (m, n_strings) bool, the taut strings.
    """
    table = marionette.coordinates
    n, k = table.n_vD, table.n_vK
    m, n_directions = len(taut), n + k
    steps = _STEPS.forward * np.concatenate([np.zeros((1, n_directions)), np.eye(n_directions)])
    indices_D = table.scalars_D, table.quaternions_D
    indices_K = table.scalars_K, table.quaternions_K
    q_D = tangent.moved(*indices_D, states.q_D[:, None], steps[:, :n]).reshape(
        m * (n_directions + 1), -1
    )
    q_K = tangent.moved(*indices_K, states.q_K[:, None], steps[:, n:]).reshape(
        m * (n_directions + 1), -1
    )
    v_D, v_K = (np.repeat(v, n_directions + 1, axis=0) for v in (states.v_D, states.v_K))
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
    strings = taut.shape[1]
    h_q, hdot_q = (
        _forward_differences(a[:, :strings].reshape(m, n_directions + 1, strings), taut)
        for a in (h, hdot)
    )
    pseudoinverse = np.linalg.pinv(h_q[..., :n], rcond=_STEPS.rank)
    position_part = np.tile(np.eye(n_directions), (m, 1, 1))
    position_part[:, :n] -= pseudoinverse @ h_q
    q_indices = np.concatenate([np.arange(n), 2 * n + np.arange(k)])
    v_indices = np.concatenate([n + np.arange(n), 2 * n + k + np.arange(k)])
    projection = np.zeros((m, 2 * n_directions, 2 * n_directions))
    projection[:, q_indices[:, None], q_indices] = projection[:, v_indices[:, None], v_indices] = (
        position_part
    )
    projection[:, n : 2 * n, q_indices] = -pseudoinverse @ hdot_q @ position_part
    return projection


def _forward_differences(values: Array, taut: MaskRows) -> Array:
    """(m, n_strings, n) derivatives from (m, 1 + n, n_strings) values; 0 for strings not held."""
    return (values[:, 1:] - values[:, :1]).swapaxes(1, 2) / _STEPS.forward * taut[..., None]
