"""First states of segments, projected onto their active strings and limits.

A state that violates a taut string would begin with a jerk. Therefore every change of a first
state is followed by the smallest change of configuration, and then of velocity, with which

    h = 0,  hdot = 0   on active rows,        h <= 0,  hdot <= 0   on the others

A segment is a piece of the record that is simulated from its own first state. A row is a string or
a joint limit with its gap h (path length minus string length); the active ones are taut. q_D and
v_D are dynamic coordinates and velocities. In names, K stands for driven coordinates: ends and
lengths of strings, driven joints.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, Indices, MaskRows
from fantoccini.dynamics import Marionette
from fantoccini.dynamics.compiled import integrate

CLOSED_GAP = 1e-8
"""A row with h >= -CLOSED_GAP is closed [row's unit]."""
MAX_CLOSED_SPEED = 1e-7
"""Largest opening speed of a closed row [row's unit per second]."""
MAX_STEP_GAP = 2e-5
"""The same bound for h after a time step, which leaves such gaps [row's unit]."""
MAX_ITERATIONS = 8
"""Largest number of iterations of a projection."""
REGULARISATION = 1e-10
"""Regularisation of redundant rows, relative to the trace of their matrix."""


class Rows(NamedTuple):
    """Gaps h of S states, their rates and their derivatives by name, (S, n_rows, ...)."""

    h: Array
    hdot: Array
    derivatives: dict[str, Array]


@dataclass(frozen=True, eq=False)
class RowProjection:
    """Projection of S states onto strings and limits.

    Attributes:
        marionette: the puppet.
        q_K, v_K: (S, ...) driven coordinates and velocities at the states' times.
        p: (n_p,) parameters.
    """

    marionette: Marionette
    q_K: Array
    v_K: Array
    p: Array

    def rows(self, q_D: Array, v_D: Array) -> Rows:
        """The rows of states (S, ...)."""
        marionette, p = self.marionette, np.broadcast_to(self.p, (len(q_D), len(self.p)))
        values = {"q_D": q_D, "v_D": v_D, "q_K": self.q_K, "v_K": self.v_K, "p": p}
        values |= {"acc_D": np.zeros_like(v_D), "acc_K": np.zeros_like(self.v_K)}
        derivatives = marionette.libraries.derivatives.at("rows_by", values)
        h = next(iter(marionette.library.at("rows", values).values()))
        rate = (derivatives["A_D"] @ v_D[..., None] + derivatives["A_K"] @ self.v_K[..., None])[
            ..., 0
        ]
        return Rows(h, rate, derivatives)

    def closed_rows(self, q_D: Array, v_D: Array) -> MaskRows:
        """(S, n_rows) bool, rows that are closed and not opening."""
        rows = self.rows(q_D, v_D)
        closed = (rows.h >= -CLOSED_GAP) & (rows.hdot >= -MAX_CLOSED_SPEED)
        return np.asarray(closed | self.marionette.two_sided)

    def nearly_closed_rows(self, q_D: Array, v_D: Array) -> MaskRows:
        """(S, n_rows) bool, rows that are closed up to the error of a time step."""
        return np.asarray((self.rows(q_D, v_D).h >= -MAX_STEP_GAP) | self.marionette.two_sided)

    def slack_rows(self, q_D: Array, v_D: Array) -> MaskRows:
        """(S, n_rows) bool, rows that are open."""
        return np.asarray((self.rows(q_D, v_D).h < -MAX_STEP_GAP) & ~self.marionette.two_sided)

    def subset(self, indices: MaskRows | Indices) -> RowProjection:
        """The projection of chosen states."""
        return RowProjection(self.marionette, self.q_K[indices], self.v_K[indices], self.p)

    def project(self, q_D: Array, v_D: Array, active_rows: MaskRows) -> tuple[Array, Array]:
        """The states projected onto active rows, and out of rows that they violate."""
        q_D, v_D = q_D.copy(), v_D.copy()
        remaining = np.arange(len(q_D))
        for _ in range(MAX_ITERATIONS):
            rows = self.subset(remaining).rows(q_D[remaining], v_D[remaining])
            active = active_rows[remaining] | (rows.h > 0.0)
            violation = np.where(active, rows.h, 0.0)
            move = _smallest_move(rows.derivatives["A_D"], violation, active)
            q_D[remaining] = integrate(self.marionette, q_D[remaining], -move)
            remaining = remaining[
                np.max(np.abs(violation), axis=1, initial=0.0) >= 0.01 * CLOSED_GAP
            ]
            if len(remaining) == 0:
                break
        rows = self.rows(q_D, v_D)
        remaining = np.arange(len(q_D))
        for _ in range(MAX_ITERATIONS):
            A_D, A_K = rows.derivatives["A_D"][remaining], rows.derivatives["A_K"][remaining]
            rate = (A_D @ v_D[remaining, :, None] + A_K @ self.v_K[remaining, :, None])[..., 0]
            active = active_rows[remaining] | ((rows.h[remaining] >= -CLOSED_GAP) & (rate > 0.0))
            violation = np.where(active, rate, 0.0)
            v_D[remaining] -= _smallest_move(A_D, violation, active)
            remaining = remaining[
                np.max(np.abs(violation), axis=1, initial=0.0) >= 0.01 * MAX_CLOSED_SPEED
            ]
            if len(remaining) == 0:
                break
        return q_D, v_D

    def state_derivatives(
        self,
        q_D: Array,
        v_D: Array,
        active_rows: MaskRows,
        parameter_indices: list[int],
        offset_indices: list[int],
    ) -> Array:
        """(S, 2 n_vD, 2 n_vD + P) derivatives of projected states by states and unknowns."""
        derivatives = self.rows(q_D, v_D).derivatives
        n = v_D.shape[1]
        width = 2 * n + len(parameter_indices) + len(offset_indices)
        Z = np.zeros((len(q_D), 2 * n, width))
        Z[:] = np.eye(2 * n, width)
        direct_part = np.concatenate(
            [derivatives["h_p"][..., parameter_indices], derivatives["A_K"][..., offset_indices]],
            axis=-1,
        )
        gap = derivatives["A_D"] @ Z[:, :n]
        gap[..., 2 * n :] += direct_part
        Z[:, :n] -= _smallest_move(derivatives["A_D"], gap, active_rows)
        rate = derivatives["hdot_q"] @ Z[:, :n] + derivatives["A_D"] @ Z[:, n:]
        rate[..., 2 * n :] += np.concatenate(
            [
                derivatives["hdot_p"][..., parameter_indices],
                derivatives["hdot_qK"][..., offset_indices],
            ],
            axis=-1,
        )
        Z[:, n:] -= _smallest_move(derivatives["A_D"], rate, active_rows)
        return Z


def _smallest_move(A: Array, violation: Array, active: MaskRows) -> Array:
    """The smallest dx (S, n[, m]) with A dx = violation on the active rows of every state."""
    is_vector = violation.ndim == 2
    violation = violation[..., None] if is_vector else violation
    A_active = np.where(active[..., None], A, 0.0)
    G = A_active @ A_active.swapaxes(-1, -2)
    size = np.trace(G, axis1=1, axis2=2)[:, None] + 1.0
    G += np.where(active, REGULARISATION * size, 1.0)[..., None] * np.eye(G.shape[1])
    move = A_active.swapaxes(-1, -2) @ np.linalg.solve(
        G, np.where(active[..., None], violation, 0.0)
    )
    return np.asarray(move[..., 0] if is_vector else move)
